//! Faults planted in the unmodified image while it runs: a few instructions in flash that the image
//! leaves free, and a branch there from a function, or from one task in place of its own code.

use std::time::Duration;

use rigless::emulator::Watch;
use rigless::soc::Width;

use super::Machine;
use super::names::Named;
use crate::nodes::since_start;

/// `NOP`, then `B .`, a loop of one instruction (ARMv7-M, A7.7.88 and A7.7.12): the core comes by
/// the first of them once.
const HANG: [u16; 2] = [0xBF00, 0xE7FE];
/// `UDF #0`: undefined for ever (A7.7.194).
const UNDEFINED: u16 = 0xDE00;
/// What a wrong index calls: the index, the length, the place in the source.
const PANIC: &str = "core::panicking::panic_bounds_check";
/// Index and length of the panic, and its place: they are in its message.
const INDEX: u32 = 7;
const LENGTH: u32 = 3;
const FILE: &str = "planted.rs";
const LINE: u32 = 11;
const COLUMN: u32 = 5;
/// The code that an executor polls a task with; a pointer to it stands in the task's header.
const POLL: &str = "embassy_executor::raw::TaskStorage$LT$F$GT$::poll";
/// Bytes of a word.
const WORD: u64 = 4;

/// What goes wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fault {
    /// It never returns, with interrupts as they are.
    Hang,
    /// It panics: "index out of bounds: the len is 3 but the index is 7", at planted.rs:11:5.
    Panic,
    /// An undefined instruction, which is a hard fault as the firmware enables no other handler.
    HardFault,
    /// These instructions instead.
    Code(Vec<u16>),
}

/// Where it goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place<'a> {
    /// When this function is called next: its path, as in `gateway::gateway::Gateway::handle`.
    Function(&'a str),
    /// When this task is polled next: the path of the task's function, and which of its tasks, in
    /// the order of their spawning.
    Task(&'a str, usize),
}

impl Machine {
    /// Plants a fault in the running image. A reset leaves it there; [`Machine::heal`] takes it
    /// away.
    /// Panics if the image has no such place.
    pub fn plant(&mut self, place: Place<'_>, fault: &Fault) {
        let code = match fault {
            Fault::Hang => HANG.to_vec(),
            Fault::HardFault => vec![UNDEFINED],
            Fault::Panic => self.panicking(),
            Fault::Code(code) => code.clone(),
        };
        let free = self.board().free_flash;
        self.program(free, &code);
        self.core.order(move |session, _, _, recorder| {
            session.unwatch(Watch::Instruction(free));
            session.watch(Watch::Instruction(free));
            recorder.forget_strike();
        });
        match place {
            Place::Function(path) => {
                let at = self.names.get(path).address;
                self.planted = Some((at, [self.halfword(at), self.halfword(at + 2)]));
                self.program(at, &branch(at, free));
            }
            Place::Task(path, index) => {
                let entry = self.entry_of_task(path, index);
                // The lowest bit says that it is Thumb code.
                let pointer = u32::try_from(free | 1).expect("32 bits");
                self.write_memory(entry, &pointer.to_le_bytes());
            }
        }
    }

    /// When the last fault that was planted struck first, since the board was switched on.
    pub fn struck(&mut self) -> Option<Duration> {
        self.core.order(|_, _, _, recorder| recorder.strike()).map(since_start)
    }

    /// Gives the function of the last [`Place::Function`] its own instructions back.
    /// Panics if nothing was planted in a function.
    pub fn heal(&mut self) {
        let (at, instructions) = self.planted.take().expect("something was planted in a function");
        self.program(at, &instructions);
    }

    /// Where the header of a task points to the code it is polled with.
    fn entry_of_task(&mut self, path: &str, index: usize) -> u64 {
        let Named { address, size } = self.names.get(&format!("{path}::POOL"));
        let polls: Vec<u64> = self.names.all(POLL).iter().map(|poll| poll.address).collect();
        let length = usize::try_from(size).expect("memory of the part");
        let words = self.read_memory(address, length);
        let words = words
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        let mut entries = (address..)
            .step_by(4)
            .zip(words)
            .filter(|(_, word)| polls.contains(&u64::from(word & !1)));
        entries
            .nth(index)
            .unwrap_or_else(|| panic!("{path} has no task {index} that was spawned"))
            .0
    }

    /// A call that no code of the image makes: of what a wrong index calls.
    fn panicking(&self) -> Vec<u16> {
        let panic = self.names.get(PANIC).address | 1;
        let location = self.board().free_flash + 7 * WORD;
        let file = location + 4 * WORD;
        // LDR r0, r1, r2 and pc from the words behind it (A7.7.44).
        let mut code = vec![0x4802, 0x4903, 0x4A03, 0xF8DF, 0xF010, 0xBF00];
        let word = |address: u64| u32::try_from(address).expect("32 bits");
        let length = u32::try_from(FILE.len()).expect("short");
        // What the call takes, where it leads, and a `core::panic::Location`; a zero follows the
        // name of its file.
        for word in [INDEX, LENGTH, word(location), word(panic), word(file), length, LINE, COLUMN] {
            code.extend(halves(word));
        }
        let mut name = FILE.as_bytes().to_vec();
        name.resize(FILE.len().next_multiple_of(2) + 2, 0);
        code.extend(name.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])));
        code
    }

    fn halfword(&mut self, address: u64) -> u16 {
        let bytes = self.read_memory(address, 2);
        u16::from_le_bytes([bytes[0], bytes[1]])
    }

    /// Writes instructions into the flash.
    pub(super) fn program(&mut self, address: u64, code: &[u16]) {
        let code = code.to_vec();
        self.core.order(move |_, host, _, _| {
            for (at, halfword) in (address..).step_by(2).zip(code) {
                host.program(at, Width::W16, halfword.into())
                    .unwrap_or_else(|error| panic!("{error}"));
            }
        });
    }
}

/// A word as two halves, in the order of memory.
pub(super) fn halves(word: u32) -> [u16; 2] {
    let [a, b, c, d] = word.to_le_bytes();
    [u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])]
}

/// `B.W`, from and to a Thumb address (A7.7.12, encoding T4).
fn branch(from: u64, to: u64) -> [u16; 2] {
    let offset = u32::try_from(to - (from + 4)).expect("forwards");
    assert!(offset < 1 << 24, "a branch reaches 16 MiB");
    let bit = |place: u32| u16::try_from(offset >> place & 1).expect("a bit");
    let field = |place: u32, bits: u32| {
        u16::try_from(offset >> place & ((1 << bits) - 1)).expect("a field")
    };
    // Forwards the sign is 0, and J1 and J2 are the complements of the offset's bits 23 and 22.
    [0xF000 | field(12, 10), 0x9000 | (1 - bit(23)) << 13 | (1 - bit(22)) << 11 | field(1, 11)]
}
