//! The memory of the flight recorder.

use flight_recorder::{Recorder, Shelf};

/// Two halves.
pub struct Halves([Vec<u8>; 2]);

impl Halves {
    /// With so many bytes each.
    pub fn new(half: usize) -> Self {
        Self([vec![0; half], vec![0; half]])
    }
}

impl Shelf for Halves {
    fn half(&self, half: usize) -> &[u8] {
        &self.0[half]
    }

    fn half_mut(&mut self, half: usize) -> &mut [u8] {
        &mut self.0[half]
    }
}

/// All that a recorder has kept, as [`Recording::read`](flight_recorder::Recording::read) takes it.
pub fn record(recorder: &Recorder<Halves>) -> Vec<u8> {
    let part = |part| {
        let mut bytes = vec![0; recorder.read(part, 0, &mut [])];
        recorder.read(part, 0, &mut bytes);
        bytes
    };
    (0..recorder.parts()).flat_map(part).collect()
}
