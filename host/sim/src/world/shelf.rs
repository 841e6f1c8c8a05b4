//! The memory of the flight recorder.

use std::ops::Range;

use flight_recorder::{Recorder, Shelf};
use gateway::Gateway;

/// Bytes of calls in each half: seconds of a busy bus.
const CALLS: usize = 192 * 1024;

/// Two halves. A copy is made in one piece, when it is complete.
pub struct Halves {
    calls: [Vec<u8>; 2],
    copies: [Option<Box<Gateway>>; 2],
}

impl Halves {
    pub fn new() -> Self {
        Self { calls: [vec![0; CALLS], vec![0; CALLS]], copies: [None, None] }
    }
}

impl Shelf for Halves {
    fn calls(&mut self, half: usize) -> &mut [u8] {
        &mut self.calls[half]
    }

    fn read_calls(&self, half: usize) -> &[u8] {
        &self.calls[half]
    }

    fn copy(&mut self, _: usize, _: &Gateway, _: Range<usize>) {}

    fn complete(&mut self, half: usize, core: &Gateway) {
        self.copies[half] = Some(Box::new(core.clone()));
    }

    fn copied(&self, half: usize) -> Option<&Gateway> {
        self.copies[half].as_deref()
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
