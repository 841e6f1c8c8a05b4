//! A cable on which much more comes than a gateway says: each of its samples again and again, until
//! there are so many each second. Between a server and a gateway behind TCP.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{
    Deframer, Event, EventMessage, Frame, Kind, MAX_FRAME, encode_body,
};

/// Between two looks at the clock.
const TICK: Duration = Duration::from_millis(1);

/// What goes on and what went by.
#[derive(Debug, Default)]
pub struct Flood {
    /// Whether samples are repeated.
    pub on: AtomicBool,
    /// Samples that the server was sent, in all.
    pub sent: AtomicU64,
}

/// One direction of the cable: from the gateway.
struct Cable<'a> {
    flood: &'a Flood,
    server: TcpStream,
    /// The number of the gateway's last event, and of the last that the server was sent: those
    /// between are repeated samples.
    numbers: Option<(u16, u16)>,
    /// The last sample of each axis.
    samples: BTreeMap<u8, EventMessage>,
}

impl Flood {
    /// Serves one server after the other, each with a connection to the gateway at `gateway`, with
    /// so many samples each second of all axes together.
    pub fn serve(self: &Arc<Self>, listener: &TcpListener, gateway: &str, rate: u64) {
        for server in listener.incoming().map_while(Result::ok) {
            let Ok(gateway) = TcpStream::connect(gateway) else { continue };
            let (Ok(from), Ok(to)) = (server.try_clone(), gateway.try_clone()) else { continue };
            thread::spawn(move || copy(from, to));
            let flood = self.clone();
            thread::spawn(move || {
                let (numbers, samples) = (None, BTreeMap::new());
                Cable { flood: &flood, server, numbers, samples }.carry(gateway, rate)
            });
        }
    }
}

fn copy(mut from: TcpStream, mut to: TcpStream) {
    let _ = std::io::copy(&mut from, &mut to);
    let _ = to.shutdown(std::net::Shutdown::Both);
}

impl Cable<'_> {
    fn carry(mut self, mut gateway: TcpStream, rate: u64) {
        let _ = gateway.set_nodelay(true);
        let _ = self.server.set_nodelay(true);
        let _ = gateway.set_read_timeout(Some(TICK));
        let (mut deframer, mut bytes) = (Deframer::new(), [0; 4_096]);
        let (mut since, mut due) = (Instant::now(), 0);
        loop {
            let count = match gateway.read(&mut bytes) {
                Ok(0) => break,
                Ok(count) => count,
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    0
                }
                Err(_) => break,
            };
            let mut rest = &bytes[..count];
            let mut out = Vec::new();
            while !rest.is_empty() {
                if let Some(Ok(frame)) = deframer.take(&mut rest) {
                    self.pass(&frame, &mut out);
                }
            }
            if self.flood.on.load(Ordering::Relaxed) {
                let passed = u64::try_from(since.elapsed().as_micros()).unwrap_or(0);
                let wanted = (passed * rate / 1_000_000).saturating_sub(due);
                due += wanted;
                self.repeat(wanted.min(rate), rate, &mut out);
            } else {
                (since, due) = (Instant::now(), 0);
            }
            if self.server.write_all(&out).is_err() {
                break;
            }
        }
        let _ = self.server.shutdown(std::net::Shutdown::Both);
    }

    fn pass(&mut self, frame: &Frame<'_>, out: &mut Vec<u8>) {
        let mut sequence = frame.sequence;
        if frame.kind == Kind::Event {
            sequence = match self.numbers {
                // A session begins: its events are counted from 0.
                Some((last, sent)) if frame.sequence == last.wrapping_add(1) => {
                    sent.wrapping_add(1)
                }
                _ => frame.sequence,
            };
            self.numbers = Some((frame.sequence, sequence));
            if let Ok(message) = EventMessage::decode(frame.number, frame.body)
                && let Event::Sample { axis, .. } = message.event
            {
                self.samples.insert(axis, message);
                self.flood.sent.fetch_add(1, Ordering::Relaxed);
            }
        }
        let mut bytes = [0; MAX_FRAME];
        let length = encode_body(frame.kind, sequence, frame.number, frame.body, &mut bytes);
        out.extend(&bytes[..length.expect("it came in a frame")]);
    }

    /// So many samples more, of all axes in turns, each as much later as their rate says.
    fn repeat(&mut self, count: u64, rate: u64, out: &mut Vec<u8>) {
        let axes: Vec<u8> = self.samples.keys().copied().collect();
        let step_us = 1_000_000 * axes.len() as u64 / rate.max(1);
        for axis in axes.iter().cycle().take(usize::try_from(count).unwrap_or(0)) {
            let Some((_, sent)) = &mut self.numbers else { return };
            *sent = sent.wrapping_add(1);
            let sequence = *sent;
            let Some(message) = self.samples.get_mut(axis) else { continue };
            message.time_us += step_us;
            message.dropped = 0;
            let mut bytes = [0; MAX_FRAME];
            let EventMessage { time_us, event, .. } = *message;
            let length = event.encode_frame(sequence, 0, time_us, &mut bytes);
            out.extend(&bytes[..length.expect("a sample fits")]);
            self.flood.sent.fetch_add(1, Ordering::Relaxed);
        }
    }
}
