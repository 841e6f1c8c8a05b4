//! One host link: a UART between a host program and the gateway, each end with its own rate.

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::{DEFAULT_BAUD, DELIMITER};

use crate::bus::bit_time;

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;
/// The gateway takes in at most this many bytes at once.
const CHUNK: usize = 32;
/// Bytes kept for a host that does not read; what comes then is lost.
const HOST_BUFFER: usize = 1 << 20;

/// Both directions of one link.
#[derive(Debug)]
pub(super) struct HostLink {
    /// The rate of the gateway's end.
    baud: u32,
    /// That of the host's end; none follows the gateway.
    host_baud: Option<u32>,
    /// Bytes on their way to the gateway.
    inbound: VecDeque<u8>,
    /// Since when bytes have followed each other without a pause.
    run_start: Duration,
    /// How many of that run have arrived.
    run_arrived: u64,
    /// What the gateway sends, and when its last bit has left.
    outbound: Option<(Duration, Vec<u8>)>,
    /// Arrived at the host, not yet read.
    received: VecDeque<u8>,
    /// The host takes nothing: what the gateway is sending stays where it is.
    is_blocked: bool,
}

impl Default for HostLink {
    fn default() -> Self {
        Self {
            baud: DEFAULT_BAUD,
            host_baud: None,
            inbound: VecDeque::new(),
            run_start: Duration::ZERO,
            run_arrived: 0,
            outbound: None,
            received: VecDeque::new(),
            is_blocked: false,
        }
    }
}

impl HostLink {
    /// Sets the rate of the gateway's end, for what begins now.
    pub(super) fn set_baud(&mut self, now: Duration, baud: u32) {
        if self.baud != baud {
            self.baud = baud;
            self.begin_run(now);
        }
    }

    /// Sets the rate of the host's end.
    pub(super) fn set_host_baud(&mut self, now: Duration, baud: u32) {
        self.host_baud = Some(baud);
        self.begin_run(now);
    }

    /// Whether both ends have one rate.
    pub(super) fn is_readable(&self) -> bool {
        self.host_baud.is_none_or(|baud| baud == self.baud)
    }

    fn begin_run(&mut self, now: Duration) {
        (self.run_start, self.run_arrived) = (now, 0);
    }

    pub(super) fn send(&mut self, now: Duration, bytes: &[u8]) {
        if self.inbound.is_empty() && self.arrival(0) < now {
            self.begin_run(now);
        }
        self.inbound.extend(bytes);
    }

    /// Bytes that are on their way to the gateway.
    pub(super) fn backlog(&self) -> usize {
        self.inbound.len()
    }

    pub(super) fn take_received(&mut self) -> Vec<u8> {
        self.received.drain(..).collect()
    }

    /// Forgets what is on its way and what has not been read.
    pub(super) fn reset(&mut self) {
        self.inbound.clear();
        self.received.clear();
        if let Some((_, bytes)) = &mut self.outbound {
            bytes.clear();
        }
    }

    pub(super) fn next_event(&self) -> Option<Duration> {
        let inbound = (!self.inbound.is_empty()).then(|| self.arrival(self.chunk_len()));
        let outbound = self.outbound.as_ref().map(|(end, _)| *end).filter(|_| !self.is_blocked);
        inbound.into_iter().chain(outbound).min()
    }

    /// The next bytes that have arrived at the gateway.
    pub(super) fn arrived(&mut self, now: Duration) -> Option<Vec<u8>> {
        let len = self.chunk_len();
        if len == 0 || self.arrival(len) > now {
            return None;
        }
        self.run_arrived += len as u64;
        let is_readable = self.is_readable();
        Some(self.inbound.drain(..len).map(|byte| as_read(byte, is_readable)).collect())
    }

    /// Whether the host takes what the gateway sends.
    pub(super) fn set_reads(&mut self, reads: bool) {
        self.is_blocked = !reads;
    }

    /// Ends what the gateway was sending.
    pub(super) fn finish(&mut self, now: Duration) {
        if self.is_blocked {
            return;
        }
        let is_readable = self.is_readable();
        if let Some((_, bytes)) = self.outbound.take_if(|(end, _)| *end <= now)
            && self.received.len() + bytes.len() <= HOST_BUFFER
        {
            self.received.extend(bytes.iter().map(|byte| as_read(*byte, is_readable)));
        }
    }

    /// Whether the gateway may send its next frame.
    pub(super) fn is_free(&self) -> bool {
        self.outbound.is_none()
    }

    pub(super) fn begin(&mut self, now: Duration, frame: &[u8]) {
        let end = now + bit_time(frame.len() as u64 * BITS_PER_BYTE, self.baud);
        self.outbound = Some((end, frame.to_vec()));
    }

    /// When the first `len` waiting bytes have arrived.
    fn arrival(&self, len: usize) -> Duration {
        let baud = self.host_baud.unwrap_or(self.baud);
        self.run_start + bit_time((self.run_arrived + len as u64) * BITS_PER_BYTE, baud)
    }

    /// With the end of a frame the gateway looks at what it has received.
    fn chunk_len(&self) -> usize {
        let end = self.inbound.iter().take(CHUNK).position(|byte| *byte == DELIMITER);
        end.map_or_else(|| self.inbound.len().min(CHUNK), |at| at + 1)
    }
}

/// A byte as an end of another rate reads it: as another one.
fn as_read(byte: u8, is_readable: bool) -> u8 {
    if is_readable { byte } else { byte.reverse_bits() | 0xC0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    /// A byte takes 10.85 µs; a delimiter makes the gateway look, and so does a pause.
    #[test]
    fn bytes_arrive_at_the_pace_of_the_line() {
        let mut link = HostLink::default();
        link.send(us(100), &[0, 1, 2, 0, 9]);
        let mut arrived = Vec::new();
        while let Some(at) = link.next_event() {
            arrived.push((at.as_nanos(), link.arrived(at).unwrap()));
        }
        assert_eq!(arrived, [(110_851, vec![0]), (143_403, vec![1, 2, 0]), (154_253, vec![9])]);
        // While the line is busy, more bytes follow without a pause; later they start anew.
        link.send(us(150), &[7]);
        assert_eq!(link.next_event().map(|at| at.as_nanos()), Some(165_104));
        assert!(link.arrived(us(200)).is_some());
        link.send(us(300), &[7]);
        assert_eq!(link.next_event().map(|at| at.as_nanos()), Some(310_851));
    }

    #[test]
    fn a_host_that_does_not_read_loses_whole_frames() {
        let mut link = HostLink::default();
        for _ in 0..10_000 {
            link.begin(Duration::ZERO, &[1; 500]);
            link.finish(us(10_000));
        }
        let received = link.take_received();
        assert_eq!(received.len(), HOST_BUFFER / 500 * 500);
    }
}
