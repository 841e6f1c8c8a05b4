//! The flash interface of the STM32G474: erasing pages and programming double words of its second
//! bank.
//!
//! Sources: RM0440, embedded flash memory for category 3 devices (registers in stm32-metapac 21);
//! times of data sheet DS12288, flash memory characteristics, the longest. Options and wait states
//! keep what they hold.
//!
//! | Behaviour | |
//! |---|---|
//! | KEYR | the two keys clear LOCK; anything else locks until the next reset, and is told |
//! | CR while LOCK is set | keeps what it holds |
//! | STRT with PER | erases the page PNB of the bank BKER |
//! | two words into the flash with PG | program a double word that is erased, or zeros |
//! | a store without PG | PGSERR; of another width SIZERR; out of order PGAERR |
//! | a double word that is not erased, but for zeros | PROGERR |
//! | the first bank, or the only one | neither erased nor programmed: WRPERR, and told |
//! | reads of a bank that is busy | [`Flash::is_busy`]: the processor stands still, see there |
//!
//! Not modelled: the error-correcting code, which the array's reads never reach; interrupts; mass
//! erase, fast programming, options, protection.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::snapshot::store;
use rigless::soc::{RegisterSpec, Width};
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use super::tables;
use crate::row::Row;

/// The instance's name.
pub const NAME: &str = "FLASH";

const KEYS: [u64; 2] = [0x4567_0123, 0xCDEF_89AB];
/// CR.
const PG: u64 = 1 << 0;
const PER: u64 = 1 << 1;
const PNB_SHIFT: u32 = 3;
const PNB: u64 = 0x7F;
const BKER: u64 = 1 << 11;
const STRT: u64 = 1 << 16;
const LOCK: u64 = 1 << 31;
/// CR after reset: both locks.
pub const CR_RESET: u64 = LOCK | 1 << 30;
/// SR.
const PROGERR: u64 = 1 << 3;
const WRPERR: u64 = 1 << 4;
const PGAERR: u64 = 1 << 5;
const SIZERR: u64 = 1 << 6;
const PGSERR: u64 = 1 << 7;
const BSY: u64 = 1 << 16;
/// OPTR.
const DBANK: u64 = 1 << 22;

const FIRST: u64 = 0x0800_0000;
const BANK_BYTES: u64 = 256 << 10;
const PAGE_BYTES: u64 = 2 << 10;
const WORD_BYTES: u64 = 8;
/// At most.
const ERASE_NANOS: u64 = 24_470_000;
const PROGRAM_NANOS: u64 = 90_760;

const BAD_KEY: &str = "RM0440: a wrong key locks the flash until the next reset";
const FIRST_BANK: &str = "the first bank, which holds the program, is not modelled as one to write";

/// What is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Operation {
    Erase { page: u64 },
    Program { address: u64, word: u64 },
}

/// The interface.
#[derive(Debug)]
pub struct Flash {
    table: &'static [RegisterSpec],
    control: u64,
    status: u64,
    /// Keys that were right, of two.
    keys: usize,
    /// A wrong key was written.
    is_barred: bool,
    /// The first half of a double word, and where.
    first: Option<(u64, u64)>,
    operation: Option<Operation>,
    /// When it ends.
    end: Option<EventId>,
    /// Pieces that the memory has still to take.
    pieces: u64,
    /// The option DBANK is 0.
    is_single_bank: bool,
}

store!(Flash {
    values: [control, status, keys, is_barred, first, operation, end, pieces, is_single_bank],
    parts: [],
    built: [table]
});

impl Default for Flash {
    fn default() -> Self {
        Self {
            table: tables::named(NAME).registers,
            control: CR_RESET,
            status: 0,
            keys: 0,
            is_barred: false,
            first: None,
            operation: None,
            end: None,
            pieces: 0,
            is_single_bank: false,
        }
    }
}

impl Flash {
    /// Whether the second bank is busy. The processor then stands still as soon as it reads from
    /// there, an instruction or a constant: here at once and until the end, which no image does
    /// worse.
    #[must_use]
    pub const fn is_busy(&self) -> bool {
        self.operation.is_some()
    }

    /// The option DBANK is 0 from now on.
    pub(super) fn set_single_bank(&mut self) {
        self.is_single_bank = true;
    }

    /// The options hold what they hold, whatever is reset.
    pub(super) fn load_options(&self, registers: &mut RegisterFile) {
        if self.is_single_bank {
            let options = self.row("OPTR");
            registers.set(options, registers.get(options) & !DBANK);
        }
    }

    fn has_two_banks(&self, registers: &RegisterFile) -> bool {
        registers.get(self.row("OPTR")) & DBANK != 0
    }

    fn row(&self, register: &str) -> Row {
        tables::row(self.table, register)
    }

    fn show(&self, registers: &mut RegisterFile) {
        registers.set(self.row("CR"), self.control);
        let busy = if self.is_busy() { BSY } else { 0 };
        registers.set(self.row("SR"), self.status | busy);
        registers.set(self.row("KEYR"), 0);
    }

    fn write_key(&mut self, key: u64, context: &mut DeviceContext<'_>) {
        let is_right = self.control & LOCK != 0 && KEYS.get(self.keys) == Some(&key);
        if self.is_barred || !is_right {
            self.is_barred = true;
            self.control |= LOCK;
            context.tell("KEYR", BAD_KEY);
            return;
        }
        self.keys += 1;
        if self.keys == KEYS.len() {
            (self.keys, self.control) = (0, self.control & !LOCK);
        }
    }

    fn write_control(
        &mut self,
        written: u64,
        registers: &RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if self.control & LOCK != 0 {
            return;
        }
        self.control = written & !STRT;
        if written & PG == 0 {
            self.first = None;
        }
        if written & STRT != 0 && written & PER != 0 && !self.is_busy() {
            if written & BKER == 0 || !self.has_two_banks(registers) {
                self.refuse(WRPERR);
                context.tell("CR", FIRST_BANK);
                return;
            }
            let page = FIRST + BANK_BYTES + (written >> PNB_SHIFT & PNB) * PAGE_BYTES;
            self.begin(Operation::Erase { page }, ERASE_NANOS, context);
        }
    }

    fn refuse(&mut self, error: u64) {
        self.status |= error;
        self.first = None;
    }

    fn begin(&mut self, operation: Operation, nanos: u64, context: &mut DeviceContext<'_>) {
        self.operation = Some(operation);
        self.end = Some(context.schedule(VirtualNanos(context.now().0 + nanos)));
    }

    /// The memory takes what has been written.
    fn land(&mut self, context: &mut DeviceContext<'_>) {
        match self.operation {
            Some(Operation::Erase { page }) => {
                self.pieces = PAGE_BYTES / WORD_BYTES;
                for piece in 0..self.pieces {
                    context.program(page + piece * WORD_BYTES, Width::W64, u64::MAX, 0);
                }
            }
            Some(Operation::Program { address, word }) => {
                self.pieces = 1;
                context.program(address, Width::W64, word, 0);
            }
            None => {}
        }
    }
}

impl Device for Flash {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }

    fn write(
        &mut self,
        register: Row,
        written: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if register == self.row("KEYR") {
            self.write_key(written, context);
        } else if register == self.row("CR") {
            self.write_control(written, registers, context);
        } else if register == self.row("SR") {
            self.status &= !written;
        } else {
            return;
        }
        self.show(registers);
    }

    fn write_region(
        &mut self,
        address: u64,
        width: Width,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> bool {
        let has_two_banks = self.has_two_banks(registers);
        match self.first {
            _ if self.control & PG == 0 || self.control & LOCK != 0 || self.status != 0 => {
                self.refuse(PGSERR);
            }
            _ if address < FIRST + BANK_BYTES || !has_two_banks => {
                self.refuse(WRPERR);
                context.tell("CR", FIRST_BANK);
            }
            _ if width != Width::W32 => self.refuse(SIZERR),
            None if address.is_multiple_of(WORD_BYTES) => self.first = Some((address, value)),
            Some((first, low)) if address == first + WORD_BYTES / 2 => {
                self.first = None;
                let word = value << 32 | low;
                self.operation = Some(Operation::Program { address: first, word });
                context.read_from(first, Width::W64, 0);
            }
            _ => self.refuse(PGAERR),
        }
        self.show(registers);
        true
    }

    fn on_access(
        &mut self,
        _: u64,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match self.operation {
            Some(Operation::Program { word, .. }) if self.end.is_none() && self.pieces == 0 => {
                if value != u64::MAX && word != 0 {
                    self.operation = None;
                    self.refuse(PROGERR);
                } else {
                    self.begin(self.operation.expect("it is there"), PROGRAM_NANOS, context);
                }
            }
            _ => {
                self.pieces = self.pieces.saturating_sub(1);
                if self.pieces == 0 {
                    self.operation = None;
                }
            }
        }
        self.show(registers);
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if self.end.take_if(|end| *end == event).is_some() {
            self.land(context);
        }
        self.show(registers);
    }

    fn reset(&mut self) {
        *self = Self { is_single_bank: self.is_single_bank, ..Self::default() };
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        self.reset();
        self.load_options(registers);
    }
}
