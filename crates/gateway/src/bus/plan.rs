//! How often the axes of a bus can be given setpoints together, and what else the bus promises:
//! worked out from its configuration alone, by the functions that the bus itself goes by.

use super::bounds::left_of;
use super::frame_bits::{EXTENDED_FRAME_BITS, STANDARD_FRAME_BITS, frame_bits};
use super::line::{PAUSE_BITS, STOP_DELAY, serial_frame_bits};
use super::load::{
    REPLY_BYTES, objections, polled_permille, replies_to_motion, share, shortest_period,
    streamed_permille, unanswered_wait,
};
use super::schedule::MAX_OUTSTANDING;
use super::{Bus, bits_at};
use crate::MAX_AXES;
use crate::axes::Axes;
use crate::axis::Axis;
use crate::protocol::{self, Exchange, Info};
use crate::set::Set;
use crate::time::Duration;
use heapless::Vec;
use host_protocol::{AxisParameter, BusKind, Error, Setpoint, StateFields};

/// Setpoints that tell the fixed bytes at the beginning of a command from its value: every protocol
/// takes them, and the first byte of the value differs, whether a sign is a bit or a complement.
const STEPS: [[Setpoint; 2]; 4] = [
    [Setpoint::Velocity { velocity_rad_s: 4.0 }, Setpoint::Velocity { velocity_rad_s: -8.0 }],
    [Setpoint::Signal { fraction: 0.01 }, Setpoint::Signal { fraction: -0.02 }],
    [Setpoint::Current { current_a: 0.02 }, Setpoint::Current { current_a: -0.04 }],
    [POSITION, Setpoint::Position { position_rad: 0.0, speed_limit_rad_s: 35.0 }],
];

const POSITION: Setpoint = Setpoint::Position { position_rad: 0.0, speed_limit_rad_s: 3.5 };

/// An impedance setpoint.
const STIFF: Setpoint = Setpoint::Impedance {
    position_rad: 0.0,
    velocity_rad_s: 0.0,
    stiffness_nm_per_rad: 0.0,
    damping_nm_s_per_rad: 0.0,
    torque_nm: 0.0,
};

/// What a plan takes for granted of what no configuration says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assumptions {
    /// From the last bit of a request to the first bit of the motor's reply, by axis.
    pub reply_delay: [Duration; MAX_AXES],
    /// Frames of others on the bus in a second, evenly spread, each of the longest.
    pub foreign_frames_s: u32,
    /// What the gateway takes from the host's last byte to a bus, from one frame to the next, and
    /// from a motor's reply to the host.
    pub software: Duration,
    /// The axes that take part.
    pub axes: Set,
    /// Those of them that are given impedance setpoints, whose replies do not tell the speed.
    pub impedance: Set,
    /// What a free-running cycle tells of every axis.
    pub fields: StateFields,
}

impl Assumptions {
    /// How long a motor takes to begin its reply where nothing is known of it.
    pub const REPLY_DELAY: Duration = super::load::SERIAL_TURNAROUND;
    /// What the software takes, as in the bounds of the stops.
    pub const SOFTWARE: Duration = super::bounds::SOFTWARE;

    /// Nobody else talks, all axes take part, and nothing is read beside setpoints.
    pub const DEFAULT: Self = Self {
        reply_delay: [Self::REPLY_DELAY; MAX_AXES],
        foreign_frames_s: 0,
        software: Self::SOFTWARE,
        axes: Set::ALL,
        impedance: Set::NONE,
        fields: StateFields::of(&[]),
    };
}

/// One bus, as planned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BusPlan {
    /// What all frames of one cycle take on the wire, nothing between them; where motors are asked
    /// in turn, with what they take to begin their replies.
    pub wire: Duration,
    /// From the first bit of a cycle to the last bit of its last reply, on a bus to itself.
    pub cycle: Duration,
    /// How often one `Cycle` can follow another beside everything else on the bus; `None` where
    /// nothing is left for it.
    pub repeat: Option<Duration>,
    /// The period that `RunCycle` holds beside everything else: setpoints, and what is read beside
    /// them; `None` where nothing is left for it. One with polls in it may end later than the next
    /// begins.
    pub period: Option<Duration>,
    /// From this period on none does.
    pub steady: Option<Duration>,
    /// Below this `RunCycle` is refused: no bit stuffed and no motor slow, fault words are polled
    /// all the same. What lies between it and `period` may hold.
    pub shortest: Option<Duration>,
    /// What a single `Cycle` takes at most: beside everything else, and behind a poll of each axis.
    pub longest: Option<Duration>,
    /// The bus's time that polls take, permille.
    pub polls_permille: u64,
    /// And what motors here send by themselves, permille.
    pub streams_permille: u64,
    /// And what others send, permille.
    pub foreign_permille: u64,
    /// How long a motor has for its reply.
    pub reply_window: Duration,
    /// The axes that take part, in their order.
    pub axes: Vec<AxisPlan, MAX_AXES>,
}

/// One axis, as planned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxisPlan {
    /// Which.
    pub axis: u8,
    /// Bits of its setpoint's frame on the bus, at most: stuffed as what is known of it says, with
    /// intermission; on RS485 with start and stop bits.
    pub request_bits: u64,
    /// Bits of a reply likewise.
    pub reply_bits: u64,
    /// Frames that answer a setpoint.
    pub replies: u64,
    /// Whether it takes position setpoints: two numbers, which the host's line carries.
    pub takes_position: bool,
    /// Requests of a period of `RunCycle` beside the setpoint.
    pub reads: u64,
    /// How long its motor takes to begin its reply.
    pub reply_delay: Duration,
    /// Whether its motor is set so that it can confirm a stop; else it is never armed.
    pub can_confirm: bool,
    /// How long a setpoint of it lives at most; `None` where it is configured without expiry.
    pub life: Option<Duration>,
    /// From the first bit of the cycle to the last bit of its reply, on a bus to itself.
    pub answered: Duration,
    /// From the last bit of a request to that of its reply, at most, while all that `steady` has
    /// room for goes first.
    pub reply_within: Duration,
    /// Whether it counts then: on a bus to itself it is there within the reply window. What goes
    /// before it on CAN is waited for.
    pub reply_counts: bool,
    /// Within what time its stop has left, after its cause, where it alone stops; `None` where
    /// others leave the bus no time for it.
    pub stop_alone: Option<Duration>,
    /// And where every axis of the bus stops with it.
    pub stop_together: Option<Duration>,
}

/// A request and what answers it.
#[derive(Debug, Clone, Copy)]
struct Step {
    request: Duration,
    replies: Duration,
    delay: Duration,
    /// Nothing is to come for so long behind it.
    quiet: Duration,
}

impl Step {
    fn frames(self) -> Duration {
        self.request + self.replies
    }

    fn alone(self) -> Duration {
        self.frames() + self.delay + self.quiet
    }
}

/// One axis's part of a cycle on the bus: a setpoint, and what a running cycle reads beside it.
#[derive(Debug, Clone, Copy)]
struct Part {
    motion: Step,
    poll: Step,
    reads: u64,
}

/// What each axis is asked beside its setpoint.
#[derive(Debug, Clone, Copy, Default)]
struct Beside {
    /// Requests that go before it; the first of several is the setpoint before.
    before: u64,
    /// Whether a running cycle reads.
    reads: bool,
    /// Polls behind it.
    behind: u64,
}

impl Bus {
    /// What the bus can do if this is so; `None` where it is not configured.
    pub fn plan(&self, axes: &Axes, assumed: &Assumptions) -> Option<BusPlan> {
        let config = self.config.as_ref()?;
        let here = || self.axes_here(axes).filter(|axis| assumed.axes.has(axis.index));
        let mut plans: Vec<AxisPlan, MAX_AXES> = Vec::new();
        let mut parts: Vec<Part, MAX_AXES> = Vec::new();
        let mut refreshes: Vec<(Duration, u64), MAX_AXES> = Vec::new();
        // Nobody says that their ids are short.
        let foreign_frame = self.bit_time(EXTENDED_FRAME_BITS);
        let foreign = foreign_frame.times(assumed.foreign_frames_s.into());
        let foreign_permille = share(foreign, Duration::from_millis(1_000));
        let (mut polls_permille, mut longest_wait_permille, mut streams_permille) = (0, 0, 0);
        let bounds = self.bounds.beside_foreign(foreign_permille, foreign_frame);
        let all = self.here(axes).len().into();
        let stop = |stops| {
            left_of(bounds.streamed_permille).map(|_| self.bound_beside(&bounds, stops, axes))
        };
        for axis in here() {
            let delay = assumed.reply_delay.get(usize::from(axis.index));
            let delay = delay.copied().unwrap_or(Assumptions::REPLY_DELAY);
            let is_stiff = assumed.impedance.has(axis.index);
            let (request_bits, reply_bits) = self.motion_bits(axis, is_stiff);
            let poll_bits = self.poll_bits(axis).max(request_bits);
            let replies = replies_to_motion(axis);
            let reads = axis.period_reads(assumed.fields, !is_stiff).count() as u64;
            let objections = objections(axis, self.axes_here(axes));
            let frame = self.frame_time(1);
            let (gap, quiet) = match self.kind() {
                BusKind::Rs485 => (bits_at(PAUSE_BITS, config.bitrate), Duration::ZERO),
                BusKind::Can if objections > 0 => (Duration::ZERO, STOP_DELAY + frame),
                BusKind::Can => (Duration::ZERO, Duration::ZERO),
            };
            let time = |bits| bits_at(bits, config.bitrate);
            let step = |request, replies| Step {
                request: time(request) + gap,
                replies: time(reply_bits).times(replies) + frame.times(objections),
                delay: if replies > 0 { delay } else { unanswered_wait(self.kind(), config) },
                quiet: quiet + gap,
            };
            let poll = step(poll_bits, 1);
            let on_the_bus = match self.kind() {
                BusKind::Can => poll.frames() + poll.quiet,
                BusKind::Rs485 => poll.alone(),
            };
            let polled = polled_permille(axis, on_the_bus);
            polls_permille += polled;
            // The axis itself waits for the reply to its poll, too, and then begins anew.
            let waits = polled_permille(axis, poll.alone() + assumed.software) - polled;
            longest_wait_permille = longest_wait_permille.max(waits);
            streams_permille += streamed_permille(axis, frame);
            let motion = step(request_bits, replies);
            let _ = refreshes.push((axis.refresh(), share(motion.alone(), axis.refresh())));
            let _ = parts.push(Part { motion, poll, reads });
            let _ = plans.push(AxisPlan {
                axis: axis.index,
                request_bits,
                reply_bits,
                replies,
                takes_position: takes_position(axis),
                reads,
                reply_delay: delay,
                can_confirm: protocol::can_confirm(&axis.config),
                life: (!axis.config.flag(AxisParameter::UnsafeInfiniteTtl))
                    .then(|| axis.config.ttl()),
                answered: Duration::ZERO,
                reply_within: Duration::ZERO,
                reply_counts: false,
                stop_alone: stop(1),
                stop_together: stop(all),
            });
        }
        let in_turn = self.kind() == BusKind::Rs485
            || parts.iter().any(|part| part.motion.quiet > Duration::ZERO);
        let most = if bounds.outranking_replies > 0 { MAX_OUTSTANDING } else { MAX_AXES };
        let outstanding = if in_turn { 1 } else { most };
        let lasts = |beside| schedule(&parts, beside, outstanding, assumed.software, |_, _| {});
        // The setpoint before is on its way, and a poll is due.
        let longest = lasts(Beside { before: 2, ..Beside::default() });
        let period = lasts(Beside { reads: true, ..Beside::default() });
        // The fault word and the state may be due at once.
        let steady = lasts(Beside { before: 1, reads: true, behind: 1 });
        let cycle =
            schedule(&parts, Beside::default(), outstanding, assumed.software, |place, at| {
                if let Some(plan) = plans.get_mut(place) {
                    plan.answered = at;
                }
            });
        let taken = polls_permille + longest_wait_permille + streams_permille + foreign_permille;
        let with_taken = |time: Duration, taken: u64| {
            let left = left_of(taken)?;
            Some(Duration::from_micros((time.as_micros() * 1_000).div_ceil(left.get())))
        };
        let beside = |time: Duration| {
            let mut found = with_taken(time, taken)?;
            loop {
                // Setpoints are sent again in what takes so long.
                let again = refreshes.iter().filter(|(refresh, _)| *refresh < found);
                let longer = with_taken(time, taken + again.map(|(_, share)| share).sum::<u64>())?;
                if longer <= found {
                    return Some(found);
                }
                found = longer;
            }
        };
        let at_once = bounds.streamed_at_once;
        // On a line nobody else talks meanwhile.
        let frames = |part: &Part| match self.kind() {
            BusKind::Can => part.motion.frames() + part.poll.frames().times(2 + part.reads),
            BusKind::Rs485 => Duration::ZERO,
        };
        let all = parts.iter().map(frames).fold(at_once, |sum, frames| sum + frames);
        for (part, plan) in parts.iter().zip(&mut plans) {
            let alone = part.poll.delay + part.motion.replies.max(part.poll.replies);
            plan.reply_counts = alone <= self.reply_window();
            let within = alone + all - frames(part);
            plan.reply_within = match plan.reply_counts {
                // When the window is over the gateway sends nothing before it.
                true => within.min(self.bounds.longest_reply),
                false => within,
            };
        }
        Some(BusPlan {
            wire: parts.iter().fold(Duration::ZERO, |sum, Part { motion, .. }| {
                sum + if in_turn { motion.alone() } else { motion.frames() }
            }),
            cycle,
            repeat: beside(cycle),
            period: beside(period),
            steady: beside(steady + at_once),
            shortest: shortest_period(self, config, here(), assumed.fields),
            longest: beside(longest + at_once),
            polls_permille,
            streams_permille,
            foreign_permille,
            reply_window: self.reply_window(),
            axes: plans,
        })
    }

    /// Bits of an axis's longest setpoint and of a reply, at most; of an impedance setpoint any bit
    /// of the data is unknown.
    fn motion_bits(&self, axis: &Axis, is_stiff: bool) -> (u64, u64) {
        if self.kind() == BusKind::Rs485 {
            let bits = serial_frame_bits(self.line.serial());
            return (bits, bits);
        }
        let frame = |setpoint: Setpoint| {
            let command = protocol::motion(axis.index, setpoint, &axis.config).ok()?;
            protocol::to_can(&command, &axis.config)
        };
        if is_stiff && let Some(stiff) = frame(STIFF) {
            let request = frame_bits(stiff.id(), stiff.data().len(), &[]);
            return (request, self.longest_frame_bits);
        }
        let steps = STEPS.iter().filter_map(|[one, other]| {
            let (one, other) = (frame(*one)?, frame(*other)?);
            let same = one.data().iter().zip(other.data()).take_while(|(one, other)| one == other);
            let known = one.data().get(..same.count()).unwrap_or(&[]);
            Some(frame_bits(one.id(), one.data().len(), known))
        });
        let request = steps.max().unwrap_or(STANDARD_FRAME_BITS.max(self.longest_frame_bits));
        let reply = protocol::reply_id(&axis.config)
            .map_or(self.longest_frame_bits, |id| frame_bits(id, REPLY_BYTES, &[]));
        (request, reply)
    }

    /// Bits of the longest poll of an axis.
    fn poll_bits(&self, axis: &Axis) -> u64 {
        if self.kind() == BusKind::Rs485 {
            return serial_frame_bits(self.line.serial());
        }
        let asked = Info::of_axis(&axis.config).map_or(&[][..], |info| info.state);
        let bits = |exchange: &Exchange| {
            let command = protocol::command(*exchange, &axis.config)?;
            let frame = protocol::to_can(&command, &axis.config)?;
            Some(frame_bits(frame.id(), frame.data().len(), frame.data()))
        };
        let all = asked.iter().chain(&[Exchange::Faults, Exchange::RunTime]);
        all.filter_map(bits).max().unwrap_or(self.longest_frame_bits)
    }
}

/// Whether the axis takes position setpoints, whatever it makes of this one.
fn takes_position(axis: &Axis) -> bool {
    let made = protocol::motion(axis.index, POSITION, &axis.config);
    !matches!(made, Err(Error::Unsupported { .. } | Error::NotConfigured { .. }))
}

/// Where an axis is in a cycle.
#[derive(Debug)]
struct Turn<'a> {
    place: usize,
    part: &'a Part,
    /// How many requests go before its setpoint, and how many there are.
    before: u64,
    requests: u64,
    /// How many have left.
    asked: u64,
    /// When the next may leave.
    from: Duration,
    /// When the reply to the last begins, where that is still to come.
    ready: Option<Duration>,
}

impl Turn<'_> {
    fn may_ask(&self) -> bool {
        self.ready.is_none() && self.asked < self.requests
    }

    /// The request with the number, from 0.
    fn step(&self, number: u64) -> Step {
        let is_motion = number == self.before || number + 1 < self.before;
        if is_motion { self.part.motion } else { self.part.poll }
    }
}

/// Lays the frames of a cycle one behind the other: a reply as soon as it is ready and the bus is
/// free, else the next request, `software` behind the one before and behind the reply that it waited
/// for, while fewer than `outstanding` wait for their replies. Tells when each request is answered,
/// by the place of its axis; returns when all are.
fn schedule(
    parts: &[Part],
    Beside { before, reads, behind }: Beside,
    outstanding: usize,
    software: Duration,
    mut answered: impl FnMut(usize, Duration),
) -> Duration {
    let turns = parts.iter().enumerate().map(|(place, part)| Turn {
        place,
        part,
        before,
        requests: before + 1 + if reads { part.reads } else { 0 } + behind,
        asked: 0,
        from: Duration::ZERO,
        ready: None,
    });
    let mut turns: Vec<Turn<'_>, MAX_AXES> = turns.collect();
    let (mut free, mut next_request) = (Duration::ZERO, Duration::ZERO);
    loop {
        let waiting = turns.iter().filter(|turn| turn.ready.is_some()).count();
        let reply_at = turns.iter().filter_map(|turn| turn.ready).min().map(|at| at.max(free));
        let earliest = free.max(next_request);
        // Who can ask first, and of these who has been asked least.
        let order = |turn: &Turn<'_>| (turn.from.max(earliest), turn.asked);
        let request = turns.iter().filter(|turn| turn.may_ask()).map(order).min();
        let request = request.filter(|_| waiting < outstanding);
        match (request, reply_at) {
            (_, Some(at)) if request.is_none_or(|(other, _)| at <= other) => {
                let waits = turns.iter_mut().filter(|turn| turn.ready.is_some());
                let Some(turn) = waits.min_by_key(|turn| turn.ready) else { return free };
                let step = turn.step(turn.asked - 1);
                let end = at + step.replies;
                free = end + step.quiet;
                turn.ready = None;
                turn.from = end + software;
                if outstanding == 1 {
                    next_request = turn.from;
                }
                answered(turn.place, end);
            }
            (Some((at, _)), _) => {
                let may_ask = turns.iter_mut().filter(|turn| turn.may_ask());
                let Some(turn) = may_ask.min_by_key(|turn| order(turn)) else { return free };
                let step = turn.step(turn.asked);
                free = at + step.request;
                next_request = free + software;
                turn.ready = Some(free + step.delay);
                turn.asked += 1;
            }
            _ => return free,
        }
    }
}
