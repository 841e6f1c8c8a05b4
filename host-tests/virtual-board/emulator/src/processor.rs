//! The processor cores of the chips, for rigless to run.
//!
//! The properties of the Cortex-M7 are those of rigless's own board with an STM32H743, which cites
//! the manuals.

use std::num::{NonZeroU32, NonZeroU64};

use rigless::cpu::armv7m::windows;
use rigless::machine::armv7m::{
    BranchPrediction, Caches, Config, Core, Fpu, ImplementationRegister, MpuRegions, Variant,
};

use rigless::mcu::Operate;

use crate::chip::Chip;

/// SysTick's reference clock is an eighth of the core clock.
const REFERENCE_DIVIDER: NonZeroU32 = NonZeroU32::new(8).expect("not zero");
/// Bits of an interrupt priority.
const PRIORITY_BITS: u8 = 4;
/// A Cortex-M7 r1p1, and a Cortex-M4 r0p1.
const CPUID_M7: u32 = 0x411F_C271;
const CPUID_M4: u32 = 0x410F_C241;
/// 16 KiB each of instruction and data cache.
const CACHES: Caches =
    Caches { clidr: 0x0900_0003, ctr: 0x8303_C003, ccsidr: &[0xF00F_E019, 0xF01F_E009] };
/// The access control registers of the Cortex-M7 (PM0253): offset, reset value, writable bits.
const ACCESS_CONTROL: [(u64, u32, u32); 6] = [
    (0xF90, 0x0000_0038, 0x0000_0007), // ITCMCR: 64 KiB
    (0xF94, 0x0000_0040, 0x0000_0007), // DTCMCR: 128 KiB
    (0xF98, 0x0000_0000, 0x0000_0001), // AHBPCR
    (0xF9C, 0x0000_0000, 0x0000_0007), // CACR
    (0xFA0, 0x0000_0800, 0x0000_FFFF), // AHBSCR
    (0xFA8, 0x0000_0000, 0x0000_0000), // ABFSR
];

/// How a core runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pace {
    /// The core clock that the firmware sets, in hertz: it drives the core's own SysTick and cycle
    /// counter.
    pub clock_hz: NonZeroU64,
    /// How many instructions it executes in a second of virtual time.
    pub instructions_per_second: NonZeroU64,
}

impl Chip {
    /// Its core, with the vector table at `vector_table` at reset: a Cortex-M7 with
    /// double-precision floating point and caches, or a Cortex-M4 with FPv4-SP and eight MPU
    /// regions (PM0214).
    #[must_use]
    pub fn core(&self, pace: Pace, vector_table: u32) -> Config {
        let lines = u32::from(self.cpu().interrupt_lines);
        let core = Core {
            variant: match self {
                Self::H743(_) => Variant::M7,
                Self::G474(_) => Variant::M4,
            },
            clock_hz: pace.clock_hz,
            interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
            priority_bits: PRIORITY_BITS,
            refclk_divider: REFERENCE_DIVIDER,
            instructions_per_second: pace.instructions_per_second,
            boot: "flash",
        };
        let mut config = Config::new(core, &windows(self.bus()));
        match self {
            Self::H743(_) => {
                config.fpu = Fpu::FpV5Dp;
                config.mpu_regions = MpuRegions::Sixteen;
                config.cpuid = CPUID_M7;
                config.caches = Some(CACHES);
                config.branch_prediction = BranchPrediction::Always;
                config.implementation_registers = ACCESS_CONTROL
                    .map(|(offset, reset, writable)| ImplementationRegister {
                        offset,
                        reset,
                        writable,
                    })
                    .to_vec();
            }
            Self::G474(_) => {
                config.fpu = Fpu::FpV4Sp;
                config.mpu_regions = MpuRegions::Eight;
                config.cpuid = CPUID_M4;
            }
        }
        config.vector_table = Some(vector_table);
        config
    }
}
