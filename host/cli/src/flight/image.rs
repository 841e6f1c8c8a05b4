//! A recording that is played to the image of a board: `mgw replay --image`. The virtual board, which
//! does it, is built of the sources of the firmware, by a program of theirs.

use std::path::Path;
use std::process::{Command, Stdio};

use host_protocol::Trip;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::told;
use crate::failure::Failure;
use crate::json::axis;
use crate::output::Output;
use crate::words;

/// By how much the trip of an image may differ from the one that was recorded, µs.
pub const TOLERANCE_US: u64 = 200;
/// What plays it, among the sources.
const PLAYER: &str = ".ci/virtual-board";

/// What came of playing a recording to an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OnImage {
    /// The first axis that tripped when it was recorded, and its trip.
    pub recorded: (u8, Trip),
    /// What that axis has tripped with on the image, if it has.
    pub played: Option<Trip>,
    /// How many causes there were: frames and bytes of others, cables, pins.
    pub causes: usize,
    /// What nothing outside of a chip brings about, up to the trip.
    pub left_out: Vec<String>,
}

impl OnImage {
    /// By how much later than recorded the same trip came, µs; `None` where it was another or none.
    pub fn late_us(&self) -> Option<i64> {
        let (_, recorded) = self.recorded;
        let played = self.played.filter(|played| told(*played).0 == told(recorded).0)?;
        Some(played.time_us.cast_signed().saturating_sub(recorded.time_us.cast_signed()))
    }

    /// Whether it was the same trip.
    pub fn is_same(&self) -> bool {
        self.late_us().is_some_and(|late| late.unsigned_abs() <= TOLERANCE_US)
    }
}

/// Has the virtual board of these sources play a file, and prints what came of it; `wrong` is told
/// why it did not end as recorded.
pub fn run(
    sources: &Path,
    file: &Path,
    out: Output,
    wrong: impl Fn(String) -> Failure,
) -> Result<(), Failure> {
    let player = sources.join(PLAYER);
    if !player.is_file() {
        return Err(wrong(format!(
            "{} holds no sources of the firmware: it lacks {PLAYER}. Name them: --image SOURCES",
            sources.display()
        )));
    }
    let failed = |why: String| wrong(format!("{} replay: {why}", player.display()));
    let file = file.canonicalize().map_err(|error| failed(error.to_string()))?;
    let done = Command::new(&player)
        .arg("replay")
        .arg(file)
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if !done.status.success() {
        return Err(failed(format!("{}; it says above why", done.status)));
    }
    let played: Result<OnImage, String> =
        serde_json::from_slice(&done.stdout).map_err(|error| failed(error.to_string()))?;
    let on_image = played.map_err(&wrong)?;
    on_image.print(out)?;
    if on_image.is_same() {
        return Ok(());
    }
    Err(wrong("the image does not trip as was recorded".to_owned()))
}

impl OnImage {
    fn print(&self, out: Output) -> Result<(), Failure> {
        let (axis, recorded) = self.recorded;
        let trip = |trip: &Trip| axis::trip(trip, None);
        out.object(&json!({
            "event": "replayed_on_image", "axis": axis, "recorded": trip(&recorded),
            "played": self.played.as_ref().map(trip), "late_us": self.late_us(),
            "causes": self.causes, "left_out": self.left_out, "is_same": self.is_same(),
        }))?;
        for left_out in &self.left_out {
            out.text(format!("left out  {left_out}"))?;
        }
        let played = self.played.as_ref().map_or("no trip of it".to_owned(), |played| {
            let what = words::tripped(axis, &played.reason, None);
            format!("t={}  {what}", words::seconds(played.time_us))
        });
        let late = self.late_us().map_or(String::new(), |late| match late {
            ..0 => format!("; {} us earlier than recorded", late.unsigned_abs()),
            _ => format!("; {late} us later than recorded"),
        });
        out.text(format!("on image  {played}{late}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::TripReason;

    fn on_image(reason: TripReason, time_us: u64) -> OnImage {
        let trip = |reason, time_us| Trip {
            reason,
            time_us,
            velocity_rad_s: None,
            position_rad: None,
            current_a: None,
            unreachable: false,
        };
        OnImage {
            recorded: (3, trip(TripReason::EStop, 1_000)),
            played: Some(trip(reason, time_us)),
            causes: 1,
            left_out: Vec::new(),
        }
    }

    #[test]
    fn the_same_trip_within_200_us_is_the_same() {
        for (time_us, late_us, is_same) in [
            (1_000, 0, true),
            (800, -200, true),
            (1_200, 200, true),
            (799, -201, false),
            (1_201, 201, false),
        ] {
            let played = on_image(TripReason::EStop, time_us);
            assert_eq!((played.late_us(), played.is_same()), (Some(late_us), is_same));
        }
    }

    #[test]
    fn another_trip_or_none_is_not_the_same() {
        let other = on_image(TripReason::HostSilent, 1_000);
        assert_eq!((other.late_us(), other.is_same()), (None, false));
        let none = OnImage { played: None, ..other };
        assert_eq!((none.late_us(), none.is_same()), (None, false));
    }
}
