//! The cycle of eight axes that PROTOCOL.md shows byte by byte, out and back, against the code.

use host_protocol::{
    AxisState, Bytes, CycleResult, CycleState, FixedU32, MAX_FRAME, Reply, Request, Setpoint,
    StateField, StateFields, Vec as List, replies, requests,
};

const REFERENCE: &str = include_str!("../../../PROTOCOL.md");
const SEQUENCE: u16 = 0x1234;
const TIME: FixedU32 = FixedU32(0x89AB_CDEF);
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);

/// The bytes of a block of the section on the cycle: what stands in pairs of digits before the
/// words of each line.
fn shown(block: usize) -> Vec<u8> {
    let (_, section) = REFERENCE.split_once("\n### The cycle\n").unwrap();
    let (section, _) = section.split_once("\n### ").unwrap();
    let block = section.split("```").nth(2 * block + 1).unwrap();
    let byte = |word: &str| u8::from_str_radix(word, 16).ok().filter(|_| word.len() == 2);
    let bytes = |line: &'static str| {
        let words = line.split_whitespace().filter(|word| *word != "|");
        words.map_while(byte)
    };
    block.lines().flat_map(bytes).collect()
}

#[test]
fn the_request_of_eight_axes_is_the_one_shown_and_takes_64_bytes() {
    let velocity = Setpoint::Velocity { velocity_rad_s: 2.0 };
    let request = Request::Cycle(requests::Cycle {
        epoch: FixedU32(0xDEAD_BEEF),
        expires_at_us: TIME,
        fields: FIELDS,
        axes: 0xFF,
        setpoints: List::from_iter([velocity; 8]),
    });
    let mut out = [0; MAX_FRAME];
    let length = request.encode_frame(SEQUENCE, &mut out).unwrap();
    assert_eq!(out[..length], shown(0));
    assert!(length <= 64, "{length}");
}

#[test]
fn its_answer_is_the_one_shown_and_takes_at_most_128_bytes() {
    let mut report =
        replies::CycleReport { time_us: TIME, fields: FIELDS, axes: 0, states: Bytes::new() };
    for axis in 0..8 {
        report.push(CycleState {
            axis,
            state: AxisState::Active,
            result: CycleResult::Answered,
            age_us: 1_500,
            position_rad: Some(core::f32::consts::PI),
            velocity_rad_s: Some(-20.0),
            current_a: Some(12.5),
            voltage_v: None,
            motor_temperature_c: None,
            driver_temperature_c: None,
            faults: None,
        });
    }
    let mut out = [0; MAX_FRAME];
    let length = Reply::Cycle(report).encode_frame(SEQUENCE, &mut out).unwrap();
    assert_eq!(out[..length], shown(1));
    assert!(length <= 128, "{length}");
}
