//! Our own bytes heard back on RS485: 0x80 and 0x81 are answered by the same bytes, so an echo must never count as a reply.

use crate::bench::{self, VELOCITY, listed, move_axis, outcomes, run_with_host, stop};
use crate::rig::Echo;
use host_protocol::{AxisState, Event as HostEvent, StopAction};

#[test]
fn an_echo_behind_noise_does_not_confirm_the_stop_of_a_dead_motor() {
    let (mut rig, play) = bench::rmd_serial(StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    rig.run(3_000);
    play.borrow_mut().mute = true;
    rig.echo = Echo::BehindNoise;
    stop(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0 }]);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}

#[test]
fn a_line_without_echo_never_confirms_a_stop_and_its_axis_ends_unreachable() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(3_000);
    rig.echo = Echo::Missing;
    stop(&mut rig);
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(outcomes(&rig), [HostEvent::AxisUnreachable { axis: 0 }]);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: false });
}
