use rigless::device::{Device, ResetCause};
use rigless::mcu::{Operate, Single};
use rigless::soc::stm32h743::builder;
use rigless::soc::stm32h743::generated::IWDG;
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::soc::{Layout, Width};
use rigless::time::VirtualNanos;

use super::Iwdg;

/// The LSI: 31.25 µs a cycle.
const LSI_HZ: u64 = 32_000;
const MILLISECOND: u64 = 1_000_000;

struct Bench {
    single: Single<Iwdg>,
    now: u64,
}

impl Bench {
    fn new() -> Self {
        Self { single: Single::new(builder(), IWDG.name, Iwdg::default()).unwrap(), now: 0 }
    }

    fn clock(&mut self, hz: u64) {
        self.single.drive(VirtualNanos(self.now), |iwdg, registers, context| {
            iwdg.on_clock(hz, registers, context);
        });
    }

    fn address(register: Register) -> u64 {
        IWDG.base + u64::from(register.spec().offset)
    }

    fn write(&mut self, register: Register, value: u64) {
        self.single
            .write(VirtualNanos(self.now), Self::address(register), Width::W32, value)
            .unwrap();
    }

    fn read(&mut self, register: Register) -> u64 {
        self.single.read(VirtualNanos(self.now), Self::address(register), Width::W32).unwrap()
    }

    /// Lets time pass; says when it asked for a reset, and stands there.
    fn run_for(&mut self, nanos: u64) -> Option<u64> {
        let end = self.now + nanos;
        while let Some(VirtualNanos(at)) = self.single.next_event().filter(|at| at.0 <= end) {
            self.now = at;
            self.single.advance_to(VirtualNanos(at));
            if self.single.take_reset_request() == Some(ResetCause::Model("IWDG")) {
                return Some(at);
            }
        }
        self.now = end;
        None
    }

    /// Started with this PR and RLR, as the driver does it, and fed once they have arrived.
    fn started(prescaler: u64, reload: u64) -> Self {
        let mut bench = Self::new();
        bench.write(Register::Kr, 0x5555);
        bench.write(Register::Pr, prescaler);
        bench.write(Register::Rlr, reload);
        bench.write(Register::Kr, 0xCCCC);
        bench.clock(LSI_HZ);
        assert_eq!(bench.run_for(MILLISECOND), None);
        assert_eq!(bench.read(Register::Sr), 0);
        bench.write(Register::Kr, 0xAAAA);
        bench
    }
}

#[test]
fn every_register_resets_to_its_value() {
    let mut bench = Bench::new();
    for (register, value) in [
        (Register::Kr, 0),
        (Register::Pr, 0),
        (Register::Rlr, 0xFFF),
        (Register::Sr, 0),
        (Register::Winr, 0xFFF),
    ] {
        assert_eq!(bench.read(register), value, "{register:?}");
    }
}

#[test]
fn unfed_it_resets_the_part_after_reload_plus_one_counts() {
    // 16 cycles of 31.25 µs a count, 100 counts: 50 ms.
    let mut bench = Bench::started(2, 99);
    assert_eq!(bench.run_for(100 * MILLISECOND), Some(51 * MILLISECOND));
}

#[test]
fn fed_it_does_not() {
    let mut bench = Bench::started(2, 99);
    for _ in 0..10 {
        assert_eq!(bench.run_for(49 * MILLISECOND), None);
        bench.write(Register::Kr, 0xAAAA);
    }
    assert_eq!(bench.run_for(100 * MILLISECOND), Some(541 * MILLISECOND));
}

#[test]
fn the_first_round_counts_from_the_reset_value() {
    let mut bench = Bench::new();
    bench.write(Register::Kr, 0xCCCC);
    bench.clock(LSI_HZ);
    // 4 cycles of 31.25 µs, 4096 counts.
    assert_eq!(bench.run_for(1_000 * MILLISECOND), Some(512 * MILLISECOND));
}

#[test]
fn settings_arrive_five_cycles_later_and_need_the_key() {
    let mut bench = Bench::new();
    bench.clock(LSI_HZ);
    bench.write(Register::Pr, 3);
    assert_eq!(bench.read(Register::Sr), 0);
    bench.write(Register::Kr, 0x5555);
    bench.write(Register::Pr, 3);
    bench.write(Register::Rlr, 0x123);
    assert_eq!((bench.read(Register::Sr), bench.read(Register::Pr)), (0b011, 0));
    assert_eq!(bench.run_for(156_249), None);
    assert_eq!(bench.read(Register::Sr), 0b011);
    assert_eq!(bench.run_for(1), None);
    assert_eq!((bench.read(Register::Sr), bench.read(Register::Pr)), (0, 3));
    assert_eq!(bench.read(Register::Rlr), 0x123);
    bench.write(Register::Kr, 0xAAAA);
    bench.write(Register::Pr, 6);
    assert_eq!(bench.read(Register::Sr), 0, "any other key closes them");
}

#[test]
fn fed_above_its_window_it_resets_the_part() {
    let mut bench = Bench::started(2, 99);
    bench.write(Register::Kr, 0x5555);
    bench.write(Register::Winr, 49);
    assert_eq!(bench.run_for(MILLISECOND), None, "the window arrives and loads the counter");
    assert_eq!(bench.run_for(26 * MILLISECOND), None);
    bench.write(Register::Kr, 0xAAAA);
    assert_eq!(bench.single.take_reset_request(), None, "it stands below 50");
    assert_eq!(bench.run_for(20 * MILLISECOND), None);
    bench.write(Register::Kr, 0xAAAA);
    assert_eq!(
        bench.single.take_reset_request(),
        Some(ResetCause::Model("IWDG")),
        "it stands at 59"
    );
}

#[test]
fn it_cannot_be_stopped_but_by_a_reset() {
    let mut bench = Bench::started(2, 99);
    bench.write(Register::Kr, 0x0000);
    assert!(bench.single.model.is_started());
    Device::reset(&mut bench.single.model);
    assert!(!bench.single.model.is_started());
}
