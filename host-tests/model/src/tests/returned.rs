//! Frames that a thruster returns for TC and VC in the place of an echo (Thruster manual §2.4).

use super::*;

const TC_ZERO: &[u8] = b"TC\0\0\0\0\0\0";
const TC_FIVE: &[u8] = b"TC\0\0\0\0\0\x05";

impl Trace {
    /// Axis 1 is a thruster of node 0x0E whose VM is set so.
    fn of_thruster(return_mode: u8, no_header: bool) -> Self {
        let mut trace = Self::new(HOLD);
        trace.done(0, 0x23, &[0]);
        trace.address = (0x30E, 0x28E);
        for (parameter, value) in [(1, 0), (2, 2), (3, 0x0E), (5, COAST)] {
            trace.done(0, 0x20, &[1, parameter, 1, value]);
        }
        // 0x200 as a varint.
        let mode = if no_header { vec![0x80, 4] } else { vec![return_mode] };
        trace.done(0, 0x20, &[&[1, 45, 1][..], &mode].concat());
        trace.event(0x8003, &[1, 1]);
        trace
    }

    /// It is stopped, answers each stop so, and its stop counts as confirmed.
    fn is_stopped(&mut self, reply: &[u8]) {
        self.done(0, 0x33, &[]);
        self.event(0x8003, &[1, 5]);
        self.exchange(TC_ZERO, reply);
        self.exchange(TC_ZERO, reply);
        self.event(0x8003, &[1, 1]);
    }
}

#[test]
fn the_frame_that_acknowledges_a_stop() {
    for (return_mode, reply, proved) in [
        (0, TC_ZERO, true),
        // The echo is one in each mode.
        (1, TC_ZERO, true),
        (1, &[0x54, 1, 0, 0, 1, 0xE0, 0, 10], true),
        (3, &[0x54, 2, 0, 0, 0, 30, 0, 31], false),
        (6, &[0x54, 2, 0, 0, 0, 30, 0, 31], true),
        (0, &[0x54, 1, 0, 0, 1, 0xE0, 0, 10], false),
        (1, &[0x56, 1, 0, 0, 1, 0xE0, 0, 10], false),
    ] {
        let mut trace = Trace::of_thruster(return_mode, false);
        trace.is_stopped(reply);
        let broken: Vec<Check> =
            trace.oracle.violations().iter().map(|violation| violation.check).collect();
        let wanted = if proved { vec![] } else { vec![Check::ConfirmedUnproved] };
        assert_eq!(broken, wanted, "{return_mode}: {reply:02X?}");
    }
    let mut trace = Trace::of_thruster(0, true);
    trace.is_stopped(&[0, 0, 1, 0xE0, 0, 10, 0, 0]);
    trace.breaks_nothing();
}

/// The first frame belongs to the signal that was sent before the stop.
#[test]
fn a_frame_that_belongs_to_the_signal_before() {
    let mut trace = Trace::of_thruster(1, false);
    let reply = [0x54, 1, 0, 0, 1, 0xE0, 0, 10];
    trace.oracle.axes[1].armed = true;
    trace.oracle.axes[1].heard = (trace.now, 0);
    trace.oracle.axes[1].faults_asked = (trace.now, 0);
    trace.oracle.axes[1].epoch = Some(EPOCH.into());
    let body = [&[1][..], &trace.moves(EPOCH, 50_000, &[0, 0xCD, 0xCC, 0x4C, 0x3D])[1..]].concat();
    trace.done(0, 0x40, &body);
    trace.send(TC_FIVE);
    trace.done(0, 0x33, &[]);
    trace.event(0x8003, &[1, 5]);
    trace.send(TC_ZERO);
    trace.reply(&reply);
    trace.send(TC_ZERO);
    trace.event(0x8003, &[1, 1]);
    trace.breaks(Check::ConfirmedUnproved);
}
