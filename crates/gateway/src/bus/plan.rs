//! How often the axes of a bus can be given setpoints together, and what else the bus promises:
//! worked out from its configuration alone, by the functions that the bus itself goes by.

use super::frame_bits::{STANDARD_FRAME_BITS, frame_bits};
use super::line::{GAP_BITS, STOP_DELAY, serial_frame_bits};
use super::load::{objections, polled_permille, share, shortest_period, streamed_permille};
use super::schedule::MAX_OUTSTANDING;
use super::{Bus, bits_at};
use crate::MAX_AXES;
use crate::axes::Axes;
use crate::axis::Axis;
use crate::protocol::{self, Exchange, Info};
use crate::set::Set;
use crate::time::Duration;
use core::num::NonZeroU64;
use heapless::Vec;
use host_protocol::{BusKind, Setpoint};

/// A motor's answer has at most so many data bytes.
const REPLY_BYTES: usize = 8;
/// Setpoints that tell the fixed bytes of a command from its value: of one step up and one down all
/// bits of a value in two's complement differ.
const STEPS: [[Setpoint; 2]; 3] = [
    [Setpoint::Velocity { velocity_rad_s: 0.05 }, Setpoint::Velocity { velocity_rad_s: -0.05 }],
    [Setpoint::Signal { fraction: 0.01 }, Setpoint::Signal { fraction: -0.01 }],
    [Setpoint::Current { current_a: 0.02 }, Setpoint::Current { current_a: -0.02 }],
];

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
}

impl Assumptions {
    /// How long a motor takes to begin its reply where nothing is known of it.
    pub const REPLY_DELAY: Duration = super::load::SERIAL_TURNAROUND;
    /// What the software takes, as in the bounds of the stops.
    pub const SOFTWARE: Duration = super::bounds::SOFTWARE;

    /// Nobody else talks, and all axes take part.
    pub const DEFAULT: Self = Self {
        reply_delay: [Self::REPLY_DELAY; MAX_AXES],
        foreign_frames_s: 0,
        software: Self::SOFTWARE,
        axes: Set::ALL,
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
    /// The period at which the cycle repeats beside everything else on the bus; `None` where
    /// nothing is left for it.
    pub period: Option<Duration>,
    /// Below this `RunCycle` is refused: no bit stuffed and no motor slow, fault words are polled
    /// all the same. What lies between it and `period` may hold.
    pub shortest: Option<Duration>,
    /// What a single cycle takes at most: beside everything else, and behind a poll and a foreign
    /// frame that are under way.
    pub longest: Option<Duration>,
    /// The bus's time that polls take, permille.
    pub polls_permille: u64,
    /// And what motors here send by themselves, permille.
    pub streams_permille: u64,
    /// And what others send, permille.
    pub foreign_permille: u64,
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
    /// How long its motor takes to begin its reply.
    pub reply_delay: Duration,
    /// From the first bit of the cycle to the last bit of its reply, on a bus to itself.
    pub answered: Duration,
    /// Within what time its stop has left, after its cause, where it alone stops.
    pub stop_alone: Duration,
    /// And where every axis of the bus stops with it.
    pub stop_together: Duration,
}

/// One axis's part of a cycle on the bus.
#[derive(Debug, Clone, Copy)]
struct Part {
    request: Duration,
    replies: Duration,
    delay: Duration,
    /// Nothing is to come for so long behind it.
    quiet: Duration,
}

impl Part {
    fn frames(self) -> Duration {
        self.request + self.replies
    }

    fn alone(self) -> Duration {
        self.frames() + self.delay + self.quiet
    }
}

impl Bus {
    /// What the bus can do if this is so; `None` where it is not configured.
    pub fn plan(&self, axes: &Axes, assumed: &Assumptions) -> Option<BusPlan> {
        let config = self.config.as_ref()?;
        let here = || self.axes_here(axes).filter(|axis| assumed.axes.has(axis.index));
        let mut plans: Vec<AxisPlan, MAX_AXES> = Vec::new();
        let mut parts: Vec<Part, MAX_AXES> = Vec::new();
        let foreign = self.frame_time(u64::from(assumed.foreign_frames_s));
        let foreign_permille = share(foreign, Duration::from_millis(1_000));
        let (mut polls_permille, mut streams_permille) = (0, 0);
        let mut longest_poll = Duration::ZERO;
        let bounds = self.bounds.beside_foreign(foreign_permille);
        let all = self.here(axes).len().into();
        for axis in here() {
            let delay = assumed.reply_delay.get(usize::from(axis.index));
            let delay = delay.copied().unwrap_or(Assumptions::REPLY_DELAY);
            let (request_bits, reply_bits) = self.motion_bits(axis);
            let poll_bits = self.poll_bits(axis).max(request_bits);
            let replies = u64::from(protocol::replies_to_motion(&axis.config));
            let objections = objections(axis, self.axes_here(axes));
            let frame = self.frame_time(1);
            let (gap, quiet) = match self.kind() {
                BusKind::Rs485 => (bits_at(GAP_BITS, config.bitrate), Duration::ZERO),
                BusKind::Can if objections > 0 => (Duration::ZERO, STOP_DELAY + frame),
                BusKind::Can => (Duration::ZERO, Duration::ZERO),
            };
            let time = |bits| bits_at(bits, config.bitrate);
            let part = |request, replies| Part {
                request: time(request) + gap,
                replies: time(reply_bits).times(replies) + frame.times(objections),
                delay,
                quiet: quiet + gap,
            };
            let poll = part(poll_bits, 1);
            let on_the_bus = match self.kind() {
                BusKind::Can => poll.frames() + poll.quiet,
                BusKind::Rs485 => poll.alone(),
            };
            polls_permille += polled_permille(axis, on_the_bus);
            streams_permille += streamed_permille(axis, frame);
            longest_poll = longest_poll.max(poll.alone());
            let _ = parts.push(part(request_bits, replies));
            let _ = plans.push(AxisPlan {
                axis: axis.index,
                request_bits,
                reply_bits,
                replies,
                reply_delay: delay,
                answered: Duration::ZERO,
                stop_alone: self.bound_beside(&bounds, 1, axes),
                stop_together: self.bound_beside(&bounds, all, axes),
            });
        }
        let in_turn =
            self.kind() == BusKind::Rs485 || parts.iter().any(|part| part.quiet > Duration::ZERO);
        let most = if bounds.outranking_replies > 0 { MAX_OUTSTANDING } else { MAX_AXES };
        let outstanding = if in_turn { 1 } else { most };
        let cycle = schedule(&parts, outstanding, assumed.software, &mut plans);
        let taken = polls_permille + streams_permille + foreign_permille;
        let beside = |time: Duration| {
            let left = NonZeroU64::new(1_000_u64.saturating_sub(taken))?;
            Some(Duration::from_micros((time.as_micros() * 1_000).div_ceil(left.get())))
        };
        let blocked = if foreign_permille > 0 { self.frame_time(1) } else { Duration::ZERO };
        Some(BusPlan {
            wire: parts.iter().fold(Duration::ZERO, |sum, part| {
                sum + if in_turn { part.alone() } else { part.frames() }
            }),
            cycle,
            period: beside(cycle),
            shortest: shortest_period(self, config, here()),
            longest: beside(cycle + longest_poll + blocked),
            polls_permille,
            streams_permille,
            foreign_permille,
            axes: plans,
        })
    }

    /// Bits of an axis's setpoint and of a reply, at most.
    fn motion_bits(&self, axis: &Axis) -> (u64, u64) {
        if self.kind() == BusKind::Rs485 {
            let bits = serial_frame_bits(self.line.serial());
            return (bits, bits);
        }
        let frame = |setpoint: Setpoint| {
            let command = protocol::motion(axis.index, setpoint, &axis.config).ok()?;
            protocol::to_can(&command, &axis.config)
        };
        let steps = STEPS.iter().find_map(|[up, down]| Some((frame(*up)?, frame(*down)?)));
        let request =
            steps.map_or(STANDARD_FRAME_BITS.max(self.longest_frame_bits), |(up, down)| {
                let same = up.data().iter().zip(down.data()).take_while(|(up, down)| up == down);
                let known = up.data().get(..same.count()).unwrap_or(&[]);
                frame_bits(up.id(), up.data().len(), known)
            });
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

/// Lays the frames of a cycle one behind the other: a reply as soon as it is ready and the bus is
/// free, else the next request, `software` behind the one before, while fewer than `outstanding`
/// wait for their replies. Notes when each is answered; returns when all are.
fn schedule(
    parts: &[Part],
    outstanding: usize,
    software: Duration,
    plans: &mut [AxisPlan],
) -> Duration {
    let mut ready: [Option<Duration>; MAX_AXES] = [None; MAX_AXES];
    let (mut free, mut next_request, mut requested) = (Duration::ZERO, Duration::ZERO, 0);
    loop {
        let waiting = ready.iter().flatten().count();
        let request = parts.get(requested).filter(|_| waiting < outstanding);
        let request_at = request.map(|_| free.max(next_request));
        let earliest = ready.iter().enumerate().filter_map(|(place, at)| Some((place, (*at)?)));
        let reply = earliest.min_by_key(|(_, at)| *at).map(|(place, at)| (place, free.max(at)));
        match (request, request_at, reply) {
            (_, request_at, Some((place, at))) if request_at.is_none_or(|other| at <= other) => {
                let Some(part) = parts.get(place) else { return free };
                free = at + part.replies + part.quiet;
                if let Some(plan) = plans.get_mut(place) {
                    plan.answered = at + part.replies;
                }
                if let Some(ready) = ready.get_mut(place) {
                    *ready = None;
                }
            }
            (Some(part), Some(at), _) => {
                free = at + part.request;
                next_request = free + software;
                if let Some(ready) = ready.get_mut(requested) {
                    *ready = Some(free + part.delay);
                }
                requested += 1;
            }
            _ => return free,
        }
    }
}
