//! Whether what the axes of a bus must send and hear fits on it.

use super::frame_bits::longest_frame_bits;
use super::line::{GAP_BITS, STOP_DELAY, serial_frame_bits, serial_of};
use super::{Bus, bits_at};
use crate::axis::Axis;
use crate::protocol;
use crate::time::Duration;
use host_protocol::{BusConfig, BusKind, Error};

/// The part of a bus's time that refresh and polls may take; the rest is for stops, jobs and
/// retries. Permille.
const AVAILABLE_PERMILLE: u32 = 800;
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
        needed_permille(axis, exchange, frame)
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

/// How many other motors of the bus answer a request to this one by saying that it was not for them.
pub(super) fn objections<'a>(axis: &Axis, axes: impl Iterator<Item = &'a Axis>) -> u64 {
    axes.filter(|other| other.index != axis.index && other.transactions.objects()).count() as u64
}

/// Time that one request and its reply take.
fn exchange_time(kind: BusKind, frame_bits: u64, config: &BusConfig) -> Duration {
    match kind {
        BusKind::Can => bits_at(2 * frame_bits, config.bitrate),
        BusKind::Rs485 => {
            let frame_bits = serial_frame_bits(serial_of(config.protocols));
            bits_at(2 * frame_bits + 2 * GAP_BITS, config.bitrate) + SERIAL_TURNAROUND
        }
    }
}

/// Time that no exchange is shorter than: on CAN four bytes out and eight back without a stuff bit,
/// which is what the shortest motors take; on RS485 the bytes of both frames.
pub(crate) fn shortest_exchange(kind: BusKind, config: &BusConfig) -> Duration {
    const CAN_BITS: u64 = 79 + 111;
    let bits = match kind {
        BusKind::Can => CAN_BITS,
        BusKind::Rs485 => 2 * serial_frame_bits(serial_of(config.protocols)),
    };
    bits_at(bits, config.bitrate)
}

/// The share of the bus that one axis takes while it is moving. `frame`: what each further reply to
/// a motion takes.
fn needed_permille(axis: &Axis, exchange: Duration, frame: Duration) -> u64 {
    let motion = exchange + frame.times(u64::from(protocol::replies_to_motion(&axis.config)) - 1);
    share(motion, axis.refresh())
        + share(exchange, axis.config.fault_poll())
        + share(exchange, axis.config.state_poll())
        + streamed_permille(axis, frame)
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
