//! Frames that reach other motors, raw frames that are not harmless, and what is not sent at all.

use super::*;

const THRUSTER_ZERO: &[u8] = b"TC\0\0\0\0\0\0";
/// A D5 speed of 0.
const D5_STOP: &[u8] = &[0xD5, 0x26, 5, 3, 0x20, 0, 0, 0x4E];

impl Trace {
    /// Another axis: bus 0, protocol, node, stop action, and a D5 request id.
    fn other(&mut self, axis: u8, protocol: u8, node: u8, action: u8, d5_id: Option<u16>) {
        for (parameter, value) in [(1, 0), (2, protocol), (3, node), (5, action)] {
            self.done(0, 0x20, &[axis, parameter, 1, value]);
        }
        if let Some(id) = d5_id {
            let [low, high] = [id & 0x7F | 0x80, id >> 7].map(|part| part.to_le_bytes()[0]);
            self.done(0, 0x20, &[axis, 23, 1, low, high]);
        }
        self.event(0x8003, &[axis, 1]);
    }

    fn raw_open(&mut self) {
        self.done(0, 0x50, &[0, 0]);
    }

    fn raw(&mut self, id: u16, data: &[u8]) {
        let [low, high] = [id & 0x7F | 0x80, id >> 7].map(|part| part.to_le_bytes()[0]);
        let length = u8::try_from(data.len()).unwrap();
        self.done(0, 0x51, &[&[0, 0, low, high, length], data].concat());
        self.oracle.handed(self.now, 0, 0, Frame::Can(id.into(), data));
    }
}

#[test]
pub fn a_request_id_on_which_another_motor_acts() {
    let mut trace = Trace::new(HOLD);
    trace.other(1, 3, 0x26, HOLD, None);
    trace.breaks_nothing();
    trace.done(0, 0x20, &[1, 23, 1, 0x81, 8]); // 0x401
    trace.breaks(Check::IdShared);
}

#[test]
pub fn a_bus_that_d5_motors_share_or_that_is_too_fast_for_them() {
    // Bus 0, bitrate, protocols, not exclusive, 3000 µs
    let configured = |bitrate: [u8; 3], protocols: u8| {
        let mut trace = Trace::new(HOLD);
        trace.done(0, 0x11, &[&[0], &bitrate[..], &[protocols, 0, 0xB8, 0x17]].concat());
        trace
    };
    let (of_d5, mbit) = ([0xDE, 0xEC, 0x0C], [0xC0, 0x84, 0x3D]); // 210 526 and 1 000 000
    configured(of_d5, 0b100).breaks_nothing();
    configured(mbit, 0b011).breaks_nothing();
    configured(of_d5, 0b101).breaks(Check::BusShared);
    configured(mbit, 0b100).breaks(Check::BusShared);
}

#[test]
fn the_stop_of_one_axis_that_sets_another_motor_in_motion() {
    let mut trace = Trace::new(HOLD);
    trace.other(1, 3, 0x26, HOLD, Some(0x401));
    trace.oracle.handed(trace.now, 0, 1, Frame::Can(0x401, D5_STOP));
    let broken: Vec<Check> =
        trace.oracle.violations().iter().map(|violation| violation.check).collect();
    assert_eq!(broken, [Check::IdShared, Check::MotionUnarmed]);
}

#[test]
pub fn a_frame_to_no_axis_that_frees_the_brake_of_one() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x280, &[0x77, 0, 0, 0, 0, 0, 0, 0]));
    let broken: Vec<Check> =
        trace.oracle.violations().iter().map(|violation| violation.check).collect();
    assert_eq!(broken, [Check::WrongMotor, Check::RawUnopened]);
}

#[test]
pub fn raw_frames_that_a_lenient_motor_obeys() {
    for (id, data) in [
        (0x141, &[0xA2, 0, 0, 0, 1][..]),
        (0x141, &[0x77, 9, 9, 9, 9, 9, 9, 9]),
        (0x15F, &[0x81]),
        (0x280, &[0xA0]),
        (0x401, &[]),
        (0x300, &[0x79, 0, 0, 0, 0, 0, 0, 2]),
    ] {
        let mut trace = Trace::new(HOLD);
        trace.raw_open();
        trace.raw(id, data);
        trace.breaks(Check::RawHarmful);
    }
    let mut trace = Trace::new(HOLD);
    trace.raw_open();
    trace.raw(0x141, READ_SPEED);
    trace.breaks_nothing();
}

#[test]
fn raw_access_while_an_axis_is_not_at_rest_or_the_e_stop_is_latched() {
    let mut trace = Trace::active();
    trace.raw_open();
    assert_eq!(trace.oracle.violations()[0].check, Check::RawUnopened);
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x33, &[]);
    trace.event(0x8005, &[]);
    trace.exchange(STOP, STOP);
    trace.raw_open();
    assert_eq!(trace.oracle.violations()[0].check, Check::RawUnopened);
}

#[test]
fn an_access_for_everything_beside_an_axis_or_an_axis_beside_it() {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x50, &[0, 1]);
    trace.breaks(Check::RawUnopened);
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x23, &[0]);
    trace.done(0, 0x50, &[0, 1]);
    trace.raw(0x141, VELOCITY);
    trace.breaks_nothing();
    trace.done(0, 0x20, &[0, 1, 1, 0]);
    trace.breaks(Check::RawUnopened);
}

#[test]
fn a_frame_of_an_access_for_everything_that_leaves_when_that_has_ended() {
    for (after, is_broken) in [(200, false), (300, true)] {
        let mut trace = Trace::new(HOLD);
        trace.done(0, 0x23, &[0]);
        trace.done(0, 0x50, &[0, 1]);
        trace.raw(0x141, VELOCITY);
        trace.done(0, 0x53, &[0]);
        trace.now += after;
        trace.oracle.left(trace.now, 0, 0);
        assert_eq!(trace.oracle.violations().len(), usize::from(is_broken));
        assert!(
            trace.oracle.violations().iter().all(|violation| violation.check == Check::RawUnopened)
        );
    }
}

#[test]
fn a_raw_frame_that_waits_and_leaves_after_an_e_stop() {
    let mut trace = Trace::new(HOLD);
    trace.raw_open();
    trace.done(0, 0x51, &[&[0, 0, 0xC1, 2, 8], READ_SPEED].concat());
    trace.other(1, 2, 0x0E, COAST, None);
    trace.hand(READ_SPEED);
    trace.breaks_nothing();
    let mut trace = Trace::new(HOLD);
    trace.raw_open();
    trace.done(0, 0x51, &[&[0, 0, 0x80, 0x0E, 8], READ_SPEED].concat()); // id 0x700
    trace.done(0, 0x33, &[]);
    trace.exchange(STOP, STOP);
    trace.oracle.handed(trace.now, 0, 1, Frame::Can(0x700, READ_SPEED));
    trace.breaks(Check::RawUnopened);
}

#[test]
fn two_raw_requests_of_which_the_second_is_swallowed_by_the_first_only_for_some() {
    let mut oracle = Oracle::new(&[BusKind::Rs485 { echo: true }], 3, 2, 4);
    let motion = [0x3E, 1, 8, 0xA2, 0, 0, 0, 0x10, 0x27, 0, 0, 0xC4, 0x63];
    let read = [0x3E, 1, 8, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    let send = |oracle: &mut Oracle, now: u64, sequence: u16, bytes: &[u8]| {
        let body = [&[0, 1, u8::try_from(bytes.len()).unwrap()], bytes].concat();
        oracle.to_gateway(now, 0, &frame(1, sequence, 0x51, &body));
        oracle.from_gateway(now, 0, &frame(2, sequence, 0x51, &[]));
        oracle.handed(now, 0, 0, Frame::Serial(bytes));
        oracle.left(now + 100, 0, 0);
    };
    oracle.to_gateway(10, 0, &frame(1, 1, 0x50, &[0, 0]));
    oracle.from_gateway(10, 0, &frame(2, 1, 0x50, &[]));
    send(&mut oracle, 1_000, 2, &read[..11]);
    send(&mut oracle, 9_000, 3, &read);
    assert_eq!(oracle.violations(), []);
    send(&mut oracle, 20_000, 4, &read[..5]);
    send(&mut oracle, 29_000, 5, &motion);
    assert_eq!(oracle.violations().len(), 1);
    assert_eq!(oracle.violations()[0].check, Check::RawHarmful);
}

#[test]
pub fn a_change_that_is_sent_when_its_axis_has_been_moved_to_another_motor() {
    for left_behind in [SET_ZERO, READ_SPEED] {
        let mut trace = Trace::new(HOLD);
        trace.hand(left_behind);
        trace.done(0, 0x20, &[0, 3, 1, 2]); // node 2
        trace.now += 135;
        trace.oracle.left(trace.now, 0, 0);
        trace.breaks(Check::LeftBehind);
    }
}

#[test]
pub fn a_setpoint_that_is_accepted_and_never_sent() {
    let mut trace = Trace::armed();
    for _ in 0..8 {
        trace.setpoint(EPOCH, 50_000);
        trace.exchange(READ_FAULTS, FAULTLESS);
        trace.now += 15_000;
    }
    assert_eq!(trace.oracle.violations()[0].check, Check::NotDelivered);
}

#[test]
pub fn faults_that_are_not_read() {
    let mut trace = Trace::armed();
    for _ in 0..20 {
        trace.exchange(READ_SPEED, STILL);
        trace.now += 10_000;
        trace.done(0, 0x03, &[]);
    }
    trace.breaks(Check::FaultsUnread);
}

#[test]
fn a_motor_that_turns_though_nobody_has_set_it_in_motion() {
    const TURNS: &[u8] = &[0x9C, 30, 0, 0, 60, 0, 0, 0];
    let mut trace = Trace::armed();
    trace.exchange(READ_SPEED, TURNS);
    trace.wait(10_000);
    trace.exchange(READ_SPEED, TURNS);
    trace.wait(10_000);
    trace.breaks_nothing();
    trace.exchange(READ_SPEED, TURNS);
    trace.wait(371);
    trace.breaks(Check::StopLate);
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &[0, 37, 0, 1]);
    trace.arm(0);
    for _ in 0..3 {
        trace.exchange(READ_SPEED, TURNS);
        trace.wait(20_000);
    }
    trace.breaks_nothing();
}

#[test]
pub fn a_limit_that_is_exceeded_by_rounding() {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &[&[0, 14, 3][..], &1.745_f32.to_le_bytes()].concat());
    trace.arm(0);
    trace.setpoint(EPOCH, 50_000);
    trace.hand(&[0xA2, 0, 0, 0, 0x0E, 0x27, 0, 0]); // 99.98 degrees a second are 1.74498 rad/s
    trace.breaks_nothing();
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &[&[0, 14, 3][..], &1.745_f32.to_le_bytes()].concat());
    trace.arm(0);
    trace.setpoint(EPOCH, 50_000);
    trace.hand(VELOCITY); // 100 are 1.7453
    trace.breaks(Check::LimitOnWire);
}

#[test]
pub fn a_limit_that_nothing_can_measure() {
    let mut trace = Trace::new(HOLD);
    trace.other(1, 2, 0x0E, COAST, None);
    trace.done(0, 0x20, &[&[1, 15, 3][..], &2.0_f32.to_le_bytes()].concat());
    trace.breaks_nothing();
    trace.done(0, 0x20, &[&[1, 16, 3][..], &2.0_f32.to_le_bytes()].concat());
    trace.breaks(Check::LimitBlind);
}

#[test]
pub fn a_threshold_of_standstill_below_what_the_motor_can_tell() {
    let standstill = |rad_s: f32| [&[0, 11, 3][..], &rad_s.to_le_bytes()].concat();
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &standstill(0.017_454));
    trace.breaks_nothing();
    trace.done(0, 0x20, &standstill(0.0174));
    trace.breaks(Check::StandstillBlind);
    // 1 degree a second is too little for a thruster.
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x20, &standstill(0.017_454));
    trace.done(0, 0x20, &[0, 2, 1, 2]);
    trace.breaks(Check::StandstillBlind);
}

#[test]
pub fn an_epoch_that_is_given_again_after_a_loss_of_power() {
    let mut trace = Trace::armed();
    trace.oracle.power_lost(trace.now + 10);
    let mut again = Trace::new(HOLD);
    again.oracle.epochs = trace.oracle.epochs;
    let sequence = again.begin_to_arm(0);
    again.asks_to_arm();
    again.is_armed(0, sequence);
    again.breaks(Check::EpochRepeated);
}

#[test]
fn a_foreign_load_counts_against_a_stop_only_where_its_id_is_lower() {
    for (id, late) in [(0x140, false), (0x142, true)] {
        let mut trace = Trace::active();
        trace.stop();
        trace.hand(STOP);
        for _ in 0..8 {
            trace.now += 135;
            trace.oracle.received(trace.now, 0, Frame::Can(id, THRUSTER_ZERO));
            trace.settle();
        }
        let broken: Vec<Check> =
            trace.oracle.violations().iter().map(|violation| violation.check).collect();
        assert_eq!(broken, if late { vec![Check::StopLate] } else { vec![] }, "{id:03X}");
    }
}

#[test]
fn the_stop_of_an_e_stop_that_an_idle_axis_never_gets_on_a_bus_that_was_off() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.bus_state(trace.now, 0, true);
    trace.done(0, 0x33, &[]);
    trace.event(0x8005, &[]);
    trace.wait(100_000);
    trace.breaks_nothing();
    trace.oracle.bus_state(trace.now, 0, false);
    trace.wait(371);
    trace.breaks(Check::StopLate);
}

#[test]
pub fn a_frame_for_which_nobody_was_told_to_ask() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.not_named(trace.now, 0);
    trace.breaks(Check::NotNamed);
}

#[test]
pub fn a_panic_of_the_core() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.panicked(trace.now, "assertion failed".into());
    trace.breaks(Check::Panicked);
}

#[test]
pub fn events_that_follow_from_each_other_without_end() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.never_rests(trace.now);
    trace.breaks(Check::Restless);
}
