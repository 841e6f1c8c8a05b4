//! D5 motors that are set in motion several at once (G2, G10; PROTOCOL.md, Started together; D5
//! manual, quick start 3, 4 and 7).

use crate::axis::{Asked, Axis, Permit, Start, Waiting};
use crate::bus::Held;
use crate::can_id::{EXTENDED, is_extended};
use crate::link::Record;
use crate::motor::{Protocol, Purpose, Question, Reading};
use crate::oracle::{Frame, Oracle};
use crate::violation::Check;

/// The id of all D5 motors, in the frame and, as it is assumed, on the bus.
const ALL: u8 = 0xFE;
/// D5: a speed that waits, and what starts it.
const WAITS: u8 = 0x04;
const EXECUTE: u8 = 0x05;
/// D5: says whether something waits.
const WAITING: Question = Question::Register(0x2C);

/// Link and sequence of a request.
type Request = (u8, u16);

/// A frame that starts several motors: for which request, and a bit for each of their axes.
#[derive(Debug, Clone)]
pub(crate) struct Started {
    request: Request,
    pub members: u32,
    /// Requests that it may be for as well.
    may_be: Vec<Request>,
}

fn is_d5_on(axis: &Axis, bus: u8) -> bool {
    axis.bus() == Some(usize::from(bus))
        && axis.is_complete()
        && axis.protocol() == Some(Protocol::D5)
}

/// The bit of an axis in a set of them.
pub(super) fn bit_of(axis: u8) -> u32 {
    1u32.checked_shl(axis.into()).unwrap_or(0)
}

impl Axis {
    /// The starts that it is named for and that have not come. One is under way at a time; the
    /// others were refused, and their host has not read that yet.
    fn starts_to_come(&mut self, now: u64) -> impl Iterator<Item = (Request, &mut Start)> {
        let lives = move |p: &&mut Permit| p.expires_us.is_none_or(|at| now < at);
        let permits = self.permits.iter_mut().filter(lives);
        permits.filter_map(|permit| {
            let request = (permit.link, permit.sequence);
            permit.start.as_mut().filter(|start| !start.has_started).map(|start| (request, start))
        })
    }

    /// What a request does: to start a speed of 0 is no motion. Where a host wants a start of its
    /// own it is one.
    pub(super) fn purpose_as_it_waits(&self, purpose: Purpose, data: &[u8]) -> Purpose {
        let starts = self.protocol() == Some(Protocol::D5) && data.get(3) == Some(&EXECUTE);
        let is_native = self.permits.iter().any(|permit| permit.native.is_some() && permit.once);
        let rests = matches!(self.waiting, Waiting::Rest(_) | Waiting::Nothing(_));
        if starts && rests && !is_native { Purpose::Rest } else { purpose }
    }

    /// What a host asked for natively has gone out, a speed of 0 too.
    pub(super) fn has_sent_native(&mut self, data: &[u8]) {
        let protocol = self.protocol();
        let is_it = |native: &Vec<u8>| protocol.is_some_and(|p| p.same_command(native, data));
        let natives =
            self.permits.iter_mut().filter(|permit| permit.native.as_ref().is_some_and(is_it));
        natives.for_each(|permit| permit.sent = true);
    }

    /// Its motor was told that something shall wait, or start.
    pub(super) fn waits_from_now(&mut self, data: &[u8]) {
        if self.protocol() == Some(Protocol::D5) && data.get(3) == Some(&WAITS) {
            self.waiting = Waiting::Unknown;
        }
    }

    /// Its motor has answered. Which of two identical requests a reply belongs to, nobody can tell:
    /// the later, for all that is known.
    pub(super) fn has_said_what_waits(&mut self, asked: &Asked, reading: &Reading) {
        let at = asked.handed_us;
        match self.protocol().filter(|p| *p == Protocol::D5).and_then(|p| p.question(&asked.data)) {
            Some(WAITING) if reading.register == Some(0) => self.waiting = Waiting::Nothing(at),
            Some(WAITING) => {
                for start in self.permits.iter_mut().filter_map(|permit| permit.start.as_mut()) {
                    start.waits |= start.told.is_some() && start.told_us <= at;
                }
                if matches!(self.waiting, Waiting::Nothing(_)) {
                    self.waiting = Waiting::Unknown;
                }
            }
            Some(Question::Overwrite) if Protocol::D5.purpose(&asked.data) == Purpose::Rest => {
                self.waiting = Waiting::Rest(at);
            }
            _ => {}
        }
        if let Some(duty) = &mut self.duty {
            duty.nothing_waits = match self.waiting {
                Waiting::Unknown => false,
                Waiting::Nothing(at) | Waiting::Rest(at) => at >= duty.since_us,
            };
        }
    }
}

impl Oracle {
    /// Whether a frame tells a motor a speed that is to wait for a start under way.
    pub(super) fn prepares(&mut self, now: u64, index: usize, data: &[u8]) -> bool {
        let axis = &mut self.axes[index];
        let is_d5 = axis.protocol() == Some(Protocol::D5);
        let sets_speed =
            is_d5 && matches!(Protocol::D5.purpose(data), Purpose::Motion { .. } | Purpose::Rest);
        let is_it = |native: &Vec<u8>| Protocol::D5.same_command(native, data);
        let unsent = axis.permits.iter().filter(|permit| !permit.sent);
        let native = unsent.filter_map(|permit| permit.native.as_ref()).any(is_it);
        sets_speed
            && data.get(3) == Some(&WAITS)
            && !native
            && axis.starts_to_come(now).next().is_some()
    }

    /// A speed that is to wait: of an axis that may move, always the same, within its limits.
    pub(super) fn judge_prepared(&mut self, now: u64, index: usize, data: &[u8], frame: Frame<'_>) {
        let axis = &mut self.axes[index];
        let is_armed = axis.armed;
        let speed = [data[5], data[6]];
        let mut fits = false;
        for (_, start) in axis.starts_to_come(now) {
            if start.told.is_none_or(|told| told == speed) {
                (start.told, start.told_us, start.waits) = (Some(speed), now, false);
                fits = true;
            }
        }
        let seen = format!("axis {index}: {}", frame.text());
        if !is_armed {
            self.broken(Check::MotionUnarmed, now, seen);
        } else if !fits {
            self.broken(Check::MotionStale, now, seen);
        }
        self.judge_limits(now, index, data, frame);
    }

    /// A frame that starts whatever waits in the motors of a bus, if that is what it is: whether it
    /// was judged so.
    pub(super) fn judge_start(
        &mut self,
        now: u64,
        bus: u8,
        frame: Frame<'_>,
        held: &mut Held,
    ) -> bool {
        // A line has no ids: there every motor hears it.
        let (id, data) = match frame {
            Frame::Can(id, data) => (Some(id), data),
            Frame::Serial(data) => (None, data),
        };
        let [0xD5, ALL, 5, EXECUTE, ..] = *data else { return false };
        let on_bus = |axis: &Axis| is_d5_on(axis, bus);
        let mut named: Vec<(Request, Start)> = Vec::new();
        for axis in self.axes.iter_mut().filter(|axis| on_bus(axis)) {
            named.extend(axis.starts_to_come(now).map(|(request, start)| (request, *start)));
        }
        let judged: Vec<_> = named
            .into_iter()
            .filter(|_| id.is_none_or(|id| id & !EXTENDED == u32::from(ALL)))
            .map(|(request, start)| {
                (request, start, self.missing_for_a_start(now, (bus, id), request, &start))
            })
            .collect();
        let Some((request, start, wrong)) = judged.iter().min_by_key(|(.., wrong)| wrong.len())
        else {
            return false;
        };
        self.motions += 1;
        if !wrong.is_empty() {
            self.broken(Check::StartUnproved, now, wrong.join("; "));
        }
        let others = judged.iter().filter(|(other, _, wrong)| other != request && wrong.is_empty());
        held.is_motion = true;
        held.is_harmful = true;
        let leader = (0u8..32).find(|axis| start.members & bit_of(*axis) != 0);
        held.axis = leader;
        // It is the first one's motion: what that had before is replaced, as by any newer setpoint.
        if let Some(axis) = leader.and_then(|leader| self.axes.get_mut(usize::from(leader))) {
            let of_it = |permit: &Permit| (permit.link, permit.sequence) == *request;
            if let Some(place) = axis.permits.iter().rposition(of_it) {
                super::grants::in_force(axis, place);
            }
        }
        held.start = Some(Started {
            request: *request,
            members: start.members,
            may_be: others.map(|(other, ..)| *other).collect(),
        });
        held.data = data.to_vec();
        true
    }

    /// What is missing before a start may be carried out by a frame with this id.
    fn missing_for_a_start(
        &mut self,
        now: u64,
        (bus, id): (u8, Option<u32>),
        request: Request,
        start: &Start,
    ) -> Vec<String> {
        let on_bus = |axis: &Axis| is_d5_on(axis, bus);
        let mut wrong = Vec::new();
        if !self.buses[usize::from(bus)].exclusive {
            wrong.push(format!("bus {bus} is not exclusive"));
        }
        for (index, axis) in (0u8..).zip(&mut self.axes) {
            let is_here = on_bus(axis);
            let is_named = start.members & bit_of(index) != 0;
            let waits =
                axis.starts_to_come(now).find(|(of, _)| *of == request).map(|(_, start)| *start);
            if is_named && !(is_here && axis.armed && waits.is_some_and(|start| start.waits)) {
                wrong.push(format!("axis {index} is named, {waits:?}"));
            }
            let own = id.and_then(|id| axis.request_id().zip(Some(id)));
            if is_named && own.is_some_and(|(own, id)| is_extended(own) != is_extended(id)) {
                wrong.push(format!("axis {index} does not hear {id:X?}"));
            }
            let is_empty = matches!(axis.waiting, Waiting::Nothing(at) if at >= start.asked_us);
            if is_here && !is_named && !is_empty {
                wrong.push(format!("axis {index} is not named, and {:?} waits", axis.waiting));
            }
        }
        wrong
    }

    /// A frame has left: where it has started several, each speed is a setpoint from now on.
    pub(super) fn started(&mut self, now: u64, bus: usize, held: &Held) {
        let Some(Started { request, members, may_be }) = held.start.clone() else { return };
        self.started += 1;
        // Its host may have been told that one of them was stopped while it was on its way.
        let are_armed =
            (0u8..).zip(&self.axes).all(|(index, axis)| members & bit_of(index) == 0 || axis.armed);
        let outcome = (may_be.is_empty() && are_armed).then_some(true);
        for (link, sequence) in may_be.into_iter().chain([request]) {
            let mut records = self.links[usize::from(link)].records.iter_mut();
            let of_it =
                |record: &&mut Record| record.sequence == sequence && record.result.is_none();
            if let Some(record) = records.find(of_it) {
                (record.has_started, record.started_us) = (outcome, Some(now));
            }
        }
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            let is_member = members >> index & 1 == 1 && axis.bus() == Some(bus);
            let Some(node) = axis.node().filter(|_| is_member) else { continue };
            axis.waiting = Waiting::Unknown;
            let of_it = |permit: &Permit| (permit.link, permit.sequence) == request;
            let Some(place) = axis.permits.iter().rposition(of_it) else { continue };
            let permit = &mut axis.permits[place];
            let Some(start) = permit.start.as_mut() else { continue };
            start.has_started = true;
            let [low, high] = start.told.unwrap_or_default();
            let body = [node, 5, 3, 0x20, low, high];
            let sum = body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
            permit.data = Some(std::iter::once(0xD5).chain(body).chain([sum]).collect());
            super::grants::in_force(axis, place);
            self.deliver(now, index);
        }
    }
}
