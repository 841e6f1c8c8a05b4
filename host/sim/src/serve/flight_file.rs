//! The file that has what led to the latest trip.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use flight_recorder::{Recording, Unreadable};
use gateway::Instant;
use host_protocol::Trip;

use crate::world::World;

/// So often the file is written while calls are still added, for its stop, µs.
const REWRITE_US: u64 = 250_000;

/// A file that is written when the recorder has kept a trip, and again until it has kept its stop.
pub struct FlightFile {
    path: PathBuf,
    /// The trip that it has.
    has: Option<(u8, Trip)>,
    /// When it is to be written again.
    next: Option<Instant>,
    /// It could not be written the last time.
    failed: bool,
}

impl FlightFile {
    /// A file with this path: none yet, or a recording, which stays until a trip.
    ///
    /// # Errors
    /// Where it is another file, or none can be written there.
    pub fn new(path: &Path) -> io::Result<Self> {
        match std::fs::metadata(path) {
            Ok(found) if !found.is_file() => return Err(io::Error::other("no regular file")),
            Ok(_) => {
                let before = std::fs::read(path)?;
                if !before.is_empty() && Recording::read_file(&before) == Err(Unreadable::Nothing) {
                    let why = "it is there and no recording; choose another name";
                    return Err(io::Error::other(why));
                }
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        // A link is kept, and what it leads to is replaced.
        let path = path.canonicalize().unwrap_or(path.to_owned());
        let file = Self { path, has: None, next: None, failed: false };
        std::fs::write(file.beside(), [])?;
        std::fs::remove_file(file.beside())?;
        Ok(file)
    }

    /// Where a new one is written, before it takes the place of the old one.
    fn beside(&self) -> PathBuf {
        let mut name = OsString::from(&self.path);
        name.push(".new");
        PathBuf::from(name)
    }

    /// Puts a whole recording in the place of the one before: whatever happens meanwhile, one of
    /// both is there.
    fn replace(&self, record: &[u8]) -> io::Result<()> {
        let beside = self.beside();
        let replaced =
            std::fs::write(&beside, record).and_then(|()| std::fs::rename(&beside, &self.path));
        if replaced.is_err() {
            let _ = std::fs::remove_file(&beside);
        }
        replaced
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

        let mut record = world.flight_record();
        record.extend(Recording::checksum(&record));
        let (file, (axis, Trip { reason, .. })) = (self.path.display(), trip);
        let tripped = format!("axis {axis} tripped ({reason})");
        let written = self.replace(&record);
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
