//! A board with one chip on it and nothing else, for rigless to run.

use rigless::machine::{Board, Target};
use rigless::mcu::Mcu;
use rigless::snapshot::{Error, Reader, Store, Writer};

use crate::chip::Chip;
use crate::processor::Pace;

/// The only processor of the board.
const MCU: &str = "mcu";

/// The board. While the emulation stands still its chip can be lent.
#[derive(Debug)]
pub struct Socket {
    name: &'static str,
    chip: Option<Box<Chip>>,
    pace: Pace,
    vector_table: u32,
}

impl Socket {
    /// A board of that name around a chip, whose vector table is at `vector_table` at reset.
    #[must_use]
    pub fn new(name: &'static str, chip: Box<Chip>, pace: Pace, vector_table: u32) -> Self {
        Self { name, chip: Some(chip), pace, vector_table }
    }

    /// The chip.
    ///
    /// # Panics
    ///
    /// Here and below: while the chip is lent.
    #[must_use]
    pub fn chip(&self) -> &Chip {
        self.chip.as_ref().expect("the chip is not lent")
    }

    /// The chip.
    pub fn chip_mut(&mut self) -> &mut Chip {
        self.chip.as_mut().expect("the emulation stands still while the chip is lent")
    }

    /// Lends the chip, to another thread for example: to be taken back before the emulation goes
    /// on.
    #[must_use]
    pub fn lend(&mut self) -> Box<Chip> {
        self.chip.take().expect("lent once at a time")
    }

    /// Takes the chip back.
    pub fn take_back(&mut self, chip: Box<Chip>) {
        self.chip = Some(chip);
    }
}

impl Store for Socket {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        self.chip().store(to)
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        self.chip_mut().load(from)
    }
}

impl Board for Socket {
    fn name(&self) -> &'static str {
        self.name
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![MCU]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then(|| -> &mut dyn Mcu { &mut **self.chip_mut() })
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let (pace, vector_table) = (self.pace, self.vector_table);
        let chip = self.chip_mut();
        let core = chip.core(pace, vector_table).spec();
        vec![Target::new(MCU, &mut **chip, core)]
    }
}
