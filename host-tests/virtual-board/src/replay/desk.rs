//! A processor of its own that runs `board-resume` beside an image which stands still: it lays a
//! snapshot of the core out as that image has it in memory, and takes one of the core that lies
//! there.

use std::time::Duration;

use gateway::MAX_SNAPSHOT;

use super::{Images, ReplayError};
use crate::machine::{Builder, Machine};

/// What both sides put down: `Desk` of host-tests/board-resume/src/desk.rs.
const DESK: &str = "DESK";
const GIVEN_LENGTH: u64 = 4;
const LIVE: u64 = 8;
const TAKEN_LENGTH: u64 = 12;
const CORE_LENGTH: u64 = 16;
const BUILD: u64 = 20;
const GIVEN: u64 = 28;
const TAKEN: u64 = GIVEN + MAX_SNAPSHOT as u64;
const LAID_OUT: u64 = (TAKEN + MAX_SNAPSHOT as u64).next_multiple_of(8);
/// Its words for what it is to do, and what came of it.
const ASKED: u32 = 1;
const DONE: u32 = 2;
const UNREADABLE: u32 = 3;
/// It needs a tenth of that.
const LIMIT: Duration = Duration::from_secs(1);
const LOOK: Duration = Duration::from_millis(1);

/// What it has made of what it was given.
pub struct Done {
    /// A snapshot of the core that lies in the memory.
    pub taken: Vec<u8>,
    /// The build that the image of that core says it is.
    pub build: String,
    /// What was given, as it would lie there; empty where nothing was.
    pub laid_out: Vec<u8>,
}

/// The static memory of an image that stands still, and where in it the core lies.
pub struct Memory {
    /// Its first address.
    pub at: u64,
    /// What it holds.
    pub bytes: Vec<u8>,
    /// Where the core lies.
    pub core: u64,
}

/// The processor, and the program on it.
pub struct Desk(Machine);

impl Desk {
    /// Starts it.
    pub fn start(images: &Images) -> Result<Self, ReplayError> {
        let Images { board, firmware, resume } = images;
        let builder = Builder::of(*board, resume)?.beside(firmware)?;
        Ok(Self(builder.starting_at(board.resume).power_on()))
    }

    /// Has the core taken that lies there, and `given` laid out, if it is not empty.
    pub fn work(&mut self, memory: &Memory, given: &[u8]) -> Result<Done, ReplayError> {
        let machine = &mut self.0;
        let desk = machine.symbol(DESK);
        let word = |number: u64| u32::try_from(number).expect("32 bits").to_le_bytes();
        machine.write_memory(memory.at, &memory.bytes);
        machine.write_memory(desk + GIVEN_LENGTH, &word(given.len() as u64));
        machine.write_memory(desk + LIVE, &word(memory.core));
        machine.write_memory(desk + GIVEN, given);
        machine.write_memory(desk, &ASKED.to_le_bytes());
        let mut status = ASKED;
        machine.run_until(LIMIT, |machine| {
            machine.run_for(LOOK);
            status = machine.read_word(desk);
            status != ASKED
        });
        match status {
            DONE => {}
            UNREADABLE => return Err(ReplayError::OtherBuild),
            _ => return Err(ReplayError::NoCore),
        }
        let mut number = |at: u64| machine.read_word(desk + at);
        let (taken, core) = (number(TAKEN_LENGTH) as usize, number(CORE_LENGTH) as usize);
        let (build_at, build_length) = (number(BUILD), number(BUILD + 4) as usize);
        if taken == 0 {
            return Err(ReplayError::NoCore);
        }
        let laid_out = if given.is_empty() { 0 } else { core };
        let build = machine.read_memory(build_at.into(), build_length);
        Ok(Done {
            taken: machine.read_memory(desk + TAKEN, taken),
            build: String::from_utf8_lossy(&build).into_owned(),
            laid_out: machine.read_memory(desk + LAID_OUT, laid_out),
        })
    }
}
