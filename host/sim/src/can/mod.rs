//! One CAN bus, frame by frame: arbitration, acknowledgement, errors, broken cables.
//!
//! Stations that hear each other form an island: same side of a cut, same bitrate. Each island has
//! its own medium, on which one frame at a time is sent. Bits are not simulated one by one; their
//! number is, exactly.

mod bits;
mod errors;
mod node;

use std::collections::VecDeque;
use std::time::Duration;

use host_protocol::{BusMode, BusState, CanFrame};

use self::bits::{ERROR_FRAME, FrameBits, INTERMISSION, SUSPEND, priority};
use self::node::{Node, Pending};
use crate::bus::{BusFault, Station, bit_time};

/// Bits of a frame on the wire, stuffed, from the start bit to the end of frame.
pub fn frame_bits(frame: &CanFrame) -> u64 {
    FrameBits::of(frame).frame()
}

/// Something that the bus did to its stations.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum CanOutcome {
    /// A frame was sent and acknowledged.
    Sent {
        from: Station,
        slot: u8,
        frame: CanFrame,
        start: Duration,
        end: Duration,
        /// Every station that received it.
        to: Vec<Station>,
    },
    /// A frame that nobody acknowledged, whole to who only listens: an error-passive sender makes
    /// no error flag that anybody sees.
    Overheard { frame: CanFrame, to: Vec<Station> },
    /// A frame that was asked back has not been sent and will not be.
    Cancelled { station: Station, slot: u8 },
    /// The error state or a counter of a station changed.
    State { station: Station, state: BusState, transmit: u16, receive: u16 },
}

/// What a frame has to become, known when its first bit is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Good,
    /// Nobody else is there to acknowledge.
    Unacknowledged,
    /// The line does not follow the transmitter.
    BitError,
    /// Two stations send different data under the same id.
    Collision,
    /// Its checksum is wrong: destroyed by the receivers and not sent again.
    Corrupt,
}

/// A frame on its way.
#[derive(Debug, Clone)]
struct InFlight {
    /// Indexes of the sending nodes: one, or several that send the same bits.
    senders: Vec<usize>,
    fate: Fate,
    start: Duration,
    end: Duration,
}

/// What the stations of one island share.
#[derive(Debug, Clone, Default)]
struct Medium {
    in_flight: Option<InFlight>,
    free_at: Duration,
}

/// Which stations hear each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Island {
    /// On the gateway's side of a cut.
    gateway_side: bool,
    /// Bitrate of the first station found in it.
    bitrate: u32,
}

/// A CAN bus and everything on it.
#[derive(Debug, Clone, Default)]
pub(crate) struct CanBus {
    nodes: Vec<Node>,
    media: Vec<(Island, Medium)>,
    fault: BusFault,
    outcomes: VecDeque<CanOutcome>,
}

impl CanBus {
    /// Starts a station at a bitrate, or starts it again: what it held is dropped.
    ///
    /// A controller that was bus-off first waits for a quiet line; its `State` comes when it takes
    /// part again.
    pub(crate) fn start(&mut self, now: Duration, station: Station, bitrate: u32) {
        self.start_in(now, station, bitrate, BusMode::Normal);
    }

    /// The same in a mode.
    pub(crate) fn start_in(
        &mut self,
        now: Duration,
        station: Station,
        bitrate: u32,
        mode: BusMode,
    ) {
        self.stop_media(now, Some(station));
        let at = self.index_or_insert(station);
        let short = self.fault == BusFault::Short;
        let Some(node) = self.nodes.get_mut(at) else { return };
        (node.bitrate, node.mode) = (bitrate, mode);
        node.drop_frames();
        if node.counters.is_bus_off() {
            node.recover(now, short);
        } else {
            node.counters = errors::ErrorCounters::default();
            self.report(at);
        }
    }

    /// Switches a station's controller off until it is started again: what it held is dropped.
    pub(crate) fn stop(&mut self, now: Duration, station: Station) {
        self.stop_media(now, Some(station));
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station) {
            // At no bitrate at all it hears nobody and acknowledges nothing.
            let plugged = node.plugged;
            *node = Node::new(station);
            node.plugged = plugged;
        }
    }

    /// Hands a frame to a station's controller. `corrupt`: its checksum will be wrong.
    pub(crate) fn send(&mut self, station: Station, slot: u8, frame: CanFrame, corrupt: bool) {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station) {
            node.enqueue(Pending {
                slot,
                bits: FrameBits::of(&frame),
                frame,
                corrupt,
                cancelled: false,
            });
        }
    }

    /// Asks a frame back from a station's controller. Its outcome tells whether it was sent all the
    /// same.
    pub(crate) fn cancel(&mut self, station: Station, slot: u8) {
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station)
            && node.cancel(slot)
        {
            self.outcomes.push_back(CanOutcome::Cancelled { station, slot });
        }
    }

    /// Breaks or repairs the cable. Frames on their way are lost and will be sent again.
    pub(crate) fn set_fault(&mut self, now: Duration, fault: BusFault) {
        self.stop_media(now, None);
        self.fault = fault;
        for node in &mut self.nodes {
            node.restart_wait(now, fault == BusFault::Short);
        }
    }

    /// Takes one station off the bus, or puts it back.
    pub(crate) fn set_plugged(&mut self, now: Duration, station: Station, plugged: bool) {
        self.stop_media(now, None);
        if let Some(node) = self.nodes.iter_mut().find(|node| node.station == station) {
            node.plugged = plugged;
        }
    }

    /// Whether a station takes part in the bus: started, and not bus-off.
    pub(crate) fn is_running(&self, station: Station) -> bool {
        self.nodes.iter().any(|node| node.station == station && !node.counters.is_bus_off())
    }

    /// When something will happen: a frame ends, one can start, a controller comes back.
    pub(crate) fn next_event(&self) -> Option<Duration> {
        let ends =
            self.media.iter().filter_map(|(_, medium)| medium.in_flight.as_ref().map(|f| f.end));
        let recoveries = self.nodes.iter().filter_map(|node| node.back_at);
        let starts = (0..self.nodes.len()).filter_map(|at| self.can_start_at(at));
        ends.chain(recoveries).chain(starts).min()
    }

    /// Ends what is over at `now`. Call it first, then hand over new frames, then call
    /// [`CanBus::arbitrate`].
    pub(crate) fn finish(&mut self, now: Duration) {
        for at in 0..self.media.len() {
            let Some((island, medium)) = self.media.get_mut(at) else { continue };
            let island = *island;
            if let Some(sent) = medium.in_flight.take_if(|sent| sent.end <= now) {
                self.end_of(&sent, island);
            }
        }
        for at in 0..self.nodes.len() {
            if self.nodes.get_mut(at).is_some_and(|node| node.come_back(now)) {
                self.report(at);
            }
        }
    }

    /// Starts the frame of highest priority wherever the bus is free.
    pub(crate) fn arbitrate(&mut self, now: Duration) {
        let mut islands: Vec<Island> = Vec::new();
        for at in 0..self.nodes.len() {
            if self.can_start_at(at).is_some_and(|start| start <= now)
                && let Some(island) = self.island(at)
                && !islands.contains(&island)
            {
                islands.push(island);
            }
        }
        for island in islands {
            self.start_frame(now, island);
        }
    }

    /// The next thing that happened.
    pub(crate) fn poll(&mut self) -> Option<CanOutcome> {
        self.outcomes.pop_front()
    }

    fn start_frame(&mut self, now: Duration, island: Island) {
        let ready = |at: &usize| {
            self.island(*at) == Some(island)
                && self.can_start_at(*at).is_some_and(|start| start <= now)
        };
        let contenders: Vec<(usize, &Pending)> = (0..self.nodes.len())
            .filter(ready)
            .filter_map(|at| Some((at, self.nodes.get(at)?.next_frame()?)))
            .collect();
        let Some(best) = contenders.iter().map(|(_, pending)| priority(&pending.frame)).min()
        else {
            return;
        };
        let winners: Vec<_> = contenders
            .into_iter()
            .filter(|(_, pending)| priority(&pending.frame) == best)
            .collect();
        let Some((_, pending)) = winners.first().copied() else { return };

        let rival = winners.iter().find(|(_, other)| other.frame != pending.frame);
        let senders: Vec<usize> = winners.iter().map(|(at, _)| *at).collect();
        let (fate, bits) = if self.fault == BusFault::Short {
            (Fate::BitError, 1 + ERROR_FRAME)
        } else if let Some((_, other)) = rival {
            (Fate::Collision, pending.bits.up_to_difference(&other.bits) + ERROR_FRAME)
        } else if self.is_destroyed_by_another_bitrate(island) {
            (Fate::BitError, pending.bits.up_to_ack() + ERROR_FRAME)
        } else if !self.has_listener(island, &senders) {
            (Fate::Unacknowledged, pending.bits.up_to_ack() + ERROR_FRAME)
        } else if pending.corrupt {
            (Fate::Corrupt, pending.bits.up_to_ack() + ERROR_FRAME)
        } else {
            (Fate::Good, pending.bits.frame())
        };
        for at in &senders {
            self.nodes.get_mut(*at).into_iter().for_each(Node::begin);
        }
        let medium = self.medium(island);
        medium.free_at = now + bit_time(bits + INTERMISSION, island.bitrate);
        medium.in_flight =
            Some(InFlight { senders, fate, start: now, end: now + bit_time(bits, island.bitrate) });
    }

    fn end_of(&mut self, sent: &InFlight, island: Island) {
        let before: Vec<_> = self.nodes.iter().map(|node| node.counters).collect();
        let to = self.listeners(island, &sent.senders);
        let mut frames = Vec::new();
        let is_passive = |at: &usize| self.nodes.get(*at).is_some_and(|n| n.counters.is_passive());
        let is_whole = match sent.fate {
            Fate::Unacknowledged => sent.senders.iter().all(is_passive),
            fate => fate == Fate::Good,
        };
        let overheard = sent.senders.first().and_then(|at| self.nodes.get(*at)?.sending.as_ref());
        let overheard = overheard.filter(|_| is_whole).map(|pending| pending.frame);
        for at in &sent.senders {
            let Some(node) = self.nodes.get_mut(*at) else { continue };
            match sent.fate {
                Fate::Good => {
                    node.counters.transmitted();
                    frames.extend(node.sending.take().map(|pending| (node.station, pending)));
                }
                Fate::Corrupt => {
                    node.counters.transmit_error();
                    node.sending = None;
                }
                Fate::Unacknowledged => node.counters.missing_acknowledgement(),
                Fate::BitError | Fate::Collision => node.counters.transmit_error(),
            }
            if let Some(slot) = node.retry() {
                self.outcomes.push_back(CanOutcome::Cancelled { station: node.station, slot });
            }
            if node.counters.is_passive() {
                let free_at = sent.end + bit_time(INTERMISSION + SUSPEND, node.bitrate);
                node.not_before = free_at;
            }
            if node.counters.is_bus_off() {
                node.drop_frames();
            }
        }
        for at in &to {
            let Some(node) = self.nodes.get_mut(*at) else { continue };
            match is_whole {
                true => node.counters.received(),
                false => node.counters.receive_error(),
            }
        }
        for at in self.bewildered(island) {
            self.nodes.get_mut(at).into_iter().for_each(|node| node.counters.receive_error());
        }
        for (at, before) in before.iter().enumerate() {
            if self.nodes.get(at).is_some_and(|node| node.counters != *before) {
                self.report(at);
            }
            self.recover_motor(at, sent.end);
        }
        let to: Vec<Station> =
            to.iter().filter_map(|at| Some(self.nodes.get(*at)?.station)).collect();
        if let (Fate::Unacknowledged, Some(frame)) = (sent.fate, overheard)
            && !to.is_empty()
        {
            self.outcomes.push_back(CanOutcome::Overheard { frame, to: to.clone() });
        }
        for (from, pending) in frames {
            self.outcomes.push_back(CanOutcome::Sent {
                from,
                slot: pending.slot,
                frame: pending.frame,
                start: sent.start,
                end: sent.end,
                to: to.clone(),
            });
        }
    }

    /// Motors recover from bus-off by themselves; the gateway's controller waits to be started
    /// again.
    fn recover_motor(&mut self, at: usize, now: Duration) {
        let short = self.fault == BusFault::Short;
        if let Some(node) = self.nodes.get_mut(at)
            && node.station != Station::Gateway
            && node.counters.is_bus_off()
            && node.back_at.is_none()
        {
            node.recover(now, short);
        }
    }

    /// When a node's next frame may start, if it has one and the medium is not in use.
    fn can_start_at(&self, at: usize) -> Option<Duration> {
        let node = self.nodes.get(at)?;
        if node.counters.is_bus_off() {
            return None;
        }
        node.next_frame()?;
        let island = self.island(at)?;
        match self.media.iter().find(|(key, _)| *key == island) {
            Some((_, medium)) if medium.in_flight.is_some() => None,
            Some((_, medium)) => Some(medium.free_at.max(node.not_before)),
            None => Some(node.not_before),
        }
    }

    /// The island a node is on; `None` while it is unplugged.
    fn island(&self, at: usize) -> Option<Island> {
        let node = self.nodes.get(at)?;
        if !node.plugged {
            return None;
        }
        let gateway_side = self.fault != BusFault::Cut || node.station == Station::Gateway;
        let same_rate = |other: &&Node| other.plugged && other.understands(node.bitrate);
        let bitrate = self.nodes.iter().find(same_rate).map_or(node.bitrate, |other| other.bitrate);
        Some(Island { gateway_side, bitrate })
    }

    /// Whether the gateway runs at another bitrate beside them and takes part: it reads what others
    /// send as errors, and says so by an error flag. Motors of different bitrates on one bus, which
    /// do the same to each other, are not played: here each rate has the bus for itself.
    fn is_destroyed_by_another_bitrate(&self, island: Island) -> bool {
        let elsewhere = |at: usize| {
            self.island(at)
                .is_some_and(|own| own != island && own.gateway_side == island.gateway_side)
        };
        (0..self.nodes.len()).any(|at| {
            let node = &self.nodes[at];
            node.station == Station::Gateway
                && node.bitrate != 0
                && node.takes_part()
                && !node.counters.is_passive()
                && elsewhere(at)
        })
    }

    /// Those who hear a frame of another bitrate and can read nothing of it.
    fn bewildered(&self, island: Island) -> Vec<usize> {
        (0..self.nodes.len())
            .filter(|at| {
                let node = &self.nodes[*at];
                node.station == Station::Gateway && node.bitrate != 0
            })
            .filter(|at| {
                self.island(*at)
                    .is_some_and(|own| own != island && own.gateway_side == island.gateway_side)
            })
            .collect()
    }

    fn listeners(&self, island: Island, senders: &[usize]) -> Vec<usize> {
        (0..self.nodes.len())
            .filter(|at| !senders.contains(at) && self.island(*at) == Some(island))
            .filter(|at| self.nodes.get(*at).is_some_and(|node| !node.counters.is_bus_off()))
            .collect()
    }

    /// Whether anybody acknowledges; of several senders of one frame each acknowledges the others'.
    fn has_listener(&self, island: Island, senders: &[usize]) -> bool {
        let acknowledges = |at: &usize| self.nodes.get(*at).is_some_and(Node::takes_part);
        senders.len() > 1 || self.listeners(island, senders).iter().any(acknowledges)
    }

    fn medium(&mut self, island: Island) -> &mut Medium {
        let at = self.media.iter().position(|(key, _)| *key == island).unwrap_or_else(|| {
            self.media.push((island, Medium::default()));
            self.media.len() - 1
        });
        &mut self.media[at].1
    }

    /// Breaks off frames on their way: all of them, or those that a station sends.
    fn stop_media(&mut self, now: Duration, of: Option<Station>) {
        let nodes = &mut self.nodes;
        for (island, medium) in &mut self.media {
            let sends = |at: &usize| {
                nodes.get(*at).is_some_and(|node| of.is_none_or(|one| one == node.station))
            };
            let Some(broken) = medium.in_flight.take_if(|sent| sent.senders.iter().any(sends))
            else {
                continue;
            };
            for at in broken.senders {
                if let Some(node) = nodes.get_mut(at)
                    && let Some(slot) = node.retry()
                {
                    self.outcomes.push_back(CanOutcome::Cancelled { station: node.station, slot });
                }
            }
            medium.free_at = now + bit_time(ERROR_FRAME + INTERMISSION, island.bitrate);
        }
    }

    fn report(&mut self, at: usize) {
        if let Some(Node { station, counters, .. }) = self.nodes.get(at) {
            self.outcomes.push_back(CanOutcome::State {
                station: *station,
                state: counters.state(),
                transmit: counters.transmit,
                receive: counters.receive,
            });
        }
    }

    fn index_or_insert(&mut self, station: Station) -> usize {
        self.nodes.iter().position(|node| node.station == station).unwrap_or_else(|| {
            self.nodes.push(Node::new(station));
            self.nodes.len() - 1
        })
    }
}

#[cfg(test)]
mod tests;
