//! Holds the processor at the entry of a function, says what that was called with, and lets it go.

use std::time::Duration;

use super::Machine;
use super::plant::{Fault, Place, halves};

/// Registers that a call passes.
pub const ARGUMENTS: usize = 4;
/// So far behind where they are put: whether it is let go.
const LET_GO: u32 = 16;
/// How often it is looked whether the processor has come by.
const LOOK: Duration = Duration::from_micros(1);

/// Where the processor is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Held {
    /// When it came there.
    pub at: Duration,
    /// The first four registers.
    pub arguments: [u32; ARGUMENTS],
}

impl Machine {
    /// Runs until this function is called, at most for `limit`; there the processor stands still,
    /// interrupts as they are, until it is [let go](Self::let_go).
    /// Panics if the image has no such function.
    pub fn hold_at(&mut self, path: &str, limit: Duration) -> Option<Held> {
        let entry = u32::try_from(self.names.get(path).address | 1).expect("32 bits");
        let (put_at, let_go) = (self.board().free_ram, self.board().free_ram + LET_GO);
        // LDR r12 from put_at below; STM r12, {r0-r3}; LDR r12 from let_go below; LDR r12, [r12];
        // CMP r12, #0; BEQ to the second LDR, and what fills the word; LDR pc from the entry below
        // (A7.7.44, A7.7.159, A7.7.43, A7.7.27, A7.7.12).
        let mut code = vec![
            0xF8DF, 0xC018, 0xE88C, 0x000F, 0xF8DF, 0xC014, 0xF8DC, 0xC000, 0xF1BC, 0x0F00, 0xD0F8,
            0xBF00, 0xF8DF, 0xF008,
        ];
        code.extend([put_at, let_go, entry].into_iter().flat_map(halves));
        self.write_memory(let_go.into(), &[0; 4]);
        self.plant(Place::Function(path), &Fault::Code(code));
        let end = self.now() + limit;
        while self.struck().is_none() {
            if self.now() >= end {
                self.heal();
                return None;
            }
            self.run_for(LOOK);
        }
        // It has still to put them down.
        self.run_for(LOOK);
        let at = self.struck()?;
        let bytes = self.read_memory(put_at.into(), ARGUMENTS * size_of::<u32>());
        let mut words = bytes.chunks_exact(4).map(|word| word.try_into().expect("four"));
        let arguments = [(); ARGUMENTS].map(|()| u32::from_le_bytes(words.next().expect("read")));
        Some(Held { at, arguments })
    }

    /// Lets a processor go on that is held.
    pub fn let_go(&mut self) {
        self.heal();
        self.write_memory((self.board().free_ram + LET_GO).into(), &[1; 4]);
    }
}
