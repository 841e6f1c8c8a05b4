use super::*;
use crate::motion_mode::{MotionCommand, MotionFeedback};
use crate::units::{Centiamps, Milliseconds};

#[track_caller]
fn of(request: [u8; 8], received: [u8; 8]) -> Answer {
    answer(&Request::decode(&request), &Reply::decode_full(&received))
}

#[track_caller]
fn is_reply(request: [u8; 8], received: [u8; 8]) {
    assert_eq!(of(request, received), Answer::Reply(Reply::decode_full(&received)));
}

/// RMD V3.6 §2.11.4 to §2.20.4: the printed pairs.
#[test]
fn replies_answer_their_requests() {
    is_reply([0x92, 0, 0, 0, 0, 0, 0, 0], [0x92, 0, 0, 0, 0xA0, 0x8C, 0, 0]);
    is_reply([0x9A, 0, 0, 0, 0, 0, 0, 0], [0x9A, 0x32, 0, 0x01, 0xE5, 0x01, 0x04, 0]);
    is_reply([0x9C, 0, 0, 0, 0, 0, 0, 0], [0x9C, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
    is_reply([0xA1, 0, 0, 0, 0x64, 0, 0, 0], [0xA1, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
    is_reply([0xA2, 0, 0, 0, 0x10, 0x27, 0, 0], [0xA2, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
    is_reply([0xA4, 0, 0xF4, 0x01, 0xA0, 0x8C, 0, 0], [0xA4, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
}

/// RMD V3.6 §2.15.3, §2.16.3, §2.26.3, §2.27.3: for these the echo is the answer.
#[test]
fn echoes_answer_stops_and_brake() {
    for command in [0x80, 0x81, 0x77, 0x78] {
        is_reply([command, 0, 0, 0, 0, 0, 0, 0], [command, 0, 0, 0, 0, 0, 0, 0]);
    }
}

/// A query of a cold motor at rest is answered with the query's bytes.
#[test]
fn a_status_of_zeros_is_a_reply() {
    is_reply([0x92, 0, 0, 0, 0, 0, 0, 0], [0x92, 0, 0, 0, 0, 0, 0, 0]);
    is_reply([0x9C, 0, 0, 0, 0, 0, 0, 0], [0x9C, 0, 0, 0, 0, 0, 0, 0]);
}

/// The bytes of RMD V3.6 §2.17.4, §2.18.4, §2.20.4 and §2.22.4 thrown back.
#[test]
fn a_closed_loop_command_thrown_back_was_not_executed() {
    for data in [
        [0xA1, 0x00, 0x00, 0x00, 0x64, 0x00, 0x00, 0x00],
        [0xA2, 0x00, 0x00, 0x00, 0xF0, 0xD8, 0xFF, 0xFF],
        [0xA4, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00],
        [0xA8, 0x00, 0xF4, 0x01, 0xA0, 0x8C, 0x00, 0x00],
    ] {
        assert_eq!(of(data, data), Answer::NotExecuted);
    }
}

/// Bytes 6 and 7 read as an angle of −32768, which cannot be encoded, must not hide that they were
/// thrown back.
#[test]
fn thrown_back_with_an_angle_beyond_the_range() {
    let data = [0xA2, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x80];
    assert_eq!(of(data, data), Answer::NotExecuted);
}

/// Zero current and zero speed: the state of a motor at 0 °C, at rest, at its zero point has the
/// same bytes.
#[test]
fn all_zero_counts_as_a_reply() {
    for command in [0xA1, 0xA2, 0xA4, 0xA8] {
        is_reply([command, 0, 0, 0, 0, 0, 0, 0], [command, 0, 0, 0, 0, 0, 0, 0]);
    }
}

/// RMD V3.6 §2.30.3 and §2.30.4 example 2; another timeout is the answer to an earlier request.
#[test]
fn timeout_is_answered_by_echo_or_zero() {
    let request = [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0];
    is_reply(request, [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0]);
    is_reply(request, [0xB3, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(of(request, [0xB3, 0, 0, 0, 0xE9, 0x03, 0, 0]), Answer::Unrelated);
    let off = Request::SetCommunicationTimeout { timeout: Milliseconds(0) };
    let reply = Reply::CommunicationTimeout { timeout: Milliseconds(1000) };
    assert_eq!(answer(&off, &reply), Answer::Unrelated);
}

#[test]
fn other_commands_answer_nothing() {
    let request = Request::TorqueCurrent { current: Centiamps(100) };
    let status = Reply::decode_full(&[0x9C, 0x32, 0x64, 0, 0xF4, 0x01, 0x2D, 0]);
    assert_eq!(answer(&request, &status), Answer::Unrelated);
    assert_eq!(answer(&Request::Stop, &Reply::Shutdown), Answer::Unrelated);
}

/// A command without a variant is matched by its code.
#[test]
fn unknown_commands_are_matched_by_code() {
    is_reply([0x90, 0, 0, 0, 0, 0, 0, 0], [0x90, 0x32, 0xC2, 0x0B, 0x10, 0xFA, 0xC0, 0xF9]);
    assert_eq!(of([0x90, 0, 0, 0, 0, 0, 0, 0], [0x70, 0, 0, 0, 0, 0, 0, 1]), Answer::Unrelated);
}

/// RMD V3.6 §2.2.3, §2.3.3, §2.5.3, §2.9.3, §2.33.3: the answer is the request; other contents
/// answer an earlier one.
#[test]
fn writes_are_answered_by_their_echo_alone() {
    let writes = [
        [0x31, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
        [0x32, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
        [0x43, 0x02, 0, 0, 0x10, 0x27, 0, 0],
        [0x63, 0, 0, 0, 0x10, 0x27, 0, 0],
        [0x20, 0x02, 0, 0, 1, 0, 0, 0],
    ];
    for write in writes {
        is_reply(write, write);
        let mut other = write;
        other[4] ^= 1;
        assert_eq!(of(write, other), Answer::Unrelated, "{write:02X?}");
    }
    assert_eq!(
        of([0x43, 2, 0, 0, 0x10, 0x27, 0, 0], [0x43, 3, 0, 0, 0x10, 0x27, 0, 0]),
        Answer::Unrelated
    );
}

/// RMD V3.6 §2.25.3, §2.31.3: no reply to 0x76, a random one to 0xB4.
#[test]
fn nothing_answers_a_reset_or_a_change_of_rate() {
    assert_eq!(of([0x76, 0, 0, 0, 0, 0, 0, 0], [0x76, 0, 0, 0, 0, 0, 0, 0]), Answer::Unrelated);
    assert_eq!(of([0xB4, 0, 0, 0, 0, 0, 0, 1], [0xB4, 0, 0, 0, 0, 0, 0, 1]), Answer::Unrelated);
    assert!(!Request::Reset.is_answered());
    assert!(!Request::decode(&[0xB4, 0, 0, 0, 0, 0, 0, 1]).is_answered());
    assert!(Request::Stop.is_answered());
}

/// RMD V3.6 §2.33.4 index 3: 0x9A every 100 ms while a fault stands; the answer to a 0x9A only
/// while one is pending.
#[test]
fn fault_reports_and_notices_are_unsolicited() {
    let faulty = [0x9A, 0x32, 0, 0x01, 0xE5, 0x01, 0x04, 0x00];
    assert_eq!(of([0xA1, 0, 0, 0, 0x64, 0, 0, 0], faulty), Answer::Unsolicited);
    is_reply([0x9A, 0, 0, 0, 0, 0, 0, 0], faulty);
    let healthy = [0x9A, 0x32, 0, 0x01, 0xE5, 0x01, 0x00, 0x00];
    assert_eq!(of([0xA1, 0, 0, 0, 0x64, 0, 0, 0], healthy), Answer::Unrelated);
    for request in [[0x9C, 0, 0, 0, 0, 0, 0, 0], [0xF1, 0, 0, 0, 0, 0, 0, 0]] {
        assert_eq!(of(request, [0xF1, 0, 0, 0, 0, 0, 0, 0]), Answer::Unsolicited);
    }
}

/// RMD V3.6 §4.3, §7.3: the new id is confirmed from the new id.
#[test]
fn id_commands() {
    let node = |id| Node::new(id).expect("1..=32");
    let set = Request::SetCanId { id: 2 };
    let reply = Reply::CanIdSet { id: node(2) };
    assert_eq!(answer(&set, &reply), Answer::Reply(reply));
    assert_eq!(answer(&set, &Reply::CanIdSet { id: node(3) }), Answer::Unrelated);
    assert_eq!(answer(&set, &Reply::Rs485IdSet { id: node(2) }), Answer::Unrelated);
    assert_eq!(set.answering_node(node(1)), Some(node(2)));

    let reply = Reply::Rs485Id { id: node(7) };
    assert_eq!(answer(&Request::ReadRs485Id, &reply), Answer::Reply(reply));
    assert_eq!(answer(&Request::ReadCanId, &reply), Answer::Unrelated);
    assert_eq!(Request::ReadRs485Id.answering_node(node(1)), None);
    assert_eq!(Request::Stop.answering_node(node(1)), Some(node(1)));

    let stray = Reply::decode_full(&[0x79, 0, 1, 0, 0, 0, 0x42, 0x02]);
    assert_eq!(answer(&Request::ReadCanId, &stray), Answer::Unrelated);
}

/// RMD V3.6 §5.4: motion mode is answered under its own id only, whatever its bytes look like.
#[test]
fn motion_mode() {
    let request = Request::MotionMode { command: MotionCommand::NEUTRAL };
    let reply = Reply::MotionMode {
        feedback: MotionFeedback { id: 1, position: 0xE665, velocity: 0x82E, torque: 0xB55 },
    };
    assert_eq!(answer(&request, &reply), Answer::Reply(reply));
    assert_eq!(answer(&request, &Reply::Shutdown), Answer::Unrelated);
    assert_eq!(answer(&request, &Reply::Unknown { data: [0; 8] }), Answer::Unrelated);
    assert_eq!(answer(&Request::Unknown { data: [0; 8] }, &reply), Answer::Unrelated);
}

/// RMD V3.6 §7.4: both directions carry the same id on RS485, so our own stop looks like its
/// confirmation.
#[test]
fn our_own_bytes_confirm_nothing() {
    assert_eq!(answer_on_line(&Request::Stop, &Reply::Stop, true), Answer::Echo);
    assert_eq!(answer_on_line(&Request::Stop, &Reply::Stop, false), Answer::Reply(Reply::Stop));
    let torque = Request::TorqueCurrent { current: Centiamps(100) };
    let back = Reply::decode_full(&[0xA1, 0, 0, 0, 0x64, 0, 0, 0]);
    assert_eq!(answer_on_line(&torque, &back, true), Answer::Echo);
    assert_eq!(answer_on_line(&torque, &back, false), Answer::NotExecuted);
    assert_eq!(answer_on_line(&Request::Stop, &Reply::Shutdown, true), Answer::Unrelated);
}
