//! The file that has what led to the latest trip.

use std::fs::OpenOptions;
use std::io;
use std::path::{Path, PathBuf};

use flight_recorder::Recording;
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
}

impl FlightFile {
    /// A file with this path. What it has stays until a trip.
    ///
    /// # Errors
    /// Where it is no regular file, or cannot be written.
    pub fn new(path: &Path) -> io::Result<Self> {
        if path.metadata().is_ok_and(|found| !found.is_file()) {
            return Err(io::Error::other("no regular file"));
        }
        OpenOptions::new().append(true).create(true).open(path)?;
        Ok(Self { path: path.to_owned(), has: None, next: None })
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

        let mut memory = world.flight_recorder().to_vec();
        let length = Recording::trim(&mut memory);
        memory.truncate(length);
        memory.extend(Recording::checksum(&memory));
        let file = self.path.display();
        match std::fs::write(&self.path, &memory) {
            Ok(()) if is_new => {
                let (axis, Trip { reason, .. }) = trip;
                log(&format!("axis {axis} tripped ({reason}): what led to it is in {file}"));
            }
            Ok(()) => {}
            Err(error) => log(&format!("{file} cannot be written: {error}")),
        }
    }
}
