//! Native commands and relative moves.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use crate::line::{LATENCY, Scripted, error_bytes, healthy, reply_bytes};
use host_protocol::replies::{AxisReport, NativeReply};
use host_protocol::{AxisState, Bytes, Error, MotorTimeout, Reply, Request};
use mgw_client::{Client, ClientError, MOTOR_DEADLINE, NativeHold};

const TTL: Duration = Duration::from_millis(100);
/// 0xA1, 1 A (RMD V3.6 §2.17.4).
const CURRENT: [u8; 8] = [0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00];

fn data(bytes: &[u8]) -> Bytes<8> {
    Bytes::from_slice(bytes).unwrap()
}

/// By how much an expiry lies ahead of the gateway time at which it came, µs.
fn lead(expires_at_us: u32, time_us: u64) -> u32 {
    expires_at_us.wrapping_sub(u32::try_from(time_us).unwrap())
}

#[test]
fn a_relative_move_expires_like_a_setpoint_and_returns_its_target() {
    let line = Scripted::new(|heard| {
        if let Request::MoveRelative(request) = &heard.request {
            assert_eq!((request.axis, request.epoch), (2, 9));
            assert_eq!((request.distance_rad, request.speed_limit_rad_s), (1.5, 3.0));
            assert!((99_000..=100_000).contains(&lead(request.expires_at_us, heard.time_us)));
        }
        healthy(heard)
    });
    let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
    // The measure of the clock is old: a ping comes first.
    line.0.borrow_mut().now += Duration::from_secs(2);
    let target = client.move_relative(2, 9, 1.5, 3.0, TTL).unwrap();
    assert_eq!((target.start_rad, target.target_rad), (0.5, 2.0));
    assert_eq!(line.sent_after_opening().len(), 2);
}

#[test]
fn a_relative_move_whose_answer_is_lost_is_asked_for_with_the_same_bytes() {
    let line = Scripted::new(|heard| match heard.request {
        Request::MoveRelative(_) if heard.times < 3 => vec![],
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
    client.move_relative(2, 9, 1.5, 3.0, TTL).unwrap();
    let sent = line.sent_after_opening();
    assert_eq!(sent.len(), 3);
    assert!(sent.iter().all(|(_, bytes)| *bytes == sent[0].1));
    // Soon: its target must come while it is still permitted.
    assert_eq!(sent[1].0 - sent[0].0, Duration::from_millis(20));
}

#[test]
fn a_native_command_carries_its_bytes_and_returns_the_motors() {
    let line = Scripted::new(|heard| match &heard.request {
        Request::Native(request) => {
            assert_eq!((request.axis, request.epoch), (1, 0));
            assert_eq!(request.data, [0x9C, 0, 0, 0, 0, 0, 0, 0]);
            let reply = Reply::Native(NativeReply { data: data(&[0x9C, 0x19, 0, 0, 0, 0, 0, 0]) });
            vec![(2 * LATENCY, reply_bytes(heard.sequence, &reply))]
        }
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    let reply = client.native(1, 0, data(&[0x9C, 0, 0, 0, 0, 0, 0, 0]), Duration::ZERO).unwrap();
    assert_eq!(reply, [0x9C, 0x19, 0, 0, 0, 0, 0, 0]);
}

#[test]
fn a_native_command_may_take_as_long_as_a_motor_does() {
    let line = Scripted::new(|heard| match heard.request {
        Request::Native(_) => vec![],
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    let result = client.native(1, 0, data(&CURRENT), TTL);
    let Err(ClientError::NoAnswer { request: "Native", after }) = result else { panic!() };
    assert_eq!(after, MOTOR_DEADLINE);
}

#[test]
fn a_native_motion_is_renewed_well_within_its_time_to_live() {
    let times = Rc::new(RefCell::new(Vec::new()));
    let notes = times.clone();
    let line = Scripted::new(move |heard| {
        if let Request::Native(request) = &heard.request {
            assert!((94_000..=96_000).contains(&lead(request.expires_at_us, heard.time_us)));
            notes.borrow_mut().push(heard.time_us);
            if notes.borrow().len() == 3 {
                let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
                return vec![(2 * LATENCY, error_bytes(heard.sequence, &stale))];
            }
        }
        healthy(heard)
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    let hold = NativeHold { axis: 0, epoch: 7, data: data(&CURRENT), ttl: TTL };
    client.hold_native(&hold, Duration::from_secs(1), |_| Ok(ControlFlow::Continue(()))).unwrap();
    let times = times.borrow();
    assert!(times.len() >= 28, "{}", times.len());
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] < 50_000), "{times:?}");
}

#[test]
fn a_refused_native_motion_ends_its_hold() {
    let line = Scripted::new(|heard| match heard.request {
        Request::Native(_) => {
            let error = Error::StaleEpoch { axis: 0, current: 8 };
            vec![(2 * LATENCY, error_bytes(heard.sequence, &error))]
        }
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
    let hold = NativeHold { axis: 0, epoch: 7, data: data(&CURRENT), ttl: TTL };
    let held = client.hold_native(&hold, Duration::from_secs(1), |_| Ok(ControlFlow::Continue(())));
    assert!(matches!(held, Err(ClientError::Gateway(Error::StaleEpoch { axis: 0, current: 8 }))));
    let sent = line.sent_after_opening().len();
    assert!(sent <= 4, "the command, and a ping now and then: {sent}");
}

#[test]
fn a_native_command_waits_until_another_hosts_question_is_answered() {
    for (refusals, state, is_answered, sent) in [
        (3, AxisState::Idle, true, 4),
        (100, AxisState::Active, false, 5),
        (100, AxisState::Stopping, false, 1),
    ] {
        let mut asked = 0;
        let natives = Rc::new(RefCell::new(0));
        let counted = natives.clone();
        let line = Scripted::new(move |heard| match heard.request {
            Request::ReadState(_) => {
                let report = AxisReport {
                    axis: 1,
                    state,
                    epoch: None,
                    trip: None,
                    position_rad: None,
                    velocity_rad_s: None,
                    current_a: None,
                    voltage_v: None,
                    motor_temperature_c: None,
                    driver_temperature_c: None,
                    faults: None,
                    fault_record: None,
                    motor_timeout: MotorTimeout::Unknown,
                    standstill: None,
                    stop_acknowledged: false,
                };
                vec![(2 * LATENCY, reply_bytes(heard.sequence, &Reply::ReadState(report)))]
            }
            Request::Native(_) if asked < refusals => {
                asked += 1;
                *natives.borrow_mut() += 1;
                vec![(2 * LATENCY, error_bytes(heard.sequence, &Error::Busy { axis: 1 }))]
            }
            _ => {
                *natives.borrow_mut() += i32::from(matches!(heard.request, Request::Native(_)));
                healthy(heard)
            }
        });
        let mut client = Client::connect_as(line, 1, 0).unwrap();
        let reply =
            client.native_when_free(1, 0, data(&[0x9C, 0, 0, 0, 0, 0, 0, 0]), Duration::ZERO);
        match reply {
            Ok(_) => assert!(is_answered),
            Err(error) => {
                assert!(!is_answered, "{error}");
                assert!(matches!(error, ClientError::Gateway(Error::Busy { axis: 1 })), "{error}");
            }
        }
        assert_eq!(*counted.borrow(), sent, "{state:?}");
    }
}
