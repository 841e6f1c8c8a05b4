//! What the peers on the virtual buses have in common, and a node that only listens and sends what
//! a test tells it.

mod alarm;
mod drive;
mod probe;
#[cfg(test)]
pub(crate) mod test_bus;

pub(crate) use alarm::Alarm;
pub use probe::{Heard, Probe};

use std::time::Duration;

use embedded_can::{Frame as _, Id};
use host_protocol::CanFrame;
use mgw_sim::{Motor, Outgoing};
use rigless::chip::can;
use rigless::time::VirtualNanos;

/// The instant as a span since the start of the run, which is how the simulator's motors count
/// time.
pub fn since_start(at: VirtualNanos) -> Duration {
    Duration::from_nanos(at.0)
}

/// The instant `since_start` after the start of the run; the clock's end for more than 584 years.
pub fn instant(since_start: Duration) -> VirtualNanos {
    VirtualNanos(u64::try_from(since_start.as_nanos()).unwrap_or(u64::MAX))
}

/// A frame of the project as the emulator's buses carry it.
pub fn to_bus(frame: &CanFrame) -> can::Frame {
    let id = match frame.id() {
        Id::Standard(id) => can::Id::Standard(id.as_raw()),
        Id::Extended(id) => can::Id::Extended(id.as_raw()),
    };
    if frame.is_remote_frame() {
        return can::Frame::remote_frame(id, u8::try_from(frame.dlc()).unwrap_or_default());
    }
    can::Frame::data_frame(id, frame.data())
}

/// A frame of the emulator's buses as the project knows it. A length code above 8, which carries 8
/// bytes, becomes 8; `None` for an identifier that does not fit its format.
pub fn from_bus(frame: &can::Frame) -> Option<CanFrame> {
    let id = match frame.id {
        can::Id::Standard(raw) => Id::Standard(embedded_can::StandardId::new(raw)?),
        can::Id::Extended(raw) => Id::Extended(embedded_can::ExtendedId::new(raw)?),
    };
    if frame.remote {
        return CanFrame::remote_frame(id, frame.dlc.min(8));
    }
    CanFrame::data_frame(id, frame.payload())
}

/// Lets a motor do everything that it does by itself up to `now`, in order; what it sends goes to
/// `sends`.
pub(crate) fn catch_up(motor: &mut Motor, now: Duration, mut sends: impl FnMut(Outgoing)) {
    while let Some(at) = motor.next_event().filter(|at| *at <= now) {
        motor.advance(at);
        while let Some(message) = motor.take_ready(at) {
            sends(message);
        }
    }
    motor.advance(now);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_survive_the_way_to_the_bus_and_back() {
        let remote = Id::Standard(embedded_can::StandardId::new(0x7FF).unwrap());
        let frames = [
            CanFrame::standard(0x141, &[0xA1, 0, 0, 0, 0x64, 0, 0, 0]).unwrap(),
            CanFrame::standard(0, &[]).unwrap(),
            CanFrame::extended(0x1FFF_FFFF, &[1, 2, 3]).unwrap(),
            CanFrame::remote_frame(remote, 4).unwrap(),
        ];
        for frame in frames {
            assert_eq!(from_bus(&to_bus(&frame)), Some(frame));
        }
    }

    #[test]
    fn a_length_code_above_eight_is_eight_bytes() {
        let mut frame = can::Frame::data_frame(can::Id::Standard(1), &[1, 2, 3, 4, 5, 6, 7, 8]);
        frame.dlc = 15;
        let known = from_bus(&frame).unwrap();
        assert_eq!(known.data(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}
