//! Whatever a body holds: decoding ends with a value that can be sent, or with an error.

use fastrand::Rng;
use host_protocol::{ERRORS, EVENTS, Error, EventMessage, MAX_FRAME, REQUESTS, Reply, Request};

/// Random bodies for each message of the tables.
const BODIES: usize = 2_000;
/// Longest of them, bytes.
const LONGEST: usize = 96;

/// Small bytes come often, since they pass for variants and lengths.
fn byte(random: &mut Rng) -> u8 {
    let byte = random.u8(..);
    if random.bool() { byte & 0x07 } else { byte }
}

fn body(random: &mut Rng) -> Vec<u8> {
    (0..random.usize(..LONGEST)).map(|_| byte(random)).collect()
}

#[test]
fn what_can_be_decoded_can_be_sent() {
    let mut random = Rng::with_seed(1);
    let mut out = [0; MAX_FRAME];
    let mut sent = 0;
    for _ in 0..BODIES {
        let body = body(&mut random);
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
