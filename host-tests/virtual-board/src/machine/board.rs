//! A NUCLEO-H743ZI as the emulator takes it: the part, its clock input and supply, and its core.
//!
//! The properties of the core are those of the emulator's own board with this part, which cites the manuals.

use std::num::{NonZeroU32, NonZeroU64};

use rigless::cpu::armv7m::windows;
use rigless::machine::armv7m::{
    BranchPrediction, Caches, Config, Core, Fpu, ImplementationRegister, MpuRegions, Variant,
};
use rigless::machine::{Board, Target};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::{Error, Reader, Store, Writer};

use crate::chip::{self, Chip};

/// The only processor of the board.
const MCU: &str = "mcu";
/// What the ST-LINK feeds into the HSE input.
const HSE_HZ: u64 = 8_000_000;
/// No crystal on the low-speed pins is used.
const LSE_HZ: u64 = 0;
/// VDD and VDDA.
const SUPPLY_MILLIVOLTS: u32 = 3300;
/// The core clock that the firmware sets: it drives the core's own SysTick and cycle counter.
const CORE_HZ: NonZeroU64 = NonZeroU64::new(400_000_000).expect("not zero");
/// SysTick's reference clock is an eighth of the core clock.
const REFERENCE_DIVIDER: NonZeroU32 = NonZeroU32::new(8).expect("not zero");
/// Bits of an interrupt priority.
const PRIORITY_BITS: u8 = 4;
/// A Cortex-M7 r1p1.
const CPUID: u32 = 0x411F_C271;
/// 16 KiB each of instruction and data cache.
const CACHES: Caches = Caches { clidr: 0x0900_0003, ctr: 0x8303_C003, ccsidr: &[0xF00F_E019, 0xF01F_E009] };
/// The vector table at reset: BOOT_ADD0 as delivered.
pub const FLASH: u32 = 0x0800_0000;
/// The access control registers of the Cortex-M7 (PM0253): offset, reset value, writable bits.
const ACCESS_CONTROL: [(u64, u32, u32); 6] = [
    (0xF90, 0x0000_0038, 0x0000_0007), // ITCMCR: 64 KiB
    (0xF94, 0x0000_0040, 0x0000_0007), // DTCMCR: 128 KiB
    (0xF98, 0x0000_0000, 0x0000_0001), // AHBPCR
    (0xF9C, 0x0000_0000, 0x0000_0007), // CACR
    (0xFA0, 0x0000_0800, 0x0000_FFFF), // AHBSCR
    (0xFA8, 0x0000_0000, 0x0000_0000), // ABFSR
];

/// The board. Between runs its part is lent to the test.
#[derive(Debug)]
pub struct Nucleo {
    part: Option<Box<Chip>>,
    instructions_per_second: NonZeroU64,
    /// The vector table at reset.
    vector_table: u32,
}

impl Nucleo {
    /// Around a part out of reset.
    pub fn new(mut chip: Box<Chip>, instructions_per_second: NonZeroU64, vector_table: u32) -> Self {
        if let Chip::H743(part) = chip.as_mut() {
            part.stm32.rcc.attach_crystals(HSE_HZ, LSE_HZ);
            part.stm32.set_supply(SUPPLY_MILLIVOLTS);
            part.stm32.set_analog_supply(SUPPLY_MILLIVOLTS);
        }
        Self { part: Some(chip), instructions_per_second, vector_table }
    }

    /// Lends the part.
    pub fn lend(&mut self) -> Box<Chip> {
        self.part.take().expect("lent once at a time")
    }

    /// Takes the part back.
    pub fn take_back(&mut self, part: Box<Chip>) {
        self.part = Some(part);
    }

    /// The part, while it runs.
    pub fn part(&self) -> &Chip {
        self.part.as_ref().expect("the part is not lent")
    }

    fn part_mut(&mut self) -> &mut Chip {
        self.part.as_mut().expect("the emulation stands still while the part is lent")
    }
}

impl Store for Nucleo {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        self.part().store(to)
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        self.part_mut().load(from)
    }
}

impl Board for Nucleo {
    fn name(&self) -> &'static str {
        self.part().board().name()
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![MCU]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then(|| -> &mut dyn Mcu { self.part_mut() })
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let (rate, vector_table) = (self.instructions_per_second, self.vector_table);
        let part = self.part_mut();
        let core = match part {
            Chip::H743(_) => config(part, rate, vector_table),
            Chip::G474(_) => chip::g474_core(part, rate, vector_table),
        };
        let core = core.spec();
        vec![Target::new(MCU, part, core)]
    }
}

fn config(part: &Chip, instructions_per_second: NonZeroU64, vector_table: u32) -> Config {
    let lines = u32::from(part.cpu().interrupt_lines);
    let core = Core {
        variant: Variant::M7,
        clock_hz: CORE_HZ,
        interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
        priority_bits: PRIORITY_BITS,
        refclk_divider: REFERENCE_DIVIDER,
        instructions_per_second,
        boot: "flash",
    };
    let mut config = Config::new(core, &windows(part.bus()));
    config.fpu = Fpu::FpV5Dp;
    config.mpu_regions = MpuRegions::Sixteen;
    config.cpuid = CPUID;
    config.caches = Some(CACHES);
    config.branch_prediction = BranchPrediction::Always;
    config.implementation_registers = ACCESS_CONTROL
        .map(|(offset, reset, writable)| ImplementationRegister { offset, reset, writable })
        .to_vec();
    config.vector_table = Some(vector_table);
    config
}
