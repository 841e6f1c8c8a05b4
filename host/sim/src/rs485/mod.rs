//! One RS485 line, byte by byte: half-duplex, no arbitration, what overlaps is garbled.

use std::collections::VecDeque;
use std::time::Duration;

use crate::bus::{BusFault, Station, bit_time};

/// Start bit, eight data bits, stop bit.
const BITS_PER_BYTE: u64 = 10;
/// Bytes of the recent past that can still overlap with one that ends now.
const RECENT: usize = 8;

/// Something that the line did to its stations.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum SerialOutcome {
    /// A byte arrived at these stations, whole or garbled.
    Byte { value: u8, to: Vec<Station> },
    /// A station has sent the last stop bit of a message.
    Sent { from: Station, slot: u8, bytes: Vec<u8>, start: Duration, end: Duration },
}

/// Bytes handed to a station's sender.
#[derive(Debug, Clone)]
struct Message {
    slot: u8,
    bytes: Vec<u8>,
}

/// A message on its way.
#[derive(Debug, Clone)]
struct Sending {
    message: Message,
    start: Duration,
    /// Bytes that have been sent.
    done: usize,
}

#[derive(Debug, Clone)]
struct Node {
    station: Station,
    baud: u32,
    plugged: bool,
    /// Hears what it sends.
    echo: bool,
    queue: VecDeque<Message>,
    sending: Option<Sending>,
}

/// One byte that is or was on the line.
#[derive(Debug, Clone, Copy)]
struct OnLine {
    from: Station,
    start: Duration,
    end: Duration,
    value: u8,
    /// It started while receivers were busy with another one.
    lost: bool,
}

/// A line and everything on it.
#[derive(Debug, Clone, Default)]
pub(crate) struct SerialLine {
    nodes: Vec<Node>,
    fault: BusFault,
    recent: VecDeque<OnLine>,
    outcomes: VecDeque<SerialOutcome>,
}

impl SerialLine {
    /// Starts a station, or starts it again: what it held is dropped. `echo`: it hears what it
    /// sends.
    pub(crate) fn start(&mut self, station: Station, baud: u32, echo: bool) {
        self.nodes.retain(|node| node.station != station);
        let (queue, sending) = (VecDeque::new(), None);
        self.nodes.push(Node { station, baud, plugged: true, echo, queue, sending });
        self.nodes.sort_by_key(|node| node.station);
    }

    /// Takes a station off the line until it is started again: what it held is dropped.
    pub(crate) fn stop(&mut self, station: Station) {
        self.nodes.retain(|node| node.station != station);
    }

    /// Sends bytes after those the station already has to send. It does not look whether the line
    /// is free.
    pub(crate) fn send(&mut self, now: Duration, station: Station, slot: u8, bytes: Vec<u8>) {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station) {
            node.queue.push_back(Message { slot, bytes });
            node.begin(now);
        }
    }

    pub(crate) fn set_fault(&mut self, fault: BusFault) {
        self.fault = fault;
    }

    /// Takes one station off the line, or puts it back.
    pub(crate) fn set_plugged(&mut self, station: Station, plugged: bool) {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station) {
            node.plugged = plugged;
        }
    }

    /// When the next byte ends.
    pub(crate) fn next_event(&self) -> Option<Duration> {
        self.nodes.iter().filter_map(|node| node.byte_on_line().map(|byte| byte.end)).min()
    }

    /// Ends the bytes that are over at `now`.
    pub(crate) fn finish(&mut self, now: Duration) {
        for at in 0..self.nodes.len() {
            let Some(mut byte) =
                self.nodes.get(at).and_then(Node::byte_on_line).filter(|b| b.end <= now)
            else {
                continue;
            };
            byte.lost = !self.deliver(byte);
            if self.recent.len() == RECENT {
                self.recent.pop_front();
            }
            self.recent.push_back(byte);
            self.outcomes.extend(self.nodes.get_mut(at).and_then(|node| node.byte_done(byte.end)));
        }
    }

    /// The next thing that happened.
    pub(crate) fn poll(&mut self) -> Option<SerialOutcome> {
        self.outcomes.pop_front()
    }

    /// Delivers a byte; `false` if receivers were busy with an earlier one.
    fn deliver(&mut self, byte: OnLine) -> bool {
        let mut value = byte.value;
        let in_progress = self.nodes.iter().filter_map(Node::byte_on_line);
        let others = in_progress.chain(self.recent.iter().copied());
        for other in
            others.filter(|other| other.overlaps(&byte) && self.reaches(other.from, byte.from))
        {
            if !other.lost && (other.start, other.from) < (byte.start, byte.from) {
                return false;
            }
            // A dominant zero wins, bit by bit; that they are not in step is neglected.
            value &= other.value;
        }
        let sender = self.nodes.iter().find(|node| node.station == byte.from);
        let Some(baud) = sender.map(|node| node.baud) else { return false };
        let to: Vec<Station> = self
            .nodes
            .iter()
            .filter(|node| node.baud == baud && self.reaches(byte.from, node.station))
            .filter(|node| if node.sending.is_some() { node.echo } else { true })
            .map(|node| node.station)
            .collect();
        // A shorted line reads as one long break.
        let value = if self.fault == BusFault::Short { 0 } else { value };
        if !to.is_empty() {
            self.outcomes.push_back(SerialOutcome::Byte { value, to });
        }
        true
    }

    /// Whether what one station sends arrives at another one, or at itself.
    fn reaches(&self, from: Station, to: Station) -> bool {
        if from == to {
            return true;
        }
        let plugged =
            |station| self.nodes.iter().any(|node| node.station == station && node.plugged);
        let whole = match self.fault {
            BusFault::None => true,
            BusFault::Cut => from != Station::Gateway && to != Station::Gateway,
            BusFault::Short => false,
        };
        whole && plugged(from) && plugged(to)
    }
}

impl Node {
    fn begin(&mut self, now: Duration) {
        if self.sending.is_none() {
            self.sending =
                self.queue.pop_front().map(|message| Sending { message, start: now, done: 0 });
        }
    }

    /// The byte it is sending. Times count from the start of the message, so that they do not
    /// drift.
    fn byte_on_line(&self) -> Option<OnLine> {
        let sending = self.sending.as_ref()?;
        let value = *sending.message.bytes.get(sending.done)?;
        let bits = sending.done as u64 * BITS_PER_BYTE;
        Some(OnLine {
            from: self.station,
            start: sending.start + bit_time(bits, self.baud),
            end: sending.start + bit_time(bits + BITS_PER_BYTE, self.baud),
            value,
            lost: false,
        })
    }

    /// Goes on to the next byte, or to the next message.
    fn byte_done(&mut self, end: Duration) -> Option<SerialOutcome> {
        let sending = self.sending.as_mut()?;
        sending.done += 1;
        if sending.done < sending.message.bytes.len() {
            return None;
        }
        let Sending { message: Message { slot, bytes }, start, .. } = self.sending.take()?;
        self.begin(end);
        Some(SerialOutcome::Sent { from: self.station, slot, bytes, start, end })
    }
}

impl OnLine {
    fn overlaps(&self, other: &OnLine) -> bool {
        self.from != other.from && self.start < other.end && other.start < self.end
    }
}

#[cfg(test)]
mod tests;
