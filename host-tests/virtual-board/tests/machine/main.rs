//! The image on the machine: it boots, runs are equal, snapshots and resets do what they say.

mod pins;
mod plant;
mod retained;

use std::time::Duration;

use rigless::device::ResetCause;
use rigless::emulator::{HitKind, Watch};
use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use virtual_board::machine::{Machine, Reports};

/// Long enough for the start-up: it takes 3 ms.
const STARTED: Duration = Duration::from_millis(20);

/// What the emulator says of a start-up, each with its reason.
const EXPECTED_TOLD: [(&str, &str, &str); 2] = [
    // embassy-stm32 writes RTCSEL whatever stands there.
    ("RCC", "BDCR", "RTCSEL"),
    // embassy-stm32 sets the dividers of PLL2 and PLL3 in the register in which PLL1's stands already.
    ("RCC", "PLLCKSELR", "PLL"),
];

fn started() -> Machine {
    let mut machine = Machine::builder().power_on();
    machine.run_for(STARTED);
    machine
}

fn assert_no_gaps(reports: &Reports) {
    assert!(reports.unimplemented.is_empty(), "{:?}", reports.unimplemented);
    assert!(reports.unmapped.is_empty(), "{:?}", reports.unmapped);
    assert!(reports.refused.is_empty(), "{:?}", reports.refused);
    assert!(reports.undefined.is_empty(), "{:?}", reports.undefined);
    assert!(reports.unrouted.is_empty(), "{:?}", reports.unrouted);
    for told in &reports.told {
        let expected = EXPECTED_TOLD.iter().any(|(instance, register, word)| {
            told.instance == *instance && told.register == *register && told.reason.contains(word)
        });
        assert!(expected, "{told:?}");
    }
}

#[test]
fn the_image_boots_without_a_gap() {
    let mut machine = started();
    let reports = machine.reports();
    assert_no_gaps(&reports);
    assert_eq!(reports.resets, []);
    assert!(!machine.take_rtt().is_empty(), "it logs");
    // Idle it sleeps: the blinking light and the polls take less than a thousandth of the core.
    let before = machine.instructions();
    machine.run_for(Duration::from_secs(1));
    let executed = machine.instructions() - before;
    assert!((1..10_000_000).contains(&executed), "{executed} instructions");
}

#[test]
fn two_runs_are_equal_however_they_are_cut_into_pieces() {
    let mut whole = Machine::builder().power_on();
    whole.run_for(Duration::from_millis(30));
    let mut pieces = Machine::builder().power_on();
    while pieces.now() < Duration::from_millis(29) {
        pieces.run_for(Duration::from_nanos(37_123));
    }
    assert!(!pieces.run_until(Duration::from_millis(30) - pieces.now(), |_| false));
    pieces.run_to(VirtualNanos(30_000_000));
    assert_eq!(pieces.instructions(), whole.instructions());
    assert_eq!(pieces.access_digest(), whole.access_digest());
    assert_eq!(pieces.take_rtt(), whole.take_rtt());
}

#[test]
fn a_machine_goes_on_from_a_snapshot_as_the_one_it_was_taken_of() {
    let mut original = started();
    let snapshot = original.snapshot();
    original.run_for(Duration::from_secs(1));
    for _ in 0..2 {
        let mut copy = Machine::builder().resume(&snapshot);
        assert_eq!(copy.now(), STARTED);
        copy.run_for(Duration::from_secs(1));
        assert_eq!(copy.instructions(), original.instructions());
        assert_eq!(copy.access_digest(), original.access_digest());
    }
}

#[test]
fn the_core_is_as_fast_as_it_is_told() {
    let mut slow = Machine::builder().instructions_per_second(100_000_000).power_on();
    // It is busy from the first instruction on.
    slow.run_for(Duration::from_micros(100));
    assert_eq!(slow.instructions(), 10_000);
    let mut fast = Machine::builder().power_on();
    fast.run_for(Duration::from_micros(100));
    assert_eq!(fast.instructions(), 25_000);
}

#[test]
fn the_reset_pin_starts_it_again() {
    let mut machine = started();
    let first_log = machine.take_rtt();
    machine.reset_by_pin();
    machine.run_for(STARTED);
    let reports = machine.reports();
    assert_no_gaps(&reports);
    assert_eq!(reports.resets.len(), 1);
    assert_eq!(reports.resets[0].cause, ResetCause::Pin);
    let second_log = machine.take_rtt();
    assert!(!second_log.is_empty());
    assert_ne!(second_log, first_log, "it was started by the pin this time");
}

#[test]
fn the_watchdog_resets_the_part_when_nobody_feeds_it() {
    const IWDG_KR: u64 = 0x5800_4800;
    let mut machine = started();
    let now = VirtualNanos(u64::try_from(machine.now().as_nanos()).unwrap());
    machine.part_mut().write(now, IWDG_KR, Width::W32, 0xCCCC).unwrap();
    // 4096 counts of 4 cycles of the 32 kHz LSI, once that runs.
    machine.run_for(Duration::from_millis(510));
    assert_eq!(machine.reports().resets, []);
    machine.run_for(Duration::from_millis(10));
    let resets = machine.reports().resets;
    assert_eq!(resets.len(), 1);
    assert_eq!(resets[0].cause, ResetCause::Model("IWDG"));
    assert!(!machine.part().iwdg.is_started());
    machine.run_for(Duration::from_secs(1));
    assert_eq!(machine.reports().resets.len(), 1, "a reset stops it");
}

#[test]
fn memory_is_read_and_written_by_symbol() {
    let mut machine = started();
    let block = machine.symbol("_SEGGER_RTT");
    assert_eq!(machine.read_memory(block, 10), b"SEGGER RTT");
    assert_eq!(machine.read_word(block + 16), 1, "one channel up");
    machine.write_memory(block, b"nothing");
    assert_eq!(machine.read_memory(block, 10), b"nothingRTT");
}

#[test]
fn a_watch_sees_each_write() {
    let mut machine = started();
    let read_offset = machine.symbol("_SEGGER_RTT") + 36;
    machine.watch(Watch::Writes { address: read_offset, length: 4 });
    machine.reset_by_pin();
    machine.run_for(STARTED);
    let hits = machine.take_hits();
    assert!(hits.iter().any(|hit| hit.kind == HitKind::Write), "{hits:?}");
    machine.unwatch(Watch::Writes { address: read_offset, length: 4 });
    machine.run_for(Duration::from_secs(2));
    assert_eq!(machine.take_hits(), []);
}

#[test]
fn without_image_it_says_how_to_build_one() {
    let missing = virtual_board::machine::Builder::new("/nowhere/motor-gateway".as_ref()).unwrap_err();
    let message = missing.to_string();
    assert!(message.contains("/nowhere/motor-gateway") && message.contains("cargo fw"), "{message}");
}
