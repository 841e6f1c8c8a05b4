use super::*;

const BAUD: u32 = 115_200;
const A: Station = Station::Motor(0);
const B: Station = Station::Motor(1);

fn line() -> SerialLine {
    let mut line = SerialLine::default();
    line.start(Station::Gateway, BAUD, true);
    line.start(A, BAUD, false);
    line.start(B, BAUD, false);
    line
}

fn run(line: &mut SerialLine) -> Vec<SerialOutcome> {
    let mut outcomes = Vec::new();
    while let Some(at) = line.next_event() {
        line.finish(at);
        outcomes.extend(std::iter::from_fn(|| line.poll()));
    }
    outcomes
}

/// What a station hears.
fn heard(outcomes: &[SerialOutcome], station: Station) -> Vec<u8> {
    outcomes
        .iter()
        .filter_map(|outcome| match outcome {
            SerialOutcome::Byte { value, to } if to.contains(&station) => Some(*value),
            _ => None,
        })
        .collect()
}

fn ends(outcomes: &[SerialOutcome]) -> Vec<(Station, u128)> {
    outcomes
        .iter()
        .filter_map(|outcome| match outcome {
            SerialOutcome::Sent { from, end, .. } => Some((*from, end.as_nanos())),
            SerialOutcome::Byte { .. } => None,
        })
        .collect()
}

/// 13 bytes of 10 bits at 115200 baud are 1128.472 µs.
#[test]
fn a_frame_of_13_bytes_takes_130_bits() {
    let mut line = line();
    let frame = [0x3E, 0x01, 0x08, 0x9C, 0, 0, 0, 0, 0, 0, 0, 0xF2, 0x30];
    line.send(Duration::ZERO, Station::Gateway, 0, frame.to_vec());
    let outcomes = run(&mut line);
    assert_eq!(ends(&outcomes), [(Station::Gateway, 1_128_472)]);
    assert_eq!(heard(&outcomes, A), frame);
    assert_eq!(heard(&outcomes, Station::Gateway), frame, "local echo");
}

#[test]
fn without_echo_a_sender_hears_nothing_of_its_own() {
    let mut line = line();
    line.send(Duration::ZERO, A, 0, vec![1, 2]);
    let outcomes = run(&mut line);
    assert_eq!(heard(&outcomes, A), []);
    assert_eq!(heard(&outcomes, B), [1, 2]);
}

#[test]
fn messages_of_one_station_follow_each_other() {
    let mut line = line();
    line.send(Duration::ZERO, Station::Gateway, 0, vec![1]);
    line.send(Duration::ZERO, Station::Gateway, 1, vec![2]);
    assert_eq!(ends(&run(&mut line)), [(Station::Gateway, 86_806), (Station::Gateway, 173_612)]);
}

/// Two talkers half a byte apart: the bytes of the later one are lost, those of the first garbled.
#[test]
fn overlapping_bytes_are_garbled() {
    let mut line = line();
    line.send(Duration::ZERO, Station::Gateway, 0, vec![0xFF, 0xFF]);
    line.finish(Duration::from_micros(40));
    line.send(Duration::from_micros(40), A, 0, vec![0xF0, 0x0F]);
    let outcomes = run(&mut line);
    // First byte: against A's first. Second: against both of A's. A's last byte overlaps the
    // gateway's second.
    assert_eq!(heard(&outcomes, B), [0xF0, 0x00]);
    assert_eq!(heard(&outcomes, Station::Gateway), [0xF0, 0x00]);
}

#[test]
fn a_cut_line_still_echoes() {
    let mut line = line();
    line.set_fault(BusFault::Cut);
    line.send(Duration::ZERO, Station::Gateway, 0, vec![0x3E]);
    let outcomes = run(&mut line);
    assert_eq!(heard(&outcomes, Station::Gateway), [0x3E]);
    assert_eq!(heard(&outcomes, A), []);
}

#[test]
fn a_shorted_line_reads_as_zeros() {
    let mut line = line();
    line.set_fault(BusFault::Short);
    line.send(Duration::ZERO, Station::Gateway, 0, vec![0x3E]);
    let outcomes = run(&mut line);
    assert_eq!(heard(&outcomes, Station::Gateway), [0x00]);
    assert_eq!(heard(&outcomes, A), []);
}

#[test]
fn another_baud_rate_is_deaf() {
    let mut line = line();
    line.start(Station::Gateway, 500_000, false);
    line.send(Duration::ZERO, Station::Gateway, 0, vec![0x3E]);
    let outcomes = run(&mut line);
    assert_eq!(heard(&outcomes, A), []);
    assert_eq!(ends(&outcomes), [(Station::Gateway, 20_000)]);
}
