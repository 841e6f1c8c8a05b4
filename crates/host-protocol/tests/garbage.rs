//! Whatever a body holds: decoding ends with a value that can be sent, or with an error.

use host_protocol::{ERRORS, EVENTS, Error, EventMessage, MAX_FRAME, REQUESTS, Reply, Request};

/// Random bodies for each message of the tables.
const BODIES: usize = 2_000;
/// Longest of them, bytes.
const LONGEST: usize = 96;

/// xorshift32, the same bytes in each run.
struct Random(u32);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Small bytes come often, since they pass for variants and lengths.
    fn byte(&mut self) -> u8 {
        let [low, choice, ..] = self.next().to_le_bytes();
        if choice & 1 == 0 { low & 0x07 } else { low }
    }

    fn body(&mut self) -> Vec<u8> {
        let length = self.next() as usize % LONGEST;
        (0..length).map(|_| self.byte()).collect()
    }
}

#[test]
fn what_can_be_decoded_can_be_sent() {
    let mut random = Random(0x2545_F491);
    let mut out = [0; MAX_FRAME];
    let mut sent = 0;
    for _ in 0..BODIES {
        let body = random.body();
        for number in REQUESTS.iter().map(|info| info.number) {
            // Bodies end anywhere, so one of the pieces is the right length for every message.
            for length in 0..body.len().min(16) {
                if let Ok(request) = Request::decode(number, &body[..length]) {
                    request.encode_frame(0, &mut out).unwrap();
                    sent += 1;
                }
            }
            if let Ok(reply) = Reply::decode(number, &body) {
                reply.encode_frame(0, &mut out).unwrap();
            }
        }
        for number in ERRORS.iter().map(|info| info.number) {
            if let Ok(error) = Error::decode(number, &body) {
                error.encode_frame(0, &mut out).unwrap();
            }
        }
        for number in EVENTS.iter().map(|info| info.number) {
            if let Ok(EventMessage { dropped, time_us, event }) =
                EventMessage::decode(number, &body)
            {
                event.encode_frame(0, dropped, time_us, &mut out).unwrap();
            }
        }
    }
    assert!(sent > 10_000, "the bodies are too random to say anything: {sent}");
}
