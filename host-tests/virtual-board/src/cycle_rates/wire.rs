//! What a bus has carried: frames on CAN, messages on RS485.

use std::collections::BTreeMap;
use std::time::Duration;

use virtual_stm32::fdcan::{FrameEnd, FrameRecord, Sender};

use super::situation::{GAP_BITS, INTERMISSION_BITS, Motors};
use crate::nodes::since_start;
use crate::rs485_line::{Reply, SentByte, messages};

/// The part of an id that tells motors of a bus from each other.
const NODE: u32 = 0xF;
/// Where a message on RS485 has its node (RMD V3.6 §4), and the eight bytes that are those of a
/// frame.
const NODE_AT: usize = 1;
const DATA_AT: std::ops::Range<usize> = 3..11;

/// A frame or a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Passage {
    pub(super) begin: Duration,
    pub(super) end: Duration,
    /// The gateway has sent it.
    is_ours: bool,
    /// It has arrived, and is a setpoint.
    is_setpoint: bool,
    /// The motor that it is for or from; on RS485 that of the last request.
    node: Option<u32>,
}

/// Frames of a CAN bus.
pub(super) fn of_frames(frames: &[FrameRecord], motors: Motors) -> Vec<Passage> {
    let passage = |record: &FrameRecord| Passage {
        begin: since_start(record.start),
        end: since_start(record.end),
        is_ours: record.sender == Sender::Controller,
        is_setpoint: record.sender == Sender::Controller
            && record.outcome == FrameEnd::Acknowledged
            && motors.is_setpoint(record.frame.payload()),
        node: Some(record.frame.id.value() & NODE),
    };
    frames.iter().map(passage).collect()
}

/// Messages on RS485: bytes without a pause between them, and what motors have sent.
pub(super) fn of_line(sent: &[SentByte], replies: &[Reply], motors: Motors) -> Vec<Passage> {
    let request = |message: &[SentByte]| {
        let bytes: Vec<u8> = message.iter().map(|sent| sent.byte).collect();
        Passage {
            begin: message[0].first_bit,
            end: message[message.len() - 1].end,
            is_ours: true,
            is_setpoint: bytes.get(DATA_AT).is_some_and(|data| motors.is_setpoint(data)),
            node: bytes.get(NODE_AT).copied().map(u32::from),
        }
    };
    let reply = |reply: &Reply| Passage {
        begin: reply.first_bit,
        end: reply.end,
        is_ours: false,
        is_setpoint: false,
        node: None,
    };
    let requests = messages(sent).map(request);
    let mut passages: Vec<Passage> = requests.chain(replies.iter().map(reply)).collect();
    passages.sort_by_key(|passage| passage.begin);
    passages
}

/// What a bus was used for.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Use {
    /// Nanoseconds in which it carried something, with what lies between two frames.
    pub(super) busy: u64,
    /// Those of setpoints and the replies to them.
    pub(super) exchanges_took: u64,
    /// How often each motor has answered one.
    pub(super) answered: BTreeMap<u32, u64>,
    /// Nanoseconds that the bus was free ahead of each request.
    pub(super) gaps: Vec<u64>,
}

impl Use {
    pub(super) fn of(passages: &[Passage], is_can: bool, bitrate: u32) -> Self {
        let nanos = |bits: u32| u64::from(bits) * 1_000_000_000 / u64::from(bitrate);
        let between = if is_can { nanos(INTERMISSION_BITS) } else { 0 };
        let rest = if is_can { between } else { nanos(GAP_BITS) };
        let mut found = Self::default();
        let mut asked = BTreeMap::new();
        let mut last_asked = None;
        for passage in passages {
            let takes = length(passage) + between;
            found.busy += takes;
            if passage.is_ours {
                last_asked = passage.node;
                asked.insert(passage.node, passage.is_setpoint.then_some(takes));
            } else {
                let node = passage.node.or(last_asked);
                if let (Some(request), Some(node)) = (asked.remove(&node).flatten(), node) {
                    found.exchanges_took += request + takes;
                    *found.answered.entry(node).or_insert(0) += 1;
                }
            }
        }
        let pairs = passages.windows(2).filter(|pair| pair[1].is_ours);
        let free = |pair: &[Passage]| {
            let free = pair[1].begin.saturating_sub(pair[0].end);
            u64::try_from(free.as_nanos()).expect("short").saturating_sub(rest)
        };
        found.gaps = pairs.map(free).collect();
        found
    }
}

fn length(passage: &Passage) -> u64 {
    u64::try_from((passage.end - passage.begin).as_nanos()).expect("short")
}

/// Median, the 99th of 100, and the greatest; nothing of nothing.
pub(super) fn distribution(mut values: Vec<u64>) -> Option<[u64; 3]> {
    values.sort_unstable();
    let last = values.len().checked_sub(1)?;
    Some([values[last / 2], values[(values.len() * 99).div_ceil(100) - 1], values[last]])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn passage(begin: u64, end: u64, node: Option<u32>, is_ours: bool) -> Passage {
        let [begin, end] = [begin, end].map(Duration::from_micros);
        Passage { begin, end, is_ours, is_setpoint: is_ours, node }
    }

    /// At 1 Mbit/s, so that a bit is a microsecond: two motors are asked, the second reply comes
    /// behind that to something else.
    #[test]
    fn replies_belong_to_their_requests_and_gaps_end_with_ours() {
        let poll = Passage { is_setpoint: false, ..passage(430, 540, Some(1), true) };
        let passages = [
            passage(0, 110, Some(1), true),
            passage(113, 220, Some(1), false),
            passage(230, 340, Some(2), true),
            poll,
            passage(543, 650, Some(2), false),
            passage(660, 770, Some(1), false),
        ];
        let found = Use::of(&passages, true, 1_000_000);
        assert_eq!(found.answered, BTreeMap::from([(1, 1), (2, 1)]));
        assert_eq!(found.exchanges_took, (110 + 107 + 110 + 107 + 4 * 3) * 1_000);
        assert_eq!(found.busy, found.exchanges_took + (110 + 110 + 2 * 3) * 1_000);
        assert_eq!(found.gaps, [7_000, 87_000]);
    }

    /// On a line a reply is of whoever was asked last; 20 bits between two messages must be.
    #[test]
    fn a_reply_on_a_line_is_to_the_last_request() {
        let passages = [
            passage(0, 130, Some(3), true),
            passage(140, 270, None, false),
            passage(300, 430, Some(4), true),
        ];
        let found = Use::of(&passages, false, 1_000_000);
        assert_eq!(found.answered, BTreeMap::from([(3, 1)]));
        assert_eq!((found.busy, found.gaps), (390_000, vec![10_000]));
    }

    #[test]
    fn a_distribution_is_of_values_that_were_there() {
        assert_eq!(distribution((1..=100).rev().collect()), Some([50, 99, 100]));
        assert_eq!(distribution(vec![7]), Some([7, 7, 7]));
        assert_eq!(distribution(Vec::new()), None);
    }
}
