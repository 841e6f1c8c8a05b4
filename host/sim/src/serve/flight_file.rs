//! The file that has what led to the latest trip.

use std::io;
use std::path::Path;

use flight_recorder::Recording;
use gateway::Instant;
use host_protocol::Trip;

use crate::recording_file::RecordingFile;
use crate::world::World;

/// So often the file is written while calls are still added, for its stop, µs.
const REWRITE_US: u64 = 250_000;

/// A file that is written when the recorder has kept a trip, and again until it has kept its stop.
pub struct FlightFile {
    file: RecordingFile,
    /// The trip that it has.
    has: Option<(u8, Trip)>,
    /// When it is to be written again.
    next: Option<Instant>,
    /// It could not be written the last time.
    failed: bool,
}

impl FlightFile {
    /// A file with this path, see [`RecordingFile::new`].
    ///
    /// # Errors
    /// As there.
    pub fn new(path: &Path) -> io::Result<Self> {
        Ok(Self { file: RecordingFile::new(path)?, has: None, next: None, failed: false })
    }

    /// Writes the file if there is something new for it.
    pub(super) fn look_at(&mut self, world: &World, log: &mut impl FnMut(&str)) {
        let Some(trip) = world.recorded_trip() else {
            (self.has, self.next) = (None, None);
            return;
        };
        let is_new = self.has != Some(trip);
        if !is_new && self.next.is_none_or(|next| world.now() < next) {
            return;
        }
        let now_us = world.now().as_micros();
        let goes_on = world.is_recording();
        self.has = Some(trip);
        self.next = goes_on.then_some(Instant::from_micros(now_us + REWRITE_US));

        let mut memory = world.flight_record();
        memory.extend(Recording::checksum(&memory));
        let (file, (axis, Trip { reason, .. })) = (self.file.path().display(), trip);
        let tripped = format!("axis {axis} tripped ({reason})");
        let written = self.file.replace(&memory);
        // Told once for each trip, and where it changes.
        let is_news = is_new || self.failed != written.is_err();
        self.failed = written.is_err();
        let text = match written {
            Ok(()) => format!("{tripped}: what led to it is in {file}"),
            Err(error) => {
                // It may go the next time, whether more is recorded or not.
                self.next = Some(Instant::from_micros(now_us + REWRITE_US));
                format!("{tripped}: what led to it cannot be written to {file}: {error}")
            }
        };
        if is_news {
            log(&text);
        }
    }
}
