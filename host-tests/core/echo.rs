//! Our own bytes heard back on RS485: 0x80 and 0x81 are answered by the same bytes, so an echo must
//! never count as a reply.

use crate::bench::{self, VELOCITY, move_axis, stop};
use crate::rig::Echo;
use host_protocol::{RawFrame, Reply, Request, StopAction, requests};

#[test]
fn an_echo_behind_noise_does_not_confirm_the_stop_of_a_dead_motor() {
    let (mut rig, play) = bench::rmd_serial(StopAction::Coast);
    move_axis(&mut rig, VELOCITY);
    rig.run(3_000);
    play.borrow_mut().mute = true;
    rig.echo = Echo::BehindNoise;
    stop(&mut rig);
    bench::assert_becomes_unreachable(&mut rig);
}

#[test]
fn a_line_without_echo_never_confirms_a_stop_and_its_axis_ends_unreachable() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    move_axis(&mut rig, VELOCITY);
    rig.run(3_000);
    rig.echo = Echo::Missing;
    stop(&mut rig);
    bench::assert_becomes_unreachable(&mut rig);
}

#[test]
fn raw_access_hears_the_motor_and_not_our_own_bytes() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    rig.ask(Request::RawOpen(requests::RawOpen { bus: 2, unsafe_access: false })).unwrap();
    let bytes = crate::text::unhex("3E01089C00000000000000F230"); // PROTOCOL-NOTES R1
    let frame = RawFrame::Serial(bytes.into_iter().collect());
    rig.ask(Request::RawSend(requests::RawSend { bus: 2, frame })).unwrap();
    rig.run(10_000);
    let Ok(Reply::RawReceive(received)) =
        rig.ask(Request::RawReceive(requests::RawReceive { bus: 2 }))
    else {
        panic!("nothing received");
    };
    let [received] = received.frames.as_slice() else { panic!("{:?}", received.frames) };
    let RawFrame::Serial(bytes) = &received.frame else { panic!("{received:?}") };
    assert_eq!(crate::text::hex(&bytes[..11]), "3E01089C32640000006801");
}
