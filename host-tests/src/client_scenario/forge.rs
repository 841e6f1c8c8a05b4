//! Answers that no gateway gives.

use host_protocol::replies::Pong;
use host_protocol::requests::Ping;
use host_protocol::{Call, Deframer, Event, Kind, MAX_FRAME, encode};
use serde::ser::{Serialize, SerializeTuple, Serializer};

use super::action::Hostile;

/// Events in a piece of an endless stream.
const EVENTS_AT_ONCE: u16 = 20;
/// Bytes in a piece of an endless stream.
const NOISE_AT_ONCE: usize = 600;

/// The frame that is sent in place of one of the gateway's; `None`: that itself.
pub fn forge(
    hostile: Option<Hostile>,
    frame: &[u8],
    random: &mut fastrand::Rng,
) -> Option<Vec<u8>> {
    let mut deframer = Deframer::new();
    for byte in frame {
        let Some(Ok(frame)) = deframer.push(*byte) else { continue };
        if frame.kind != Kind::Reply {
            return None;
        }
        return match hostile? {
            Hostile::Pong(time_us) if frame.number == Ping::NUMBER => {
                Some(written(frame.sequence, frame.number, &Pong { time_us }))
            }
            Hostile::Bodies(part) => {
                let mut body = frame.body.to_vec();
                for byte in &mut body {
                    if random.f64() < part {
                        *byte = random.u8(..);
                    }
                }
                Some(written(frame.sequence, frame.number, &Body(&body)))
            }
            _ => None,
        };
    }
    None
}

/// A piece of an endless stream.
pub fn flood(hostile: Option<Hostile>, random: &mut fastrand::Rng) -> Vec<u8> {
    if hostile == Some(Hostile::Noise) {
        return (0..NOISE_AT_ONCE).map(|_| random.u8(..)).collect();
    }
    let mut bytes = Vec::new();
    for sequence in 0..EVENTS_AT_ONCE {
        let mut frame = [0; MAX_FRAME];
        let length = Event::EStopCleared {}.encode_frame(sequence, 0, 0, &mut frame).unwrap_or(0);
        bytes.extend_from_slice(frame.get(..length).unwrap_or_default());
    }
    bytes
}

fn written(sequence: u16, number: u16, body: &impl Serialize) -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Reply, sequence, number, body, &mut frame).unwrap_or(0);
    frame.get(..length).unwrap_or_default().to_vec()
}

/// A body as it stands on the wire.
struct Body<'a>(&'a [u8]);

impl Serialize for Body<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}
