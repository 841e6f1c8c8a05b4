//! RMD frames on CAN and, with the same data, on RS485.

use core::array::TryFromSliceError;

use codec_testing::numbers_of;
use host_protocol::CanFrame;
use rmd::{Answer, Dialect, Reply, Request, Target, answer, answer_on_line, can, rs485};

use crate::frames::Input;

pub fn check(bytes: &[u8]) {
    let Some(Input { frame, data, pending, .. }) = Input::of(bytes) else { return };
    let pending = Request::decode(&pending);
    match can::decode_any_request(&frame) {
        Ok((target, request)) => {
            check_request(target, &request);
            if let Ok((_, reply)) = can::decode_reply(&frame) {
                check_answer(&request, &reply);
            }
        }
        Err(error) => _ = error.to_string(),
    }
    match can::decode_reply(&frame) {
        Ok((node, reply)) => {
            check_answer(&pending, &reply);
            let encoded =
                can::reply::<CanFrame>(node, &reply).map(|frame| can::decode_reply(&frame));
            match encoded {
                Ok(again) => assert_eq!(again, Ok((node, reply))),
                Err(error) => _ = error.to_string(),
            }
            _ = reply.name();
            _ = numbers_of(|visit| reply.visit_fields(visit));
        }
        Err(error) => _ = error.to_string(),
    }
    if let Ok(data) = data_of(&frame) {
        Dialect::ALL.into_iter().for_each(|dialect| check_dialect(dialect, data));
    }
    check_serial(bytes.first().copied().unwrap_or(0), data, &pending);
}

fn data_of(frame: &CanFrame) -> Result<&[u8; 8], TryFromSliceError> {
    frame.data().try_into()
}

/// No bytes make a dialect panic, and what one sends it reads again.
fn check_dialect(dialect: Dialect, data: &[u8; 8]) {
    let request = Request::decode_in(dialect, data);
    if let Ok(again) = request.encode_in(dialect) {
        assert_eq!(Request::decode_in(dialect, &again), request);
        assert!(Request::dialects_of(&again).contains(dialect));
    }
    if let Ok(reply) = Reply::decode_in(dialect, data) {
        _ = (answer(&request, &reply), reply.encode());
        _ = numbers_of(|visit| reply.visit_fields(visit));
    }
}

fn check_request(target: Target, request: &Request) {
    if let Ok(data) = request.encode()
        && Request::decode(&data) == *request
    {
        assert_eq!(Request::decode(&data).encode(), Ok(data));
    }
    let encoded: Result<CanFrame, _> = match target {
        Target::Node(node) => can::request(node, request),
        Target::All => can::broadcast(request),
    };
    match encoded {
        Ok(frame) => assert_eq!(can::decode_any_request(&frame), Ok((target, *request))),
        Err(error) => _ = error.to_string(),
    }
    let fields = numbers_of(|visit| request.visit_fields(visit));
    // The words of motion mode are converted by other divisors one way than the other (RMD V3.6
    // §5.4).
    if request.encode().is_ok()
        && !matches!(request, Request::Unknown { .. } | Request::MotionMode { .. })
    {
        let built = Request::build(request.name(), &|name| fields.get(name).copied());
        assert_eq!(built, Ok(*request));
    }
}

fn check_answer(request: &Request, reply: &Reply) {
    let answered = answer(request, reply);
    match answered {
        Answer::Reply(answer) => {
            assert_eq!(answer, *reply);
            assert!(request.is_answered());
            assert!(!reply.is_event());
        }
        Answer::NotExecuted => {
            if let (Ok(sent), Ok(received)) = (request.encode(), reply.encode()) {
                assert_eq!(sent, received);
            }
        }
        Answer::Echo => panic!("an echo that is not due"),
        Answer::Unsolicited => assert!(reply.is_event() || matches!(reply, Reply::Status1 { .. })),
        Answer::Unrelated => {}
    }
    assert_eq!(answer_on_line(request, reply, false), answered);
}

fn check_serial(id: u8, data: [u8; 8], pending: &Request) {
    let frame = serial_frame(id, data);
    match rs485::decode_any_request(&frame) {
        Ok((target, request)) => {
            let encoded = match target {
                Target::Node(node) => rs485::request(node, &request),
                Target::All => rs485::broadcast(&request),
            };
            if let Ok(frame) = encoded {
                assert_eq!(rs485::decode_any_request(&frame), Ok((target, request)));
                check_own_echo(&frame, &request);
            }
        }
        Err(error) => _ = error.to_string(),
    }
    match rs485::decode_reply(&frame) {
        Ok((node, reply)) => {
            check_answer(pending, &reply);
            if let Ok(frame) = rs485::reply(node, &reply) {
                assert_eq!(rs485::decode_reply(&frame), Ok((node, reply)));
            }
        }
        Err(error) => _ = error.to_string(),
    }
}

/// What we send and hear back is never taken for the motor's answer.
fn check_own_echo(sent: &[u8; rs485::FRAME_LEN], request: &Request) {
    if let Ok((_, heard)) = rs485::decode_reply(sent) {
        assert_eq!(answer_on_line(request, &heard, true), Answer::Echo);
    }
}

/// A frame with the right checksum, made apart from the codec (RMD V3.6 §1.2.2).
pub fn serial_frame(id: u8, data: [u8; 8]) -> [u8; rs485::FRAME_LEN] {
    let mut frame = [0; rs485::FRAME_LEN];
    frame[..3].copy_from_slice(&[0x3E, id, 8]);
    frame[3..11].copy_from_slice(&data);
    let checksum = crc16_modbus(&frame[..11]);
    frame[11..].copy_from_slice(&checksum.to_le_bytes());
    frame
}

/// CRC-16/MODBUS, bit by bit.
pub fn crc16_modbus(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, byte| {
        (0..8).fold(
            crc ^ u16::from(*byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 },
        )
    })
}
