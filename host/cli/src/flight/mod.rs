//! What a flight recorder has kept, played again: `mgw replay`.

mod image;

pub use image::OnImage;

use std::path::Path;
use std::time::Duration;

use flight_recorder::{Call, RecordedBoard, Recording, Replay};
use gateway::{
    Board, BusPort, Event, FlightReadError, LinkPort, MAX_SNAPSHOT, Outgoing, SaveError,
};
use host_protocol::messages::request_name;
use host_protocol::{CanFrame, Deframer, Kind, Trip, TripReason};
use serde_json::json;

use crate::failure::Failure;
use crate::given;
use crate::json::axis;
use crate::output::Output;
use crate::words::{self, hex};

/// Between a serial bus and the bytes that came on it.
const SERIAL: &str = "  < bytes ";
/// The longest file that is read: more than any board has memory.
const MAX_FILE: u64 = 64 << 20;

/// What came of playing a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Replayed {
    /// The first axis that tripped when it was recorded, and its trip.
    pub recorded: Option<(u8, Trip)>,
    /// The trip of that axis when it was played.
    pub played: Option<Trip>,
    /// Each trip that was played, in their order.
    pub trips: Vec<(u8, Trip)>,
    /// From when to when calls were made, µs of the gateway's time.
    pub span_us: (u64, u64),
    /// How many.
    pub calls: u64,
    /// When the core first was in another state than was recorded, µs, if it was.
    pub diverged_us: Option<u64>,
}

impl Replayed {
    /// Whether all was as it was recorded: the trip to the microsecond, or that there was none, and
    /// the state.
    pub fn is_same(&self) -> bool {
        let recorded = self.recorded.map(|(_, trip)| told(trip));
        recorded == self.played.map(told) && self.diverged_us.is_none()
    }
}

/// What a trip is, without what its stop has made of it since: the fault word of a motor that has
/// refused a command is read behind it.
pub fn told(trip: Trip) -> (TripReason, u64) {
    let reason = match trip.reason {
        TripReason::CommandRefused { .. } => TripReason::CommandRefused { faults: None },
        reason => reason,
    };
    (reason, trip.time_us)
}

/// The board of a recording, for ever.
pub fn leak(board: &RecordedBoard<'_>) -> &'static Board {
    fn text(text: &str) -> &'static str {
        Box::leak(text.into())
    }
    fn rates(rates: &[u32]) -> &'static [u32] {
        Box::leak(rates.into())
    }
    let bus = |(kind, bitrates): &(_, heapless::Vec<u32, _>)| BusPort {
        kind: *kind,
        bitrates: rates(bitrates),
    };
    let buses: Box<[BusPort]> = board.buses.iter().map(bus).collect();
    let links: Box<[LinkPort]> =
        board.links.iter().map(|bauds| LinkPort { bauds: rates(bauds) }).collect();
    Box::leak(Box::new(Board {
        name: text(board.name),
        firmware: text(board.firmware),
        build_id: text(board.build_id),
        boot: board.boot,
        crash_report: text(board.crash_report),
        e_stop_input: board.e_stop_input,
        enable_output: board.enable_output,
        buses: Box::leak(buses),
        bus_limit: board.bus_limit,
        links: Box::leak(links),
    }))
}

/// Who recorded, and who plays: where the builds differ, what is played differs.
fn builds(RecordedBoard { name, firmware, build_id, .. }: &RecordedBoard<'_>) -> String {
    format!(
        "it was recorded by {name} {firmware} ({build_id}), and this is mgw {}",
        env!("CARGO_PKG_VERSION")
    )
}

/// Plays a recording on the core of this program, and hands each line of what happened to `tell`,
/// with its time in µs.
///
/// # Errors
/// Where it is another build's.
pub fn play(
    recording: &Recording<'_>,
    mut tell: impl FnMut(u64, String),
) -> Result<Replayed, String> {
    let mut scratch = vec![0; MAX_SNAPSHOT];
    let replay = Replay::new(leak(&recording.board), recording, &mut scratch);
    let mut replay = Box::new(replay.map_err(|_| {
        format!("the core of this program cannot go on from it; {}", builds(&recording.board))
    })?);
    let since = recording.halves.first().map_or(0, |half| half.since.as_micros());
    let mut hosts: Vec<Deframer> = recording.board.links.iter().map(|_| Deframer::new()).collect();
    let mut replayed = Replayed {
        recorded: recording.trip,
        played: None,
        trips: Vec::new(),
        span_us: (since, since),
        calls: 0,
        diverged_us: None,
    };
    let mut tripped = replay.core().tripped();
    while let Some(step) = replay.step() {
        let step = match step {
            Ok(step) => step,
            Err(diverged) => {
                let at = diverged.at.as_micros();
                tell(at, diverged.to_string());
                replayed.diverged_us.get_or_insert(at);
                continue;
            }
        };
        let at = step.at.as_micros();
        (replayed.calls, replayed.span_us.1) = (replayed.calls + 1, at);
        if let Call::Handle(event) = step.call {
            tell_event(&event, &mut hosts, |line| tell(at, line));
        }
        if let Some(transmit) = &step.transmit
            && let Call::PollTransmit { bus } = step.call
        {
            tell(at, format!("bus {bus}  > {}", frame_text(&transmit.frame)));
        }
        let now_tripped = replay.core().tripped();
        for (axis, trip) in replay.core().trips(now_tripped.without(tripped)) {
            tell(trip.time_us, format!("axis {axis} trips: {}", trip.reason));
            replayed.trips.push((axis, trip));
            if recording.trip.is_some_and(|(recorded, _)| recorded == axis) {
                // One that was cleared may come before it.
                if !replayed.is_same() {
                    replayed.played = Some(trip);
                }
            }
        }
        tripped = now_tripped;
    }
    Ok(replayed)
}

/// Lines and their times. Bytes of a serial bus come one by one, and are put together.
#[derive(Default)]
struct Lines(Vec<(u64, String)>);

impl Lines {
    fn add(&mut self, at: u64, line: String) {
        if let Some((_, before)) = self.0.last_mut()
            && let Some((bus, byte)) = line.split_once(SERIAL)
            && before.strip_prefix(bus).is_some_and(|rest| rest.starts_with(SERIAL))
        {
            before.push_str(byte);
        } else {
            self.0.push((at, line));
        }
    }
}

fn tell_event(event: &Event<'_>, hosts: &mut [Deframer], mut tell: impl FnMut(String)) {
    match *event {
        Event::HostBytes { link, mut bytes } => {
            let Some(host) = hosts.get_mut(usize::from(link)) else { return };
            while !bytes.is_empty() {
                match host.take(&mut bytes) {
                    Some(Ok(frame)) if frame.kind != Kind::Reply => {
                        tell(format!(
                            "host {link} < {}",
                            request_name(frame.number).unwrap_or("an unknown request")
                        ));
                    }
                    Some(Err(_)) => tell(format!("host {link} < bytes that are no frame")),
                    _ => {}
                }
            }
        }
        Event::HostLineError { link } => tell(format!("host {link} < noise")),
        Event::CanReceived { bus, frame } => tell(format!("bus {bus}  < {}", can_text(&frame))),
        Event::SerialReceived { bus, bytes, .. } => {
            tell(format!("bus {bus}{SERIAL}{}", hex(bytes)))
        }
        Event::Transmitted { bus, slot } => tell(format!("bus {bus}    slot {slot} has left")),
        Event::Cancelled { bus, slot } => tell(format!("bus {bus}    slot {slot} is given back")),
        Event::BusState { bus, state, transmit_errors, receive_errors } => {
            tell(format!("bus {bus}    is {state}, errors {transmit_errors}/{receive_errors}"))
        }
        Event::ReceiveOverflow { bus, lost } => tell(format!("bus {bus}    has lost {lost}")),
        Event::EStopInput { open } => {
            tell(format!("e-stop input {}", if open { "open" } else { "closed" }));
        }
        Event::Saved { result: Ok(()) } => tell("what was to be stored is".to_owned()),
        Event::Saved { result: Err(why) } => {
            tell(format!("it was not stored: {}", not_stored(why)))
        }
        Event::FlightRecord { result: Ok(_) } => tell("the flight recorder is read".to_owned()),
        Event::FlightRecord { result: Err(why) } => {
            tell(format!("the flight recorder is not read: {}", not_read(why)));
        }
        Event::Tick => {}
    }
}

fn frame_text(frame: &Outgoing) -> String {
    match frame {
        Outgoing::Can(frame) => can_text(frame),
        Outgoing::Serial(bytes) => hex(bytes),
    }
}

fn can_text(frame: &CanFrame) -> String {
    format!("{}#{}", host_protocol::CanId(frame.id()), hex(frame.data()))
}

/// A recording that was played: what happened, line by line, and what came of it.
pub struct Told {
    lines: Lines,
    replayed: Replayed,
    /// Who recorded and who played it.
    builds: String,
}

impl Told {
    /// Plays a recording.
    ///
    /// # Errors
    /// As [`play`].
    pub fn new(recording: &Recording<'_>) -> Result<Self, String> {
        let mut lines = Lines::default();
        let replayed = play(recording, |at, line| lines.add(at, line))?;
        Ok(Self { lines, replayed, builds: builds(&recording.board) })
    }

    /// Whether this is the trip of an axis that it was recorded for, or one that was played.
    pub fn has(&self, trip: (u8, Trip)) -> bool {
        let is_it = |other: &(u8, Trip)| is_same_trip(*other, trip);
        self.replayed.recorded.iter().chain(&self.replayed.trips).any(is_it)
    }

    /// Prints what happened `around` the trip, and whether it ended as recorded; if not, `wrong` is
    /// told why.
    pub fn print(
        &self,
        around: Duration,
        out: Output,
        wrong: impl Fn(String) -> Failure,
    ) -> Result<(), Failure> {
        let replayed = &self.replayed;
        let (from, to) = replayed.span_us;
        let trip_at = replayed.recorded.map_or(to, |(_, trip)| trip.time_us);
        let around = u64::try_from(around.as_micros()).unwrap_or(u64::MAX);
        let shown = trip_at.saturating_sub(around)..=trip_at.saturating_add(around);
        for (at, line) in self.lines.0.iter().filter(|(at, _)| shown.contains(at)) {
            out.event(
                "replayed_line",
                format!("t={}  {line}", words::seconds(*at)),
                json!({
                    "time_us": at, "text": line,
                }),
            )?;
        }
        let trip = |trip: Option<Trip>| trip.map(|trip| axis::trip(&trip, None));
        let axis = replayed.recorded.map(|(axis, _)| axis);
        out.object(&json!({
            "event": "replayed", "from_us": from, "to_us": to, "calls": replayed.calls,
            "axis": axis, "recorded": trip(replayed.recorded.map(|(_, trip)| trip)),
            "played": trip(replayed.played), "diverged_us": replayed.diverged_us,
            "is_same": replayed.recorded.is_some() && replayed.is_same(),
        }))?;
        let text = |axis: u8, trip: &Trip| {
            let what = words::tripped(axis, &trip.reason, None);
            format!("t={}  {what}", words::seconds(trip.time_us))
        };
        out.text(format!(
            "{} calls from t={} to t={}",
            replayed.calls,
            words::seconds(from),
            words::seconds(to)
        ))?;
        match (replayed.recorded, replayed.played) {
            (Some((axis, recorded)), played) => {
                out.text(format!("recorded  {}", text(axis, &recorded)))?;
                let played =
                    played.map_or("no trip of it".to_owned(), |played| text(axis, &played));
                out.text(format!("played    {played}"))?;
            }
            (None, _) => return Err(wrong("no trip was recorded".to_owned())),
        }
        let builds = &self.builds;
        match replayed.diverged_us {
            _ if replayed.is_same() => {
                let after_ms = to.saturating_sub(trip_at) / 1000;
                out.text(format!("the same; the recording ends {after_ms} ms after the trip"))
            }
            Some(at) => {
                let at = words::seconds(at);
                let what = format!("at t={at} this core is in another state than was recorded");
                Err(wrong(format!("{what}; {builds}")))
            }
            None => Err(wrong(format!("this core does not trip as was recorded; {builds}"))),
        }
    }
}

/// Whether two trips of axes are one.
pub fn is_same_trip((axis, trip): (u8, Trip), (other, others): (u8, Trip)) -> bool {
    axis == other && told(trip) == told(others)
}

/// Plays a file and prints what happened `around` its trip, and whether it ended as recorded; then on
/// the image of these sources, if any are named.
pub fn run(
    file: &Path,
    around: Duration,
    sources: Option<&Path>,
    out: Output,
) -> Result<(), Failure> {
    let path = file.display().to_string();
    let wrong = |why: String| Failure::named("NotReplayed", None, format!("{path}: {why}"));
    let bytes = given::begin(file, MAX_FILE + 1)?;
    if bytes.is_empty() {
        return Err(wrong("it is empty: nothing has tripped yet".to_owned()));
    }
    if bytes.len() as u64 > MAX_FILE {
        return Err(wrong("it is longer than the memory of any flight recorder".to_owned()));
    }
    let recording = Recording::read_file(&bytes).map_err(|error| wrong(error.to_string()))?;
    Told::new(&recording).map_err(&wrong)?.print(around, out, wrong)?;
    sources.map_or(Ok(()), |sources| image::run(sources, file, out, wrong))
}

fn not_stored(why: SaveError) -> &'static str {
    match why {
        SaveError::Full => "it is too long",
        SaveError::Failed => "the memory did not take it",
        SaveError::Damaged => "the image is not what was announced",
        SaveError::NotSigned => "the image lacks the signature of the key of the one that runs",
    }
}

fn not_read(why: FlightReadError) -> &'static str {
    match why {
        FlightReadError::NoRecorder => "there is none",
        FlightReadError::Recording => "it records, as an axis is armed",
    }
}
