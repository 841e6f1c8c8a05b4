//! Bit timings of a CAN bus, checked when they are compiled.

use core::num::{NonZeroU8, NonZeroU16};

use embassy_stm32::can::config::NominalBitTiming;

/// Earliest and latest sample point that the project allows, per mille of the bit.
const SAMPLE_POINT: core::ops::RangeInclusive<u32> = 800..=875;
/// Limits of the NBTP register: prescaler, seg1, seg2 and SJW.
const MAX_PRESCALER: u16 = 512;
const MAX_SEG1: u8 = 128;
const MAX_SEG2: u8 = 127;

/// How one bitrate is made. One bit is 1 + seg1 + seg2 time quanta, a quantum is `prescaler` kernel
/// clocks.
#[derive(Clone, Copy)]
pub struct Timing {
    /// Bits per second, rounded.
    pub bitrate: u32,
    nominal: NominalBitTiming,
}

impl Timing {
    /// A timing stated by hand. The build fails if it does not make `bitrate` from the kernel
    /// clock, or if the sample point lies outside 80–87.5 %. The bit may be resynchronised by
    /// all of seg2.
    pub const fn checked(kernel_hz: u32, bitrate: u32, prescaler: u16, seg1: u8, seg2: u8) -> Self {
        assert!(prescaler <= MAX_PRESCALER && seg1 <= MAX_SEG1 && seg2 <= MAX_SEG2);
        let quanta = 1 + seg1 as u32 + seg2 as u32;
        let clocks_per_bit = prescaler as u32 * quanta;
        assert!((kernel_hz + clocks_per_bit / 2) / clocks_per_bit == bitrate, "another bitrate");
        let sample_point = (1 + seg1 as u32) * 1000 / quanta;
        assert!(
            *SAMPLE_POINT.start() <= sample_point && sample_point <= *SAMPLE_POINT.end(),
            "sample point"
        );
        let nominal = NominalBitTiming {
            prescaler: NonZeroU16::new(prescaler).unwrap(),
            seg1: NonZeroU8::new(seg1).unwrap(),
            seg2: NonZeroU8::new(seg2).unwrap(),
            sync_jump_width: NonZeroU8::new(seg2).unwrap(),
        };
        Self { bitrate, nominal }
    }

    /// For the driver.
    pub const fn nominal(&self) -> NominalBitTiming {
        self.nominal
    }
}

/// The bitrates of a table, to be shown to the host.
pub const fn bitrates<const N: usize>(timings: &[Timing; N]) -> [u32; N] {
    let mut bitrates = [0; N];
    let mut index = 0;
    while index < N {
        bitrates[index] = timings[index].bitrate;
        index += 1;
    }
    bitrates
}
