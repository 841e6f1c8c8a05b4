use gateway::Instant;
use host_protocol::{CanFrame, RawFrame};

use super::*;

fn at(us: u64) -> Instant {
    Instant::from_micros(us)
}

fn can(id: u16, data: &[u8]) -> RawFrame {
    RawFrame::Can(CanFrame::standard(id, data).expect("a frame"))
}

fn serial(bytes: &[u8]) -> RawFrame {
    RawFrame::Serial(bytes.iter().copied().collect())
}

/// RMD V3.6 §2.33.2: an angle is asked for; the third byte from the end differs by reply.
const ANGLE: [u8; 8] = [0x92, 0, 0, 0, 0, 0, 0, 0];
/// §2.12: status 2.
const STATUS: [u8; 8] = [0x9C, 0, 0, 0, 0, 0, 0, 0];

fn angle(low: u8) -> RawFrame {
    can(0x241, &[0x92, 0, 0, 0, low, 0, 0, 0])
}

/// An angle is asked for at 1 and 21 ms, and answered 300 µs later; a status at 41 ms, and not.
fn asked() -> Answers {
    let mut answers = Answers::default();
    for (us, reply) in [(1_000, angle(1)), (21_000, angle(2))] {
        answers.asked(at(us), can(0x141, &ANGLE));
        assert!(answers.came(at(us + 300), &reply));
    }
    answers.asked(at(41_000), can(0x141, &STATUS));
    answers
}

#[test]
fn a_request_has_the_reply_of_its_kind_at_about_that_time() {
    let answers = asked();
    let reply = |us| {
        let Reply { frame, told } = answers.reply_to(&can(0x141, &ANGLE), us).expect("a reply");
        assert_eq!(told, &[(300, 0)]);
        frame
    };
    assert_eq!(reply(0), &angle(1));
    assert_eq!(reply(10_999), &angle(1));
    assert_eq!(reply(11_001), &angle(2));
    assert_eq!(reply(90_000), &angle(2));
    // Of another motor nothing is known, and of a status that it was not answered.
    assert_eq!(answers.reply_to(&can(0x142, &ANGLE), 1_000), None);
    assert_eq!(answers.reply_to(&can(0x141, &STATUS), 1_000), None);
}

#[test]
fn what_comes_unasked_or_late_answers_nothing() {
    let mut answers = asked();
    assert!(!answers.came(at(41_300), &angle(3)), "all of these have been answered");
    let status = can(0x241, &[0x9C, 0x20, 0, 0, 0, 0, 0, 0]);
    assert!(!answers.clone().came(at(141_001), &status), "100 ms");
    assert!(answers.came(at(141_000), &status));
}

#[test]
fn bytes_of_a_line_are_one_reply_until_it_is_whole() {
    // RMD V3.6 §2.16, stop, as the request and its reply are on RS485.
    let stop = [0x3E, 0x01, 0x08, 0x81, 0, 0, 0, 0, 0, 0, 0, 0x32, 0xA5];
    let mut answers = Answers::default();
    assert!(!answers.bytes_came(at(900), &stop[..1]), "nothing was asked");
    answers.asked(at(1_000), serial(&stop));
    assert!(answers.bytes_came(at(1_500), &stop[..5]));
    assert!(answers.bytes_came(at(2_300), &stop[5..]));
    assert!(!answers.bytes_came(at(2_400), &[0x55]), "noise behind it");
    let reply = Reply { frame: serial(&stop), told: vec![(500, 5), (1_300, 13)] };
    assert_eq!(answers.reply_to(&serial(&stop), 1_000), Some(&reply));
    // 5 bytes of 10 bits by 500 µs, 13 by 1300: the first piece says more about the begin.
    let script = Script { answers: answers.clone(), zero_ns: 0 };
    let begin = |bit_ns: u64| {
        let now = VirtualNanos(1_000_000);
        script.reply_to(&serial(&stop), now, bit_ns * 1_000).expect("a reply").0.0 - now.0
    };
    assert_eq!(begin(1_000), 435_000);
    // The last is told of when seven bits more have passed.
    assert_eq!(begin(9_200), 1_300_000 - 137 * 9_200 - 15_000);
    answers.asked(at(50_000), serial(&stop));
    assert!(!answers.bytes_came(at(70_001), &stop), "20 ms");
}

#[test]
fn registers_of_a_d5_are_kinds() {
    let mut answers = Answers::default();
    let read = |register| can(0x00B, &[0xD5, 0x0B, 0x04, 0x02, register, 0, 0, 0]);
    answers.asked(at(1_000), read(0x12));
    assert!(is_same_kind(&read(0x12), &read(0x12)));
    assert!(!is_same_kind(&read(0x12), &read(0x28)));
}
