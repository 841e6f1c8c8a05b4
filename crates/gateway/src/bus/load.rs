//! Whether what the axes of a bus must send and hear fits on it.

use super::frame_bits::{least_frame_bits, longest_frame_bits};
use super::line::{PAUSE_BITS, STOP_DELAY, serial_frame_bits, serial_of};
use super::{Bus, bits_at};
use crate::axis::Axis;
use crate::protocol::{self, Exchange};
use crate::time::Duration;
use core::num::NonZeroU64;
use host_protocol::{BusConfig, BusKind, Error, StateFields};

/// The part of a bus's time that refresh and polls may take; the rest is for stops, jobs and
/// retries. Permille.
const AVAILABLE_PERMILLE: u32 = 800;
/// A motor's answer has at most so many data bytes.
pub(super) const REPLY_BYTES: usize = 8;
/// What a motor on RS485 takes to begin its reply.
pub(super) const SERIAL_TURNAROUND: Duration = Duration::from_micros(250);

/// Refuses axes whose refresh and polls cannot be scheduled on the bus.
pub(crate) fn check<'a>(
    bus: &Bus,
    config: &BusConfig,
    axes: impl Iterator<Item = &'a Axis> + Clone,
) -> Result<(), Error> {
    let frame_bits = longest_frame_bits(axes.clone());
    let exchange = exchange_time(bus.kind(), frame_bits, config);
    let frame = bits_at(frame_bits, config.bitrate);
    let needed_by = |axis: &Axis| {
        let objections = objections(axis, axes.clone());
        // Behind them nothing is to come for a while, before the next request.
        let quiet = if objections > 0 { STOP_DELAY + frame } else { Duration::ZERO };
        let exchange = exchange + frame.times(objections) + quiet;
        // The others are kept waiting as if an answer could come.
        let motion = match replies_to_motion(axis) {
            0 => exchange + unanswered_wait(bus.kind(), config),
            replies => exchange + frame.times(replies - 1),
        };
        share(motion, axis.refresh())
            + polled_permille(axis, exchange)
            + streamed_permille(axis, frame)
    };
    let needed: u64 = axes.clone().map(needed_by).sum();
    let needed = u32::try_from(needed).unwrap_or(u32::MAX);
    if needed <= AVAILABLE_PERMILLE {
        return Ok(());
    }
    Err(Error::BusOverloaded {
        bus: bus.index,
        needed_permille: needed,
        available_permille: AVAILABLE_PERMILLE,
    })
}

/// How many other motors of the bus answer a request to this one by saying that it was not for
/// them.
pub(super) fn objections<'a>(axis: &Axis, axes: impl Iterator<Item = &'a Axis>) -> u64 {
    axes.filter(|other| other.index != axis.index && other.transactions.objects).count() as u64
}

/// Time that one request and its reply take.
fn exchange_time(kind: BusKind, frame_bits: u64, config: &BusConfig) -> Duration {
    match kind {
        BusKind::Can => bits_at(2 * frame_bits, config.bitrate),
        BusKind::Rs485 => {
            let frame_bits = serial_frame_bits(serial_of(config.protocols));
            bits_at(2 * frame_bits + 2 * PAUSE_BITS, config.bitrate) + SERIAL_TURNAROUND
        }
    }
}

/// The shortest period in which the bus might serve these of its axes: a setpoint to each and what
/// a cycle that tells these fields reads beside it, no bit stuffed and no motor slow, beside the
/// polls of their fault words and what they send by themselves; `None` where those leave no time.
pub(crate) fn shortest_period<'a>(
    bus: &Bus,
    config: &BusConfig,
    axes: impl Iterator<Item = &'a Axis>,
    fields: StateFields,
) -> Option<Duration> {
    const SECOND_US: u64 = 1_000_000;
    let (mut cycle, mut others_us) = (Duration::ZERO, 0);
    for axis in axes {
        let id = protocol::reply_id(&axis.config);
        let frame = |bytes| match bus.kind() {
            BusKind::Can => least_frame_bits(id, bytes),
            BusKind::Rs485 => serial_frame_bits(serial_of(config.protocols)),
        };
        let time = |bits| bits_at(bits, config.bitrate);
        let reply = frame(REPLY_BYTES);
        let exchange = |exchange, replies| {
            let command = protocol::command(exchange, &axis.config);
            let sent = command.and_then(|command| protocol::to_can(&command, &axis.config));
            time(frame(sent.map_or(0, |frame| frame.data().len())) + replies * reply)
        };
        // A setpoint has as many bytes as a stop.
        let replies = replies_to_motion(axis);
        cycle = cycle + exchange(Exchange::Stop, replies);
        if replies == 0 {
            cycle = cycle + unanswered_wait(bus.kind(), config);
        }
        let reads = axis.period_reads(fields, true);
        cycle = reads.fold(cycle, |cycle, read| cycle + exchange(read, 1));
        let in_a_second = |time: Duration, every: Duration| {
            time.as_micros() * SECOND_US / every.as_micros().max(1)
        };
        others_us += in_a_second(exchange(Exchange::Faults, 1), axis.config.fault_poll());
        if let Some(stream) = protocol::stream(&axis.config) {
            others_us += in_a_second(time(reply).times(stream.frames), stream.interval);
        }
    }
    let left_us = NonZeroU64::new(SECOND_US.saturating_sub(others_us))?;
    Some(Duration::from_micros(cycle.as_micros() * SECOND_US / left_us))
}

/// How many frames answer a setpoint; none where the motor answers no writes.
pub(super) fn replies_to_motion(axis: &Axis) -> u64 {
    let replies = protocol::replies_to_motion(&axis.config);
    if protocol::answers_stops(&axis.config) { replies.into() } else { 0 }
}

/// How long the bus is kept for an answer to what is not answered: a line has no arbitration.
pub(super) fn unanswered_wait(kind: BusKind, config: &BusConfig) -> Duration {
    match kind {
        BusKind::Can => Duration::ZERO,
        BusKind::Rs485 => Duration::from_micros(config.reply_window_us.into()),
    }
}

/// The share of the bus that the polls of an axis take, each of which takes `poll`, while setpoints
/// go out.
#[inline(never)]
pub(super) fn polled_permille(axis: &Axis, poll: Duration) -> u64 {
    let (polls, span) = axis.polls_in_motion();
    share(poll, axis.config.fault_poll()) + share(poll.times(polls), span)
}

/// The share of the bus that goes to the frames which the axis's motor sends by itself.
pub(super) fn streamed_permille(axis: &Axis, frame: Duration) -> u64 {
    protocol::stream(&axis.config)
        .map_or(0, |stream| share(frame.times(stream.frames), stream.interval))
}

/// The part of each period that so much time is, permille, rounded up.
pub(super) fn share(time: Duration, period: Duration) -> u64 {
    (time.as_micros() * 1_000).div_ceil(period.as_micros().max(1))
}
