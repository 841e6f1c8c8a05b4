//! The configuration is stored and comes back, whatever becomes of the supply meanwhile; and what
//! the flash does keeps no stop from leaving.

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use host_protocol::requests::SaveConfiguration;
use host_protocol::{
    AxisParameter, AxisState, BootReason, Call, Kind, MAX_FRAME, StopTarget, StoredState, Value,
    encode,
};
use virtual_board::board::Board;
use virtual_board::machine::{FlashOperation, Snapshot};

use crate::lab::{AXES, D5, Lab};
use crate::part::part_of;

const OFF: Duration = Duration::from_millis(100);
/// For every first stop to be confirmed.
const SETTLED: Duration = Duration::from_millis(500);
/// What one configuration has and the other has not.
const PARAMETER: AxisParameter = AxisParameter::VelocityLimitRadS;
const NEW: Value = Value::Float(3.0);
/// Beyond what a client that goes on has reached.
const FAR: u16 = 0x7000;
/// An erasure on each board, at most.
const ERASURE: Duration = Duration::from_secs(2);
/// A stop of an axis at rest must have begun within (GUARANTEES, G5); on the G474 the processor
/// stands still for the erasure of a page as well, as long as it takes at most.
fn stop_within() -> Duration {
    let still = match Board::chosen() {
        Board::NucleoH743zi => Duration::ZERO,
        Board::NucleoG474re => Duration::from_millis(25),
    };
    Duration::from_millis(30) + still
}

impl Lab {
    fn stored(&mut self) -> StoredState {
        self.client.read_stored().expect("a state").state
    }

    fn save(&mut self) {
        self.client.save_configuration().expect("stored");
    }

    /// After the power has come back, or a reset.
    fn meet_again(&mut self) {
        self.run_for(SETTLED);
        self.client.reconnect().expect("hello");
        self.client.take_authority().expect("in command");
        for axis in self.client.list_axes().expect("a list") {
            // An output that is on is no rest.
            if axis.state == AxisState::Holding && axis.axis != D5 {
                self.client.output_off(axis.axis).expect("off");
            }
        }
        self.run_for(SETTLED);
    }

    /// Asks for a save, and does not wait for it.
    fn begin_save(&mut self) {
        let mut frame = [0; MAX_FRAME];
        let length = encode(
            Kind::Request,
            FAR,
            SaveConfiguration::NUMBER,
            &SaveConfiguration {},
            &mut frame,
        )
        .expect("it fits");
        let host = self.outside.hosts[0];
        self.machine.borrow_mut().line(host).send(&frame[..length]);
    }

    /// Has the next start find this count of failed ones, which is followed by its complement.
    fn count_failed_starts(&self, count: u32) {
        let mut machine = self.machine.borrow_mut();
        let (ram, end) = (machine.symbol("__sretained"), machine.symbol("__eretained"));
        let words = machine.read_memory(ram, usize::try_from(end - ram).expect("some KiB"));
        let words: Vec<u32> = words
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
            .collect();
        let at = words.windows(2).rposition(|pair| pair[0] < 6 && pair[1] == !pair[0]);
        let at = at.expect("a count");
        for (at, word) in (at..).zip([count, !count]) {
            machine.write_memory(ram + 4 * at as u64, &word.to_le_bytes());
        }
    }

    fn operations(&self) -> Vec<FlashOperation> {
        self.machine.borrow_mut().flash_operations()
    }
}

#[test]
fn a_stored_configuration_comes_back_after_a_loss_of_power_and_its_axes_are_stopped_first() {
    let mut lab = Lab::configured();
    assert_eq!(lab.stored(), StoredState::Nothing);
    lab.client.take_authority().expect("in command");
    lab.save();
    assert_eq!(lab.stored(), StoredState::Kept { differs: false });
    lab.client.configure_axis(D5, PARAMETER, NEW).expect("another limit");
    assert_eq!(lab.stored(), StoredState::Kept { differs: true });
    lab.machine.borrow_mut().power_cycle(OFF);
    let since = lab.now();
    lab.run_for(SETTLED);
    let stops = AXES.map(|axis| lab.first_stop(axis, since));
    assert!(
        stops.iter().all(|stop| stop.first_bit < since + Duration::from_millis(60)),
        "{stops:?}"
    );
    lab.meet_again();
    assert_eq!(lab.client.hello().boot, BootReason::PowerOn);
    assert_eq!(lab.stored(), StoredState::Kept { differs: false });
    for axis in AXES {
        let state = lab.report(axis).state;
        assert!(matches!(state, AxisState::Idle | AxisState::Holding), "axis {axis}: {state:?}");
    }
    assert_eq!(lab.client.read_axis_parameter(D5, PARAMETER).expect("a value"), None);
    // What the others were told of a timeout is not stored: it is unknown.
    let holds = lab.arm(&[D5]);
    lab.keep(&holds, SETTLED);
    lab.assert_turning(D5);
}

/// What five failed starts, and the run without configuration behind them, leave.
#[test]
fn behind_a_run_without_configuration_the_pin_loads_what_is_stored() {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("in command");
    lab.save();
    lab.client.configure_axis(D5, PARAMETER, NEW).expect("another limit");
    lab.count_failed_starts(6);
    lab.machine.borrow_mut().reset_by_pin();
    let since = lab.now();
    lab.run_for(SETTLED);
    let stops = AXES.map(|axis| lab.first_stop(axis, since));
    assert!(
        stops.iter().all(|stop| stop.first_bit < since + Duration::from_millis(60)),
        "{stops:?}"
    );
    lab.meet_again();
    assert_eq!(lab.stored(), StoredState::Kept { differs: false });
    assert_eq!(lab.client.read_axis_parameter(D5, PARAMETER).expect("a value"), None);
}

#[test]
fn after_a_reset_the_running_configuration_counts() {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("in command");
    lab.save();
    lab.client.configure_axis(D5, PARAMETER, NEW).expect("another limit");
    lab.machine.borrow_mut().reset_by_pin();
    lab.meet_again();
    assert_eq!(lab.stored(), StoredState::Kept { differs: true });
    assert_eq!(lab.client.read_axis_parameter(D5, PARAMETER).expect("a value"), Some(NEW));
    lab.client.forget_stored().expect("forgotten");
    assert_eq!(lab.stored(), StoredState::Nothing);
    lab.machine.borrow_mut().power_cycle(OFF);
    lab.meet_again();
    assert_eq!(lab.stored(), StoredState::Nothing);
    assert_eq!(lab.client.list_axes().expect("a list").len(), 0);
}

/// A board whose both areas hold a configuration that counted, and that runs another one.
static STORED: LazyLock<Snapshot> = LazyLock::new(|| {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("in command");
    lab.save();
    lab.save();
    lab.client.configure_axis(D5, PARAMETER, NEW).expect("another limit");
    lab.into_snapshot()
});

fn stored() -> Lab {
    let mut lab = Lab::resume(&STORED);
    lab.client.take_authority().expect("in command");
    lab
}

/// Cuts the power in an operation of a save, with what the seed leaves of it. Returns whether the
/// new configuration is found then, or else the old.
fn cut_in(operation: usize, seed: u64) -> bool {
    let mut lab = stored();
    let before = lab.operations().len();
    lab.begin_save();
    let wanted = before + operation + 1;
    let begins = lab.machine.borrow_mut().run_until_flash_operation(wanted, 5 * ERASURE);
    assert!(begins, "a save has no operation {operation}");
    lab.machine.borrow_mut().cut_power_in_flash_operation(seed);
    lab.meet_again();
    assert_eq!(lab.stored(), StoredState::Kept { differs: false }, "{operation}, seed {seed}");
    assert_eq!(lab.client.list_axes().expect("a list").len(), AXES.len());
    let found = lab.client.read_axis_parameter(D5, PARAMETER).expect("a value");
    assert!(found.is_none() || found == Some(NEW), "{operation}, seed {seed}: {found:?}");
    // What is left does not stand in the way of the next save.
    let next = Value::Float(2.5);
    lab.client.configure_axis(D5, PARAMETER, next).expect("another limit");
    lab.save();
    lab.machine.borrow_mut().power_cycle(OFF);
    lab.meet_again();
    let now = lab.client.read_axis_parameter(D5, PARAMETER).expect("a value");
    assert_eq!(now, Some(next), "{operation}, seed {seed}");
    found.is_some()
}

/// What a save does: erasures, then words of the rows, then twice the head.
fn save_operations() -> Vec<FlashOperation> {
    let mut lab = stored();
    let before = lab.operations().len();
    lab.save();
    lab.operations().split_off(before)
}

#[test]
fn a_loss_of_power_at_each_step_of_a_save_leaves_the_old_or_the_new() {
    let operations = save_operations();
    let words = operations.iter().filter(|operation| operation.word.is_some()).count();
    let (erasures, count) = (operations.len() - words, operations.len());
    // 21 bytes in whole words.
    let head_words = 21_usize.div_ceil(Board::chosen().flash.word);
    let second_head = count - head_words;
    let first_head = second_head - head_words;
    // The first and the last erasure, rows, each head.
    let steps = [0, erasures - 1, erasures, (erasures + first_head) / 2, first_head, second_head];
    for (step, seed) in part_of(steps.into_iter().zip(1..)) {
        let is_new = cut_in(step, seed);
        assert_eq!(is_new, step >= second_head, "step {step} of {count}");
    }
}

#[test]
fn a_stop_keeps_its_bound_while_a_page_is_erased_and_the_watchdog_is_fed() {
    let mut lab = Lab::configured();
    lab.client.take_authority().expect("in command");
    lab.begin_save();
    let mut second = lab.second_client();
    assert!(lab.machine.borrow_mut().run_until_flash_operation(1, ERASURE));
    let at = lab.now();
    second.stop(StopTarget::All).expect("admitted");
    lab.run_for(3 * ERASURE);
    let last = AXES.map(|axis| lab.first_stop(axis, at).first_bit - at).into_iter().max();
    assert!(last < Some(stop_within()), "{last:?}");
    assert_eq!(lab.operations()[0].word, None, "an erasure");
    assert!(lab.machine.borrow_mut().reports().resets.is_empty());
    lab.meet_again();
    assert_eq!(lab.stored(), StoredState::Kept { differs: false });
}

/// By hand: every operation of a save, with two things that may be left of each. What has been done
/// is a line of power-cuts.txt.
#[test]
#[ignore = "takes long: .ci/virtual-board cuts"]
fn a_loss_of_power_at_every_operation_of_a_save_leaves_the_old_or_the_new() {
    let began = Instant::now();
    let operations = save_operations().len();
    for (operation, seed) in (0..operations).flat_map(|step| [(step, 0), (step, 1)]) {
        let is_new = cut_in(operation, seed + 2 * operation as u64);
        println!("save: operation {operation} of {operations}, seed {seed}: new: {is_new}");
    }
    let (board, cuts) = (Board::chosen().name(), 2 * operations);
    let minutes = began.elapsed().as_secs().div_ceil(60);
    let (what, equal) = ("save", 0);
    println!(
        "power-cuts: {board} | {what:<17} | 1/1 | {operations:>10} | {cuts:>6} | {equal:>6} | {cuts:>6} | \
         {minutes:>7} | well"
    );
}
