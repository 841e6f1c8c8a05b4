//! The dialect by the form of a motor's answers, with the bytes that such motors send
//! (docs/rmd-dialects.md).

use rmd::{Dialect, PROBES, Recognised, Request, is_echo_of_version, tells};

/// Gain, name, acceleration of one motor.
type Answers = [[u8; 8]; 3];

const V3_6: Answers = [
    [0x30, 0, 0x55, 0x19, 0x55, 0x19, 0x55, 0x19],
    [0xB5, b'X', b'8', b'S', b'2', b'V', b'1', b'0'],
    [0x42, 0, 0, 0, 0x88, 0x13, 0, 0],
];
const V3_9: Answers = [V3_6[0], V3_6[1], [0x42, 3, 0, 0, 0x88, 0x13, 0, 0]];
const V4_2: Answers = [[0x30, 1, 0, 0, 0, 0, 0, 0x3F], V3_6[1], V3_9[2]];
const V4_4: Answers = [V4_2[0], [0xB5, 1, 1, b'R', b'M', b'D', b'-', b'X'], V3_9[2]];

fn recognised(answers: &[[u8; 8]]) -> Recognised {
    let told: Vec<_> =
        answers.iter().filter_map(|answer| PROBES.iter().find_map(|p| tells(p, answer))).collect();
    Recognised::by(&told)
}

fn one_of(answers: &[[u8; 8]]) -> Vec<Dialect> {
    match recognised(answers) {
        Recognised::OneOf(some) => some.iter().collect(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_probes_read_in_every_dialect_with_the_bytes_of_the_manuals() {
    let bytes = PROBES.map(|probe| probe.encode().expect("a read"));
    let zeros = |head: [u8; 3]| [head[0], head[1], head[2], 0, 0, 0, 0, 0];
    assert_eq!(bytes, [zeros([0x30, 1, 0]), zeros([0xB5, 1, 1]), zeros([0x42, 3, 0])]);
    for (probe, bytes) in PROBES.iter().zip(bytes) {
        assert!(probe.only_reads() && Request::decode_in(Dialect::Unknown, &bytes) == *probe);
        // An older motor passes the index over.
        assert!(Request::decode(&bytes).only_reads(), "{bytes:02X?}");
    }
}

#[test]
fn a_motor_is_recognised_by_two_answers_that_fit_one_dialect() {
    assert_eq!(recognised(&V4_4), Recognised::As(Dialect::V4_4));
    assert_eq!(recognised(&V4_4[..2]), Recognised::As(Dialect::V4_4));
    assert_eq!(recognised(&V3_9), Recognised::As(Dialect::V3_9));
    // One answer is not enough, whatever it says.
    assert_eq!(one_of(&V4_4[1..2]), [Dialect::V4_4]);
}

/// No safe read tells V4.2 from V4.3, nor V3.6 from V3.7.
#[test]
fn what_cannot_be_told_apart_stays_unknown() {
    assert_eq!(one_of(&V4_2), [Dialect::V4_2, Dialect::V4_3]);
    assert_eq!(one_of(&V3_6), [Dialect::V3_6, Dialect::V3_7]);
    assert_eq!(recognised(&V4_2).dialect(), Dialect::Unknown);
    assert!(recognised(&V4_2).allows(Dialect::V4_3) && !recognised(&V4_2).allows(Dialect::V4_4));
    assert_eq!(recognised(&[]).dialect(), Dialect::Unknown);
}

#[test]
fn answers_that_contradict_each_other_fit_none() {
    let torn = recognised(&[V3_6[0], V4_4[1]]);
    assert_eq!((torn, torn.dialect()), (Recognised::Contradicted, Dialect::Unknown));
    assert!(torn.allows(Dialect::Unknown) && !torn.allows(Dialect::V4_4));
}

/// Echoes, the copy of another answer, another index, an empty name.
#[test]
fn what_is_no_answer_tells_nothing() {
    for bytes in [
        [0x30, 1, 0, 0, 0, 0, 0, 0],
        [0xB5, 1, 1, 0, 0, 0, 0, 0],
        [0x42, 3, 0, 0, 0, 0, 0, 0],
        [0x9A, 50, 0, 1, 0xE5, 1, 4, 0],
        [0x30, 4, 0, 0, 0, 0, 0, 0x3F],
        [0x30, 1, 0, 0, 0, 0, 0x80, 0x7F],
        [0x30, 1, 0, 0, 0, 0, 0, 0xBF],
        [0xB5, 1, 2, b'4', b'-', b'P', b'3', b'6'],
        [0xB5, 0, 0, 0, 0, 0, 0, 0],
        [0x42, 1, 0, 0, 0x88, 0x13, 0, 0],
    ] {
        assert!(PROBES.iter().all(|probe| tells(probe, &bytes).is_none()), "{bytes:02X?}");
    }
    assert!(is_echo_of_version(&[0xB2, 0, 0, 0, 0, 0, 0, 0]));
    assert!(!is_echo_of_version(&[0xB2, 0, 0, 0, 0x2E, 0x89, 0x34, 0x01]));
}
