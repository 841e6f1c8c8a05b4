//! The clock on the HSE input: lost while the firmware runs, and there again.

use std::time::Duration;

use super::{Fault, Machine, Place};
use crate::nodes::instant;

/// Waits until a word is not 0, and pends the NMI: `LDR r0`, `LDR r1, [r0]`, `CMP r1, #0`, `BEQ`
/// back; `LDR r0`, `LDR r1`, `STR r1, [r0]`, `B .`; behind it the word's address, and 0xE000_ED04
/// and 0x8000_0000: ICSR.NMIPENDSET (ARMv7-M, B3.2.4).
const WAIT_AND_PEND: [u16; 8] = [0x4803, 0x6801, 0x2900, 0xD0FC, 0x4802, 0x4903, 0x6001, 0xE7FE];
const ICSR_NMIPENDSET: [u16; 4] = [0xED04, 0xE000, 0x0000, 0x8000];
/// Where that word lies, from the code on.
const WORD_AT: u64 = 0x1C;
/// A task that has the processor soon, and how soon.
const SOON: Place<'static> = Place::Task("motor_gateway::tasks::supervisor::supervisor", 0);
const AT_MOST: Duration = Duration::from_millis(50);

impl Machine {
    /// Stops the clock on the HSE input, and runs until the firmware has restarted the part. The
    /// clock security system raises the NMI, for which the emulator's core has no input: a task
    /// that waits for it pends it at that instant.
    /// Panics if the firmware has not switched the clock security system on (the core would stand
    /// still, which is not modelled), or does not restart the part.
    pub fn lose_hse(&mut self) {
        let resets = self.reports().resets.len();
        let word = self.board().free_flash + WORD_AT;
        let address = u32::try_from(word).expect("32 bits").to_le_bytes();
        let address = [[address[0], address[1]], [address[2], address[3]]].map(u16::from_le_bytes);
        let code = [WAIT_AND_PEND.as_slice(), &address, &ICSR_NMIPENDSET, &[0, 0]].concat();
        self.plant(SOON, &Fault::Code(code));
        assert!(
            self.run_until(AT_MOST, |machine| machine.struck().is_some()),
            "the task is never polled"
        );
        let at = instant(self.now());
        assert!(self.part_mut().lose_hse(at), "the clock security system is off");
        self.program(word, &[1]);
        let restarted = |machine: &mut Self| machine.reports().resets.len() > resets;
        assert!(self.run_until(AT_MOST, restarted), "the part was not restarted");
    }

    /// Puts the clock on the HSE input again: the firmware finds it at its next start.
    pub fn restore_hse(&mut self) {
        let (at, hz) = (instant(self.now()), self.board().hse_hz);
        self.part_mut().attach_hse(at, hz);
    }
}
