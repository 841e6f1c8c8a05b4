//! Raw access fails closed: it is open only beside idle axes, what ends it ends what waits, and
//! unsafe access is for buses without axes (GUARANTEES G10).

use crate::bench::{self, VELOCITY, arm, clear, disarm, e_stop, move_axis, run_with_host, stop};
use crate::rig::Rig;
use crate::text::unhex;
use host_protocol::{
    AxisParameter, AxisState, CanFrame, Error, MAX_FRAME, Protocol, RawFrame, Reply, Request,
    StopAction, StopTarget, Value, requests,
};

pub fn open(rig: &mut Rig, bus: u8) -> Result<Reply, Error> {
    rig.ask(Request::RawOpen(requests::RawOpen { bus, unsafe_access: false }))
}

fn open_unsafe(rig: &mut Rig, bus: u8) -> Result<Reply, Error> {
    rig.ask(Request::RawOpen(requests::RawOpen { bus, unsafe_access: true }))
}

fn close(rig: &mut Rig, bus: u8) {
    rig.ask(Request::RawClose(requests::RawClose { bus })).unwrap();
}

fn send(rig: &mut Rig, bus: u8, frame: RawFrame) -> Result<Reply, Error> {
    rig.ask(Request::RawSend(requests::RawSend { bus, frame }))
}

/// A frame as `ID#HEX`, or bytes of a serial line in hex.
pub fn send_text(rig: &mut Rig, bus: u8, text: &str) -> Result<Reply, Error> {
    let frame = match text.split_once('#') {
        Some((id, data)) => {
            let id = u16::from_str_radix(id, 16).unwrap();
            RawFrame::Can(CanFrame::standard(id, &unhex(data)).unwrap())
        }
        None => RawFrame::Serial(unhex(text).into_iter().collect()),
    };
    send(rig, bus, frame)
}

fn not_harmless(bus: u8) -> Result<Reply, Error> {
    Err(Error::RawNotHarmless { bus })
}

fn not_idle(state: AxisState) -> Result<Reply, Error> {
    Err(Error::NotIdle { axis: 0, state })
}

const NOT_OPEN: Result<Reply, Error> = Err(Error::RawNotOpen { bus: 0 });

/// 0xA2 with this checksum to RMD node 1: 100 °/s.
const MOTION: &str = "3E0108A200000010270000";

/// A bus without axes, as a host configures it before anything else.
fn bare() -> Rig {
    let mut rig = Rig::new();
    bench::hello(&mut rig);
    bench::configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd, Protocol::Thruster]);
    rig
}

/// The first of the two is unfinished; its checksum is the beginning of the second, and the motor
/// reframes after the pause.
#[test]
fn an_unfinished_serial_frame_is_refused_and_so_is_what_would_finish_it() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    open(&mut rig, 2).unwrap();
    let mut whole = unhex(MOTION);
    whole.extend(crate::motors::crc16_modbus(&whole).to_le_bytes());
    let whole = crate::text::hex(&whole);
    let (first, second) = whole.split_at(22);
    let since = rig.now_us;
    for text in
        [&whole, first, second, &format!("FFFF{whole}00"), "3E", "00", "3E01089C00000000000000"]
    {
        assert_eq!(send_text(&mut rig, 2, text), not_harmless(2), "{text}");
        rig.run(10_000);
    }
    assert_eq!(rig.sent_since(2, since), Vec::<&str>::new());
    send_text(&mut rig, 2, "3E01089C00000000000000F230").unwrap();
    rig.run(10_000);
    assert_eq!(rig.sent_since(2, since), ["3E01089C00000000000000F230"]);
}

#[test]
fn what_our_codecs_reject_and_a_lenient_motor_obeys_is_refused() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    // TC 10 % with bytes that are not used, short, or to a node that is no axis; RMD motion cut
    // short, and to node 9.
    let thruster = [
        "30B#544301000000000A",
        "30B#544300000100000A",
        "30B#54430000000A",
        "30C#544300000000000A",
    ];
    let rmd = [
        "141#A20000001027",
        "149#A200000010270000",
        "141#A600000010270000",
        "141#9C00000000000001",
        "141#9C",
        "409#8000800000000800",
    ];
    for text in thruster.into_iter().chain(rmd) {
        assert_eq!(send_text(&mut rig, 0, text), not_harmless(0), "{text}");
    }
    let (mut rig, _) = bench::d5();
    open(&mut rig, 1).unwrap();
    // The speed by a byte, by a word that begins before it, with a wrong checksum, to all, by an
    // asynchronous write, on other ids.
    let speeds = [
        "00B#D50B04032158008B",
        "00B#D50B05031F00588A",
        "00B#D50B0503205802FF",
        "0FE#D5FE050320580280",
        "00B#D50B05042058028E",
        "00B#D5FE0505000000FF",
        "123#D50B05032058028D",
        "00B#D50B05032058",
    ];
    for text in speeds {
        assert_eq!(send_text(&mut rig, 1, text), not_harmless(1), "{text}");
    }
    let extended = |data: &str| RawFrame::Can(CanFrame::extended(0x0A, &unhex(data)).unwrap());
    assert_eq!(send(&mut rig, 1, extended("D50B05032058028D")), not_harmless(1));
    send(&mut rig, 1, extended("D50B050226000038")).unwrap();
}

/// A node may match an extended id by its first or its last 11 bits, and take a remote frame for
/// one of zeros.
#[test]
fn extended_and_remote_frames_are_refused_on_the_ids_of_motors_and_pass_on_others() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    let data = unhex("9C00000000000000");
    for id in [0x141, 0x141 << 18, 0x0123_0401, 0x401 << 18 | 0x3FFFF, 0x30B] {
        assert_eq!(
            send(&mut rig, 0, RawFrame::Can(CanFrame::extended(id, &data).unwrap())),
            not_harmless(0),
            "{id:08X}"
        );
    }
    let remote = |id| {
        RawFrame::Can(
            <CanFrame as embedded_can::Frame>::new_remote(
                embedded_can::StandardId::new(id).unwrap(),
                8,
            )
            .unwrap(),
        )
    };
    assert_eq!(send(&mut rig, 0, remote(0x401)), not_harmless(0));
    assert_eq!(send(&mut rig, 0, remote(0x141)), not_harmless(0));
    send(&mut rig, 0, RawFrame::Can(CanFrame::extended(0x700 << 18 | 0x7FF, &data).unwrap()))
        .unwrap();
    send(&mut rig, 0, remote(0x7FF)).unwrap();
}

/// What ends raw access.
type End = fn(&mut Rig);

#[test]
fn a_stop_an_e_stop_and_a_change_close_it() {
    let ends: [(&str, End); 6] = [
        ("stop", stop),
        ("e-stop", e_stop),
        ("a parameter", |rig| {
            bench::parameter(rig, 0, AxisParameter::TtlUs, Value::Unsigned(50_000))
        }),
        ("another axis", |rig| bench::parameter(rig, 5, AxisParameter::Bus, Value::Unsigned(0))),
        ("the bus", |rig| bench::configure_bus(rig, 0, 1_000_000, &[Protocol::Rmd])),
        ("removal", |rig| {
            drop(rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap())
        }),
    ];
    for (name, end) in ends {
        let (mut rig, _) = bench::rmd(StopAction::Coast);
        open(&mut rig, 0).unwrap();
        send_text(&mut rig, 0, "141#9C00000000000000").unwrap();
        end(&mut rig);
        assert_eq!(send_text(&mut rig, 0, "141#9C00000000000000"), NOT_OPEN, "{name}");
    }
}

/// The stop waits for the reply that the motor owes, and the raw frame does not go before it.
#[test]
fn no_raw_frame_leaves_before_a_stop_of_all_that_waits() {
    let (mut rig, play) = bench::d5();
    open(&mut rig, 1).unwrap();
    play.borrow_mut().mute = true;
    rig.send(&Request::ReadState(requests::ReadState { axis: 0 }));
    rig.run(crate::rig::FRAME_US + 10);
    let since = rig.now_us;
    let frame = RawFrame::Can(CanFrame::standard(0x0B, &unhex("D50B050226000038")).unwrap());
    let requests = [
        Request::RawSend(requests::RawSend { bus: 1, frame }),
        Request::Stop(requests::Stop { target: StopTarget::All }),
    ];
    let mut bytes = Vec::new();
    for (sequence, request) in (0x7000..).zip(requests) {
        let mut out = [0; MAX_FRAME];
        let length = request.encode_frame(sequence, &mut out).unwrap();
        bytes.extend_from_slice(&out[..length]);
    }
    rig.bytes(&bytes);
    run_with_host(&mut rig, 50_000);
    let sent = rig.sent_since(1, since);
    assert_eq!(sent.first(), Some(&"00B#D50B050320000033"), "{sent:?}");
    assert!(rig.answer(0x7001).is_some_and(|answer| answer.is_ok()));
}

/// What waits in the queue and in the controller is gone when the bus is back.
#[test]
fn an_e_stop_drops_what_waits() {
    let mut rig = bare();
    open_unsafe(&mut rig, 0).unwrap();
    rig.cut();
    for _ in 0..3 {
        // One in the controller, two behind it.
        send_text(&mut rig, 0, "149#A200000010270000").unwrap();
    }
    assert_eq!(rig.held_texts().len(), 1);
    e_stop(&mut rig);
    assert_eq!(rig.held_texts(), Vec::<&str>::new());
    rig.mend();
    let since = rig.now_us + 1;
    run_with_host(&mut rig, 200_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
    assert_eq!(open(&mut rig, 0), Err(Error::EStopped {}));
    assert_eq!(open_unsafe(&mut rig, 0), Err(Error::EStopped {}));
}

/// Both come in one delivery.
#[test]
fn an_e_stop_that_is_cleared_at_once_has_closed_it() {
    let mut rig = bare();
    open_unsafe(&mut rig, 0).unwrap();
    rig.cut();
    send_text(&mut rig, 0, "149#A200000010270000").unwrap();
    let both = [
        Request::EStop(requests::EStop {}),
        Request::Clear(requests::Clear { target: host_protocol::ClearTarget::Gateway }),
    ];
    let bytes: Vec<u8> = both
        .iter()
        .zip(1_000..)
        .flat_map(|(request, sequence)| {
            let mut out = [0; host_protocol::MAX_FRAME];
            let length = request.encode_frame(sequence, &mut out).unwrap();
            out[..length].to_vec()
        })
        .collect();
    rig.bytes(&bytes);
    assert_eq!(rig.held_texts(), Vec::<&str>::new());
    assert_eq!(send_text(&mut rig, 0, "149#9C00000000000000"), NOT_OPEN);
}

#[test]
fn motion_of_an_unsafe_access_does_not_leave_when_its_node_is_an_axis() {
    let mut rig = bare();
    open_unsafe(&mut rig, 0).unwrap();
    rig.cut();
    for _ in 0..3 {
        send_text(&mut rig, 0, "141#A200000010270000").unwrap();
    }
    let bus = requests::ConfigureAxis {
        axis: 0,
        parameter: AxisParameter::Bus.number(),
        value: Value::Unsigned(0),
    };
    assert_eq!(rig.ask(Request::ConfigureAxis(bus)), Err(Error::RawOpen { bus: 0 }));
    close(&mut rig, 0);
    bench::configure_axis(&mut rig, 0, 0, Protocol::Rmd, 1, StopAction::Coast);
    rig.mend();
    open(&mut rig, 0).unwrap();
    let since = rig.now_us + 1;
    run_with_host(&mut rig, 100_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
}

#[test]
fn unsafe_access_is_for_a_bus_that_no_axis_names() {
    let mut rig = bare();
    bench::parameter(&mut rig, 3, AxisParameter::Bus, Value::Unsigned(0)); // not even complete
    assert_eq!(open_unsafe(&mut rig, 0), Err(Error::AxisOnBus { bus: 0, axis: 3 }));
    rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 3 })).unwrap();
    open_unsafe(&mut rig, 0).unwrap();
    let since = rig.now_us;
    send_text(&mut rig, 0, "149#A200000010270000").unwrap();
    rig.run(1_000);
    assert_eq!(rig.sent_since(0, since), ["149#A200000010270000"]);
    // Opened anew it only reads.
    open(&mut rig, 0).unwrap();
    assert_eq!(send_text(&mut rig, 0, "149#A200000010270000"), not_harmless(0));
}

#[test]
fn a_motor_that_holds_bars_it_and_so_does_a_trip_until_it_is_cleared() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    close(&mut rig, 0);
    arm(&mut rig);
    disarm(&mut rig);
    run_with_host(&mut rig, 200_000);
    assert!(open(&mut rig, 0).is_err());
    let (mut rig, play) = bench::rmd(StopAction::Brake);
    move_axis(&mut rig, VELOCITY);
    play.borrow_mut().mute = true;
    run_with_host(&mut rig, 200_000);
    assert_eq!(open(&mut rig, 0), not_idle(AxisState::Tripped { confirmed: false }));
    play.borrow_mut().mute = false;
    run_with_host(&mut rig, 2_000_000);
    assert_eq!(open(&mut rig, 0), not_idle(AxisState::Tripped { confirmed: true }));
    clear(&mut rig).unwrap();
    open(&mut rig, 0).unwrap();
    assert_eq!(send_text(&mut rig, 0, "141#7700000000000000"), not_harmless(0));
}

#[test]
fn what_waits_to_be_sent_is_dropped_with_the_bus() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    open(&mut rig, 0).unwrap();
    rig.cut();
    for _ in 0..3 {
        send_text(&mut rig, 0, "149#9C00000000000000").unwrap();
    }
    rig.bus_off(0);
    rig.mend();
    let since = rig.now_us + 1;
    run_with_host(&mut rig, 500_000);
    assert_eq!(rig.sent_since(0, since), Vec::<&str>::new());
}
