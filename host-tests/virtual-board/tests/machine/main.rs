//! The image on the machine: it boots, runs are equal, snapshots and resets do what they say.

mod pins;
mod plant;
mod retained;

use std::time::Duration;

use rigless::device::ResetCause;
use rigless::emulator::{HitKind, Watch};
use rigless::time::VirtualNanos;
use virtual_board::board::Board;
use virtual_board::machine::{Fault, Machine, Place, Reports};
use virtual_board::nodes::since_start;
use virtual_stm32::Chip;

/// Long enough for the start-up: it takes 3 ms.
const STARTED: Duration = Duration::from_millis(20);

/// What the emulator says of a start-up, each with its reason.
const EXPECTED_TOLD: [(&str, &str, &str); 2] = [
    // embassy-stm32 writes RTCSEL whatever stands there.
    ("RCC", "BDCR", "RTCSEL"),
    // embassy-stm32 sets the dividers of PLL2 and PLL3 in the register in which PLL1's stands
    // already.
    ("RCC", "PLLCKSELR", "PLL"),
];

/// What answers from its registers alone, each with its reason.
const EXPECTED_UNIMPLEMENTED: [&str; 1] = [
    // Trims the oscillator of the USB: its frequency is exact here.
    "CRS",
];

fn started() -> Machine {
    let mut machine = Machine::builder().power_on();
    machine.run_for(STARTED);
    machine
}

fn assert_no_gaps(reports: &Reports) {
    for gap in reports.unimplemented.values() {
        assert!(EXPECTED_UNIMPLEMENTED.contains(&gap.instance), "{gap:?}");
    }
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

/// Done in a branch, a run is the same as done by the board itself afterwards.
#[test]
fn a_branch_runs_as_the_board_does_which_never_knows() {
    let mut machine = started();
    let (after, span) = (Duration::from_micros(123), Duration::from_millis(30));
    let open = |part: &mut Chip, at| part.drive_pin(Board::of(part).e_stop, None, at);
    let registers = |part: &mut Chip| {
        format!("{:?}", part.bus().slots().iter().map(|slot| slot.registers()).collect::<Vec<_>>())
    };
    let before = (machine.now(), machine.access_digest());
    let branched = [(); 2]
        .map(|()| machine.branch(after, open, span, move |part| registers(part).into_bytes()));
    assert_eq!(branched[0], branched[1]);
    assert_eq!((machine.now(), machine.access_digest()), before);
    let untouched =
        machine.branch(after, |_, _| {}, span, move |part| registers(part).into_bytes());
    assert!(untouched != branched[0], "the input was opened in the others");
    machine.run_for(after);
    machine.open_e_stop(true);
    machine.run_for(span);
    let itself = registers(machine.part_mut());
    assert!(itself.into_bytes() == branched[0]);
}

#[test]
#[should_panic(expected = "the branch failed")]
fn a_branch_that_panics_is_told() {
    started().branch(
        Duration::ZERO,
        |_, _| panic!("in the branch"),
        Duration::ZERO,
        |_| Vec::new(),
    );
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

/// RCC_RSR and its flag of the watchdog (RM0433 §8.7.39), which the firmware reads before it clears
/// it.
#[test]
fn the_watchdog_resets_the_part_when_nobody_feeds_it() {
    let mut machine = started();
    machine.run_for(Duration::from_secs(1));
    assert_eq!(machine.reports().resets, [], "it is fed");
    assert!(machine.part().watchdog_is_started());
    machine.plant(Place::Task("motor_gateway::tasks::supervisor::supervisor", 0), &Fault::Hang);
    assert!(
        machine
            .run_until(Duration::from_millis(100), |machine| !machine.reports().resets.is_empty())
    );
    let resets = machine.reports().resets;
    assert_eq!(resets[0].cause, ResetCause::Model("IWDG"));
    let (hung, reset) = (machine.struck().unwrap(), since_start(resets[0].at));
    // The last feed was at most 10 ms before.
    let took = reset - hung;
    assert!((Duration::from_millis(39)..Duration::from_millis(51)).contains(&took), "{took:?}");
    assert!(!machine.part().watchdog_is_started(), "a reset stops it");
    machine.run_for(STARTED);
    assert!(machine.part().watchdog_is_started(), "and the firmware starts it again");
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
    let missing =
        virtual_board::machine::Builder::new("/nowhere/motor-gateway".as_ref()).unwrap_err();
    let message = missing.to_string();
    assert!(
        message.contains("/nowhere/motor-gateway") && message.contains("`.ci/virtual-board`"),
        "{message}"
    );
}
