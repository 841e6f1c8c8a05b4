//! What a processor waits for its instructions: the cache before its flash, fed with a trace of
//! program counters.
//!
//! rigless executes as many instructions a second as it is told; this says afterwards how many more
//! cycles the same instructions take for being read from flash. Sources: Arm DDI 0489, Cortex-M7
//! TRM, L1 caches (lines of 32 bytes, the instruction cache in two ways); RM0433, 16 KiB of it,
//! FLASH_ACR and the 256-bit words of the flash; RM0440 §3.3.4, FLASH_ACR and the accelerator's
//! instruction cache, 32 lines of four 64-bit words.
//!
//! Not counted: constants, which are read from flash without a cache on the STM32H743; what
//! arbitration adds on the way to the flash; prefetching, two instructions in a cycle, and a fill
//! that the processor does not wait for, which save cycles; instructions that take more than one
//! cycle, branches too. Among the lines of a set the one used longest ago goes; the Cortex-M7 picks
//! one by chance.

use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::Chip;

/// Where the registers lie on the STM32H743 (RM0433 §2.3): the flash's access control, and
/// RCC_D1CFGR.
const H743_FLASH_ACR: u64 = 0x5200_2000;
const H743_RCC_D1CFGR: u64 = 0x5802_4418;
/// FLASH_ACR of the STM32G474 (RM0440 §2.2).
const G474_FLASH_ACR: u64 = 0x4002_2000;
/// The bits of LATENCY in either.
const LATENCY: u64 = 0xF;
/// Transfers of 64 bits that bring a line of the STM32H743.
const BEATS: u64 = 4;

/// How a cache is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Geometry {
    /// Sets, which the lower bits of a line's number choose from.
    pub sets: u64,
    /// Lines in each.
    pub ways: usize,
    /// Bytes of a line.
    pub line: u64,
    /// Bytes that one read of the flash brings: a line, or a part of it.
    pub read: u64,
}

impl Geometry {
    /// The instruction cache of the STM32H743.
    pub const H743: Self = Self { sets: 256, ways: 2, line: 32, read: 32 };
    /// That of the STM32G474's flash accelerator, with two banks.
    pub const G474: Self = Self { sets: 1, ways: 32, line: 32, read: 8 };

    /// That of a chip.
    #[must_use]
    pub const fn of(chip: &Chip) -> Self {
        match chip {
            Chip::H743(_) => Self::H743,
            Chip::G474(_) => Self::G474,
        }
    }
}

/// Cycles of the processor that one read of the flash costs beside the instruction's own, by the
/// wait states and clocks that the firmware has set by then.
///
/// # Panics
///
/// On a chip without these registers: a defect of this crate.
pub fn read_cycles(chip: &mut Chip, at: VirtualNanos) -> u64 {
    let is_h743 = matches!(chip, Chip::H743(_));
    let mut read = |address| chip.read(at, address, Width::W32).expect("a register");
    if !is_h743 {
        return read(G474_FLASH_ACR) & LATENCY;
    }
    let wait_states = read(H743_FLASH_ACR) & LATENCY;
    // The flash runs at the clock behind HPRE, the processor at the one before it: 0xxx is 1, 1000
    // is 2, 1001 is 4, 1010 is 8.
    let divider = match read(H743_RCC_D1CFGR) & 0xF {
        hpre @ 0b1000..=0b1010 => 2 << (hpre & 0b11),
        hpre if hpre < 0b1000 => 1,
        hpre => panic!("HPRE {hpre:#b}: no firmware needs it"),
    };
    (wait_states + BEATS) * divider
}

/// A line that is held.
#[derive(Debug, Clone, Copy)]
struct Line {
    number: u64,
    /// A bit for each part that has been read.
    parts: u64,
}

/// A cache, empty at first.
#[derive(Debug, Clone)]
pub struct Cache {
    geometry: Geometry,
    /// The lines of each set, the one used last at the end.
    sets: Vec<Vec<Line>>,
    reads: u64,
}

impl Cache {
    /// Of that kind.
    #[must_use]
    pub fn new(geometry: Geometry) -> Self {
        let sets = (0..geometry.sets).map(|_| Vec::with_capacity(geometry.ways)).collect();
        Self { geometry, sets, reads: 0 }
    }

    /// Fetches an instruction of two or four bytes.
    pub fn fetch(&mut self, address: u64, bytes: u64) {
        let Geometry { read, .. } = self.geometry;
        for part in address / read..=(address + bytes - 1) / read {
            self.touch(part * read);
        }
    }

    /// How often the flash has been read.
    #[must_use]
    pub fn reads(&self) -> u64 {
        self.reads
    }

    fn touch(&mut self, address: u64) {
        let Geometry { sets, ways, line, read } = self.geometry;
        let number = address / line;
        let part = 1 << (address % line / read);
        let set = &mut self.sets[usize::try_from(number % sets).expect("a set")];
        let held = match set.iter().position(|held| held.number == number) {
            Some(at) => set.remove(at),
            None => {
                if set.len() == ways {
                    set.remove(0);
                }
                Line { number, parts: 0 }
            }
        };
        self.reads += u64::from(held.parts & part == 0);
        set.push(Line { number, parts: held.parts | part });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: u64 = 0x0800_0000;

    fn reads(cache: &mut Cache, addresses: impl IntoIterator<Item = u64>) -> u64 {
        let before = cache.reads();
        addresses.into_iter().for_each(|address| cache.fetch(BASE + address, 2));
        cache.reads() - before
    }

    #[test]
    fn a_line_is_read_once() {
        let mut cache = Cache::new(Geometry::H743);
        assert_eq!(reads(&mut cache, (0..64).step_by(2)), 2);
        assert_eq!(reads(&mut cache, (0..64).step_by(2)), 0);
    }

    #[test]
    fn the_accelerator_reads_64_bits_at_a_time() {
        let mut cache = Cache::new(Geometry::G474);
        assert_eq!(reads(&mut cache, [0, 6]), 1);
        assert_eq!(reads(&mut cache, [8, 24]), 2);
        assert_eq!(reads(&mut cache, (0..32).step_by(2)), 1, "the part in between");
    }

    #[test]
    fn an_instruction_over_the_end_of_a_line_needs_both() {
        let mut cache = Cache::new(Geometry::H743);
        cache.fetch(BASE + 30, 4);
        assert_eq!(cache.reads(), 2);
    }

    /// 16 KiB fit, two lines of one set are 8 KiB apart.
    #[test]
    fn two_lines_of_a_set_stay_and_a_third_displaces_the_one_used_longest_ago() {
        let mut cache = Cache::new(Geometry::H743);
        assert_eq!(reads(&mut cache, (0..16 << 10).step_by(32)), 512);
        assert_eq!(reads(&mut cache, (0..16 << 10).step_by(32)), 0, "all of it");
        assert_eq!(reads(&mut cache, [0, 16 << 10]), 1);
        assert_eq!(reads(&mut cache, [0, 16 << 10]), 0, "both stay");
        assert_eq!(reads(&mut cache, [8 << 10]), 1, "this one went");
        assert_eq!(reads(&mut cache, [0]), 1);
    }

    /// 1 KiB fits, whatever its addresses; one more line displaces the one used longest ago.
    #[test]
    fn the_accelerator_holds_any_32_lines() {
        let mut cache = Cache::new(Geometry::G474);
        let lines = || (0..32).map(|line| line * 4096);
        assert_eq!(reads(&mut cache, lines()), 32);
        assert_eq!(reads(&mut cache, lines()), 0);
        assert_eq!(reads(&mut cache, [32 * 4096]), 1);
        assert_eq!(reads(&mut cache, [4096]), 0);
        assert_eq!(reads(&mut cache, [0]), 1);
    }

    /// Out of reset: 7 wait states at the processor's own clock (RM0433, FLASH_ACR); and none on
    /// the STM32G474.
    #[test]
    fn a_read_costs_what_the_registers_say() {
        let mut chip = Chip::new_h743().unwrap();
        assert_eq!(read_cycles(&mut chip, VirtualNanos(0)), 7 + BEATS);
        chip.write(VirtualNanos(0), H743_FLASH_ACR, Width::W32, 0x22).unwrap();
        chip.write(VirtualNanos(0), H743_RCC_D1CFGR, Width::W32, 0b1000).unwrap();
        assert_eq!(read_cycles(&mut chip, VirtualNanos(0)), (2 + BEATS) * 2);
        let mut chip = Chip::new_g474().unwrap();
        assert_eq!(read_cycles(&mut chip, VirtualNanos(0)), 0);
        chip.write(VirtualNanos(0), G474_FLASH_ACR, Width::W32, 0x604).unwrap();
        assert_eq!(read_cycles(&mut chip, VirtualNanos(0)), 4);
    }
}
