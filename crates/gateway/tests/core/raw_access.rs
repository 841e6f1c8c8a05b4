//! Raw frames: what would move or change the motor of an axis obeys the rules of axes (GUARANTEES G2).

use crate::bench::{self, VELOCITY, assert_tripped, move_axis, run_with_host};
use crate::rig::Rig;
use crate::text::unhex;
use host_protocol::{
    AxisParameter, AxisState, CanFrame, Error, RawFrame, Reply, Request, StopAction, TripReason, Value,
    requests,
};

fn open(rig: &mut Rig, bus: u8) -> Result<Reply, Error> {
    rig.ask(Request::RawOpen(requests::RawOpen { bus }))
}

fn send_can(rig: &mut Rig, id: u16, data: &str) -> Result<Reply, Error> {
    let frame = RawFrame::Can(CanFrame::standard(id, &unhex(data)).unwrap());
    rig.ask(Request::RawSend(requests::RawSend { bus: 0, frame }))
}

fn send_serial(rig: &mut Rig, bytes: &str) -> Result<Reply, Error> {
    let frame = RawFrame::Serial(unhex(bytes).into_iter().collect());
    let sent = rig.ask(Request::RawSend(requests::RawSend { bus: 2, frame }));
    rig.run(10_000);
    sent
}

const NOT_ARMED: Result<Reply, Error> = Err(Error::NotArmed { axis: 0, state: AxisState::Idle });

/// 0xA2, 100 °/s, to RMD node 1 and to all, with checksums computed apart from the codec.
fn motion(id: &str) -> String {
    let mut frame = unhex(&format!("3E{id}08A200000010270000"));
    frame.extend(crate::motors::crc16_modbus(&frame).to_le_bytes());
    crate::text::hex(&frame)
}

#[test]
fn motion_on_rs485_is_refused_also_in_pieces_and_behind_other_bytes() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    open(&mut rig, 2).unwrap();
    let since = rig.now_us;
    for id in ["01", "CD"] {
        let bytes = motion(id);
        assert_eq!(send_serial(&mut rig, &bytes), NOT_ARMED);
        assert_eq!(send_serial(&mut rig, &format!("FFFF{bytes}00")), NOT_ARMED);
        let (first, second) = bytes.split_at(12);
        send_serial(&mut rig, first).unwrap();
        assert_eq!(send_serial(&mut rig, second), NOT_ARMED);
        assert_eq!(send_serial(&mut rig, second), NOT_ARMED);
        send_serial(&mut rig, "0000000000000000000000000000").unwrap();
    }
    let other = motion("02");
    send_serial(&mut rig, &other).unwrap();
    assert_eq!(rig.sent_since(2, since).iter().filter(|text| text.contains("A20000001027")).count(), 1);
}

#[test]
fn motion_that_is_cut_short_or_unknown_is_refused_too() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    assert_eq!(send_can(&mut rig, 0x141, "A20000001027"), NOT_ARMED);
    assert_eq!(send_can(&mut rig, 0x141, "A600000010270000"), NOT_ARMED);
    assert_eq!(send_can(&mut rig, 0x141, "A800640010270000"), NOT_ARMED);
    assert!(send_can(&mut rig, 0x141, "9C00000000000000").is_ok());
}

#[test]
fn a_timeout_that_was_written_raw_is_not_the_one_we_wrote() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(false));
    bench::provision(&mut rig, 500).unwrap();
    open(&mut rig, 0).unwrap();
    send_can(&mut rig, 0x141, "B300000000000000").unwrap();
    rig.ask(Request::RawClose(requests::RawClose { bus: 0 })).unwrap();
    let arming = rig.ask(Request::Arm(requests::Arm { axis: 0 }));
    assert_eq!(arming, Err(Error::MotorTimeoutUnknown { axis: 0 }));
}

#[test]
fn a_tripped_axis_is_not_changed_and_its_bus_not_opened_before_its_stop_is_confirmed() {
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 200_000);
    assert_eq!(open(&mut rig, 0), Err(Error::AxisArmed { axis: 0 }));
    play.borrow_mut().mute = false;
    run_with_host(&mut rig, 2_000_000);
    assert_tripped(&mut rig, TripReason::MotorSilent, true);
    open(&mut rig, 0).unwrap();
    let state = AxisState::Tripped { confirmed: true };
    assert_eq!(send_can(&mut rig, 0x141, "7700000000000000"), Err(Error::NotIdle { axis: 0, state }));
}

#[test]
fn what_waits_to_be_sent_is_dropped_with_the_bus() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    rig.cut();
    for _ in 0..3 {
        send_can(&mut rig, 0x149, "A200000010270000").unwrap(); // one in the controller, two behind it
    }
    rig.bus_off(0);
    rig.mend();
    let since = rig.now_us + 1;
    run_with_host(&mut rig, 500_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
}
