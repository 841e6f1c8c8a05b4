//! The line between the controller and the other nodes: whose turn it is, how long a frame takes,
//! how it ends.
//!
//! Frames are carried whole. A frame fails at its acknowledge slot, whatever destroys it; only on a
//! short the sender notices in its first bit. An error frame is six bits of flag and eight of
//! delimiter.

use std::cmp::Ordering;

use rigless::chip::can::{ERROR_DELIMITER_BITS, ERROR_FLAG_BITS, Fault, Frame, INTERMISSION_BITS};
use rigless::device::DeviceContext;
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use super::BitTime;
use super::controller::{Activity, Controller, SEQUENCE_BITS};
use super::errors::ErrorCode;
use super::node::{Node, Wiring};

/// What ends a failed frame until the bus is free.
const ERROR_BITS: u64 = (ERROR_FLAG_BITS + ERROR_DELIMITER_BITS + INTERMISSION_BITS) as u64;

/// Frames that the log keeps at least: a bus without acknowledgement makes 7500 a second.
const LEAST_LOG: usize = 100_000;

/// Who sent a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sender {
    /// The part's controller.
    Controller,
    /// The node with this index.
    Node(usize),
}

/// How a frame ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameEnd {
    /// Every node that understands it has it.
    Acknowledged,
    /// No node was there to acknowledge it.
    Unacknowledged,
    /// An error frame destroyed it.
    Destroyed,
}

/// A frame that was on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// The first edge of its start of frame.
    pub start: VirtualNanos,
    /// The end of its end of frame; of a frame that failed: the begin of the error frame.
    pub end: VirtualNanos,
    /// Who sent it.
    pub sender: Sender,
    /// The frame.
    pub frame: Frame,
    /// How it ended.
    pub outcome: FrameEnd,
}

/// Somebody who wants to send.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Wish {
    sender: Sender,
    /// The controller's buffer.
    buffer: usize,
    frame: Frame,
    fault: Option<Fault>,
    bit: BitTime,
    /// From when on it may.
    from: VirtualNanos,
}

/// A frame on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Flight {
    frame: Frame,
    fault: Option<Fault>,
    start: VirtualNanos,
    bit: BitTime,
    /// Several nodes send, and not the same.
    collision: bool,
    step: Step,
}

/// What comes next in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Step {
    /// The acknowledge slot ends.
    Acknowledge,
    /// It is valid at those who receive it.
    Valid,
    /// It is valid at its sender.
    End,
}

impl Flight {
    fn due(&self) -> VirtualNanos {
        let bits = match self.step {
            Step::Acknowledge => self.frame.bits_through_acknowledge(),
            Step::Valid => self.frame.bits_until_valid(),
            Step::End => self.frame.bits_on_the_wire(),
        };
        self.bit.after(self.start, u64::from(bits))
    }
}

/// What is on the line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Line {
    /// Nothing: anybody may start.
    Free,
    /// The first bit of a start of frame: who wants may join.
    Starting { start: VirtualNanos, bit: BitTime },
    /// A frame.
    Busy(Flight),
    /// The end of a frame or an error frame, and the intermission.
    Ending { until: VirtualNanos },
}

/// A time for which the line was recessive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Recessive {
    pub(super) since: VirtualNanos,
    pub(super) until: VirtualNanos,
    /// A frame has begun since.
    pub(super) over: bool,
}

/// Why a frame fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Failure {
    Unacknowledged,
    /// Damaged by its sender.
    Damaged(Fault),
    /// An error flag was driven into it.
    Flagged,
}

/// The line and the nodes on it.
#[derive(Debug)]
pub struct Wire {
    pub(super) nodes: Vec<Node>,
    wiring: Wiring,
    line: Line,
    /// Who sends the frame on the line.
    senders: Vec<Sender>,
    /// Since when anybody might start: the last 11 bits before were recessive.
    free_since: VirtualNanos,
    log: Vec<FrameRecord>,
}

store!(Wire { values: [wiring, line, senders, free_since, log], parts: [nodes], built: [] });

impl Wire {
    pub(super) fn new() -> Self {
        Self {
            nodes: Vec::new(),
            wiring: Wiring::Connected,
            line: Line::Free,
            senders: Vec::new(),
            free_since: VirtualNanos(0),
            log: Vec::new(),
        }
    }

    pub(super) fn set_wiring(&mut self, wiring: Wiring) {
        self.wiring = wiring;
    }

    pub(super) fn log(&self) -> &[FrameRecord] {
        &self.log
    }

    pub(super) fn take_log(&mut self) -> Vec<FrameRecord> {
        std::mem::take(&mut self.log)
    }

    /// From when to when the line was last recessive, and until when that goes on if nobody starts.
    pub(super) fn recessive(&self, bit: BitTime, now: VirtualNanos) -> Option<Recessive> {
        let (until, over) = match self.line {
            Line::Free => (now, false),
            Line::Starting { start, .. } => (start, true),
            Line::Busy(flight) => (flight.start, true),
            Line::Ending { .. } => return None,
        };
        // A frame and an error frame both end with eleven recessive bits.
        let before = bit.after(VirtualNanos(0), SEQUENCE_BITS).0;
        Some(Recessive {
            since: VirtualNanos(self.free_since.0.saturating_sub(before)),
            until,
            over,
        })
    }

    /// What a controller on the bus does now.
    pub(super) fn activity(&self) -> Activity {
        match self.line {
            Line::Busy(_) if self.senders.contains(&Sender::Controller) => Activity::Transmitter,
            Line::Busy(_) => Activity::Receiver,
            _ => Activity::Idle,
        }
    }

    pub(super) fn is_free(&self) -> bool {
        self.line == Line::Free
    }

    /// Carries out what is due now; returns when to look again.
    pub(super) fn advance(
        &mut self,
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) -> Option<VirtualNanos> {
        let now = context.now();
        loop {
            match self.line {
                Line::Free => {
                    let wishes = self.wishes(controller, now);
                    let first = wishes.into_iter().min_by_key(|wish| wish.from)?;
                    if first.from > now {
                        return Some(first.from);
                    }
                    self.line = Line::Starting { start: now, bit: first.bit };
                }
                Line::Starting { start, bit } => {
                    let decided = bit.after(start, 1);
                    if decided > now {
                        return Some(decided);
                    }
                    self.decide(start, decided, controller, now);
                }
                Line::Busy(flight) => {
                    if flight.due() > now {
                        return Some(flight.due());
                    }
                    self.step(flight, controller, context);
                }
                Line::Ending { until } => {
                    if until > now {
                        return Some(until);
                    }
                    self.line = Line::Free;
                    self.free_since = until;
                }
            }
        }
    }

    /// An event of the controller's slot: perhaps a peer's.
    pub(super) fn on_event(&mut self, event: EventId, context: &mut DeviceContext<'_>) {
        self.nodes.iter_mut().for_each(|node| node.on_event(event, context));
    }

    pub(super) fn part_restarted(&mut self, context: &mut DeviceContext<'_>) {
        self.nodes.iter_mut().for_each(|node| node.part_restarted(context));
    }

    /// The controller has left the bus: what it was sending breaks off, and the others find six
    /// equal bits.
    pub(super) fn controller_left(&mut self, now: VirtualNanos) {
        if !self.senders.contains(&Sender::Controller) {
            return;
        }
        self.senders.retain(|sender| *sender != Sender::Controller);
        if let Line::Busy(flight) = self.line
            && self.senders.is_empty()
        {
            self.record(&flight, Sender::Controller, now, FrameEnd::Destroyed);
            for index in self.online(now) {
                self.nodes[index].receive_failed(false);
            }
            self.line = Line::Ending { until: flight.bit.after(now, ERROR_BITS) };
        }
    }

    fn online(&mut self, now: VirtualNanos) -> Vec<usize> {
        if self.wiring != Wiring::Connected {
            return Vec::new();
        }
        (0..self.nodes.len()).filter(|index| self.nodes[*index].is_on(now)).collect()
    }

    fn wishes(&mut self, controller: &mut Controller, now: VirtualNanos) -> Vec<Wish> {
        let mut wishes = Vec::new();
        let bit = controller.bit();
        if let Some(((buffer, outgoing, from), bit)) = controller.candidate(now).zip(bit) {
            let sender = Sender::Controller;
            wishes.push(Wish { sender, buffer, frame: outgoing.frame, fault: None, bit, from });
        }
        if self.wiring == Wiring::Connected {
            for (index, node) in self.nodes.iter_mut().enumerate() {
                if let Some(((offer, from), bit)) = node.offer().zip(node.bit(bit)) {
                    let sender = Sender::Node(index);
                    wishes.push(Wish {
                        sender,
                        buffer: 0,
                        frame: offer.frame,
                        fault: offer.fault,
                        bit,
                        from,
                    });
                }
            }
        }
        wishes
    }

    /// The first bit of the start of frame is over: who started by then sends on, or finds that it
    /// has lost.
    fn decide(
        &mut self,
        start: VirtualNanos,
        decided: VirtualNanos,
        controller: &mut Controller,
        now: VirtualNanos,
    ) {
        let wishes: Vec<Wish> =
            self.wishes(controller, now).into_iter().filter(|wish| wish.from <= decided).collect();
        let Some(winner) =
            wishes.iter().min_by(|one, other| one.frame.arbitrates(&other.frame)).copied()
        else {
            // Taken back in its first bit.
            self.line = Line::Free;
            self.free_since = now;
            return;
        };
        self.senders.clear();
        let mut collision = false;
        for wish in &wishes {
            let understood = wish.bit.matches(winner.bit);
            if understood && wish.frame.arbitrates(&winner.frame) == Ordering::Greater {
                if wish.sender == Sender::Controller {
                    controller.lost_arbitration(wish.buffer);
                }
                continue;
            }
            collision |= !understood || wish.frame != winner.frame;
            if wish.sender == Sender::Controller {
                controller.begin(wish.buffer);
            }
            self.senders.push(wish.sender);
        }
        let flight = Flight {
            frame: winner.frame,
            fault: winner.fault,
            start,
            bit: winner.bit,
            collision,
            step: Step::Acknowledge,
        };
        self.line = Line::Busy(flight);
        if self.wiring == Wiring::Shorted {
            self.fail_on_short(&flight, controller, now);
        }
    }

    fn fail_on_short(&mut self, flight: &Flight, controller: &mut Controller, now: VirtualNanos) {
        self.record(flight, Sender::Controller, now, FrameEnd::Destroyed);
        let extra = controller.send_failed_on_short();
        let free = flight.bit.after(now, extra + ERROR_BITS);
        controller.suspend(free, false);
        self.senders.clear();
        self.line = Line::Ending { until: free };
    }

    fn step(
        &mut self,
        flight: Flight,
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now();
        let online = self.online(now);
        let gone =
            |sender: &Sender| matches!(sender, Sender::Node(index) if !online.contains(index));
        if self.senders.iter().all(gone) {
            // The cable was cut, or the sender silenced: the rest of the frame never comes.
            self.fail(&flight, Failure::Damaged(Fault::Stuff), controller, context);
            return;
        }
        match flight.step {
            Step::Acknowledge => match self.failure(&flight, &online, controller) {
                Some(failure) => self.fail(&flight, failure, controller, context),
                None => self.line = Line::Busy(Flight { step: Step::Valid, ..flight }),
            },
            Step::Valid => {
                self.deliver(&flight, &online, controller, context);
                self.line = Line::Busy(Flight { step: Step::End, ..flight });
            }
            Step::End => self.finish(&flight, controller, context),
        }
    }

    /// Why a frame fails at its acknowledge slot, if it does.
    fn failure(
        &mut self,
        flight: &Flight,
        online: &[usize],
        controller: &Controller,
    ) -> Option<Failure> {
        let by_controller = self.senders.contains(&Sender::Controller);
        let own_bit = controller.bit();
        let listening = controller.is_on() && !by_controller;
        let understands = |bit: Option<BitTime>| bit.is_some_and(|bit| bit.matches(flight.bit));
        let mut flagged =
            flight.collision || listening && controller.is_error_active() && !understands(own_bit);
        let mut acknowledged = listening && controller.acknowledges() && understands(own_bit);
        for &index in online {
            let node = &mut self.nodes[index];
            flagged |= by_controller && node.disturbs(&flight.frame);
            if self.senders.contains(&Sender::Node(index)) {
                continue;
            }
            if understands(node.bit(own_bit)) {
                acknowledged = true;
            } else {
                flagged |= node.is_error_active();
            }
        }
        match flight.fault {
            Some(fault) => Some(Failure::Damaged(fault)),
            None if flagged => Some(Failure::Flagged),
            None if !acknowledged => Some(Failure::Unacknowledged),
            None => None,
        }
    }

    fn fail(
        &mut self,
        flight: &Flight,
        failure: Failure,
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now();
        let free = flight.bit.after(now, ERROR_BITS);
        let outcome = match failure {
            Failure::Unacknowledged => FrameEnd::Unacknowledged,
            Failure::Damaged(_) | Failure::Flagged => FrameEnd::Destroyed,
        };
        let senders = std::mem::take(&mut self.senders);
        self.record(flight, senders.first().copied().unwrap_or(Sender::Controller), now, outcome);
        self.line = Line::Ending { until: free };
        let at_receivers = match failure {
            Failure::Unacknowledged => ErrorCode::Form,
            Failure::Damaged(fault) => Controller::code_of(fault),
            Failure::Flagged => ErrorCode::Stuff,
        };
        let own_bit = controller.bit();
        let understands = |bit: Option<BitTime>| bit.is_some_and(|bit| bit.matches(flight.bit));
        let online = self.online(now);
        if senders.contains(&Sender::Controller) {
            let code = match failure {
                Failure::Unacknowledged => ErrorCode::Acknowledge,
                Failure::Damaged(_) | Failure::Flagged => ErrorCode::Bit1,
            };
            controller.send_failed(code, free);
        } else if controller.is_on() {
            // An error-passive sender makes no error flag that anybody sees: who only listens has
            // the frame.
            let passive = |sender: &Sender| match sender {
                Sender::Node(index) => !self.nodes[*index].is_error_active(),
                Sender::Controller => false,
            };
            let is_whole = failure == Failure::Unacknowledged && senders.iter().all(passive);
            if !is_whole || !understands(own_bit) {
                controller.receive_failed(at_receivers, !understands(own_bit));
            } else if let Err((register, reason)) = controller.received(&flight.frame, flight.start)
            {
                context.tell(register, reason);
            }
        }
        for index in 0..self.nodes.len() {
            let node = &mut self.nodes[index];
            if senders.contains(&Sender::Node(index)) {
                node.send_failed(failure == Failure::Unacknowledged, free, flight.bit, context);
            } else if online.contains(&index) {
                let first = !understands(node.bit(own_bit));
                node.receive_failed(first);
            }
        }
    }

    /// A frame is valid: everybody who understands it has it, and nobody else could say otherwise.
    fn deliver(
        &mut self,
        flight: &Flight,
        online: &[usize],
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) {
        let own_bit = controller.bit();
        let understands = |bit: Option<BitTime>| bit.is_some_and(|bit| bit.matches(flight.bit));
        if controller.is_on() && !self.senders.contains(&Sender::Controller) {
            if understands(own_bit) {
                if let Err((register, reason)) = controller.received(&flight.frame, flight.start) {
                    context.tell(register, reason);
                }
            } else {
                controller.receive_failed(ErrorCode::Stuff, false);
            }
        }
        for &index in online.iter().filter(|index| !self.senders.contains(&Sender::Node(**index))) {
            let node = &mut self.nodes[index];
            if understands(node.bit(own_bit)) {
                node.receive(&flight.frame, context);
            } else {
                node.receive_failed(false);
            }
        }
    }

    fn finish(
        &mut self,
        flight: &Flight,
        controller: &mut Controller,
        context: &mut DeviceContext<'_>,
    ) {
        let now = context.now();
        let free = flight.bit.after(now, u64::from(INTERMISSION_BITS));
        let senders = std::mem::take(&mut self.senders);
        self.record(
            flight,
            senders.first().copied().unwrap_or(Sender::Controller),
            now,
            FrameEnd::Acknowledged,
        );
        self.line = Line::Ending { until: free };
        for sender in senders {
            match sender {
                Sender::Controller => {
                    if let Err((register, reason)) =
                        controller.sent(&flight.frame, flight.start, free)
                    {
                        context.tell(register, reason);
                    }
                }
                Sender::Node(index) => self.nodes[index].sent(context),
            }
        }
    }

    fn record(&mut self, flight: &Flight, sender: Sender, end: VirtualNanos, outcome: FrameEnd) {
        if self.log.len() == 2 * LEAST_LOG {
            self.log.drain(..LEAST_LOG);
        }
        self.log.push(FrameRecord {
            start: flight.start,
            end,
            sender,
            frame: flight.frame,
            outcome,
        });
    }
}
