//! More frames on a CAN bus than the firmware takes out of the controller.

use std::time::Duration;

use host_protocol::{BusState, CanFrame};
use mgw_sim::Motor;

use crate::lab::{BUS_RMD_AND_THRUSTER, Lab, RMD, SEED, TTL, turning, wired};
use crate::log;
use crate::reaction::Reaction;

/// A core so slow that it is behind a full bus, and not so slow that its watchdog bites: 47 µs a
/// frame are 850 instructions.
const SLOW: u64 = 18_000_000;
const FRAMES: usize = 200;

/// Each frame is on the wire and acknowledged; those that found no room are counted, and afterwards
/// everything works: the link, the bus, and a motor is armed and moves.
pub fn frames_lost_in_the_controller_are_counted_and_nothing_sticks() -> Vec<Reaction> {
    let (board, outside, probes) = wired(SEED);
    let mut lab = Lab::around(board.instructions_per_second(SLOW).power_on(), outside, probes);
    lab.configure_bus(BUS_RMD_AND_THRUSTER);
    lab.configure_axis(RMD);
    {
        let mut machine = lab.machine.borrow_mut();
        let (now, frame) = (machine.now(), CanFrame::standard(0x555, &[]).expect("a frame"));
        (0..FRAMES).for_each(|_| machine.node(lab.probes[0]).send(now, &frame));
    }
    lab.run_for(Duration::from_millis(500));
    assert_eq!(
        lab.machine.borrow_mut().node(lab.probes[0]).delivered(),
        FRAMES,
        "each was acknowledged"
    );
    let status = lab.client.bus_status(BUS_RMD_AND_THRUSTER).expect("status");
    assert_eq!(status.state, BusState::Active);
    assert!(status.counters.receive_overflows > 0, "{status:?}");
    let seen = status.counters.unmatched + status.counters.rejected;
    assert!(seen > 0 && (seen as usize) < FRAMES, "{status:?}");
    let lines = log::take(&mut lab.machine.borrow_mut());
    let lost = lines.iter().any(|line| {
        line.starts_with("WARN bus 0: ") && line.ends_with("received frames lost so far")
    });
    assert!(lost, "{lines:?}");
    let epoch = lab.client.arm(RMD).expect("armed").epoch;
    lab.client.set(RMD, epoch, turning(RMD), TTL).expect("taken over");
    lab.run_for(Duration::from_millis(50));
    assert!(lab.motor(RMD, Motor::speed_rad_s) > 0.5);
    Vec::new()
}
