//! What arrives on a bus, and whom it is for.

use super::Bus;
use super::line::{BYTE_BITS, Heard};
use crate::axes::Axes;
use crate::axis::{Axis, Is};
use crate::filled::filled;
use crate::outbox::Outbox;
use crate::port::Then;
use crate::protocol::{self, Received, Unasked};
use crate::time::Instant;
use host_protocol::{BusKind, CanFrame, CanId, Event, MAX_CAN_DATA, RawFrame, ReceivedFrame};

/// Bits of silence between bytes that belong to different raw frames: two bytes' time.
const RAW_IDLE_BITS: u64 = 20;

impl Bus {
    /// A frame has arrived on a CAN bus.
    pub fn can_received(
        &mut self,
        now: Instant,
        frame: CanFrame,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        self.counters.received = self.counters.received.saturating_add(1);
        self.carried(now);
        if self.has_overdue(axes) {
            self.miss_replies_before(now, CanId(frame.id()), axes, out);
        }
        if let Some(raw) = &mut self.raw {
            raw.keep(ReceivedFrame { time_us: now.as_micros(), frame: RawFrame::Can(frame) });
        }
        let Some(config) = self.config else { return };
        let mut understood = false;
        for received in
            config.protocols.iter().filter_map(|protocol| protocol::from_can(protocol, &frame))
        {
            let wanted = |axis: &&Axis| {
                is_from(axis, &received) && protocol::accepts_id(&axis.config, &frame)
            };
            let sender = self.axes_here(axes).find(wanted).map(|axis| usize::from(axis.index));
            if let Some(axis) = sender.and_then(|index| axes.get_mut(index)) {
                understood = true;
                self.deliver(now, axis, &received, frame.data(), out);
            }
        }
        if !understood {
            self.counters.unmatched = self.counters.unmatched.saturating_add(1);
        }
    }

    /// Whether a frame that is not for its axes changes what may be sent and when: where a reply
    /// with the id of the next frame is due, the bus must have been quiet, what such a reply may
    /// have met has more time, and a late reply may wait for the bus.
    pub fn waits_for_quiet(&self, axes: &Axes) -> bool {
        [Is::OwedOurId, Is::Objecting, Is::ReplyOverdue]
            .into_iter()
            .any(|is| !self.which(is, axes).is_empty())
            || self.in_flight.iter().flatten().any(|f| f.collided_at.is_some())
    }

    /// Bytes have arrived on a serial bus.
    pub fn serial_received(
        &mut self,
        now: Instant,
        bytes: &[u8],
        then: Then,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        if self.kind() != BusKind::Rs485 || self.config.is_none() {
            return;
        }
        let apart = self.bit_time(RAW_IDLE_BITS);
        for byte in bytes {
            let heard = self.line.receive(now, *byte);
            if let Some(raw) = self.raw.as_mut().filter(|_| heard != Heard::Echo) {
                raw.keep_byte(now, *byte, apart);
            }
            if let Heard::Frame(frame) = heard {
                self.serial_frame(now, &frame, axes, out);
            }
        }
        match then {
            Then::Bytes => {}
            Then::Idle => self.line.has_been_idle(now, self.bit_time(BYTE_BITS)),
            Then::Frame => self.begins_held(now),
        }
        self.counters.rejected = self.line.rejected();
    }

    fn serial_frame(&mut self, now: Instant, frame: &[u8], axes: &mut Axes, out: &mut Outbox<'_>) {
        self.counters.received = self.counters.received.saturating_add(1);
        let axis = self.line.serial().and_then(|serial| {
            let received = (serial.decode)(frame)?;
            let sender = self.axes_here(axes).find(|axis| is_from(axis, &received))?;
            let data = frame.get(serial.data_at..)?.first_chunk::<MAX_CAN_DATA>()?;
            Some((axes.get_mut(usize::from(sender.index))?, received, data))
        });
        match axis {
            Some((axis, received, data)) => self.deliver(now, axis, &received, data, out),
            None => self.counters.unmatched = self.counters.unmatched.saturating_add(1),
        }
    }

    fn deliver(
        &mut self,
        now: Instant,
        axis: &mut Axis,
        received: &Received,
        data: &[u8],
        out: &mut Outbox<'_>,
    ) {
        match axis.received(now, received, data, out) {
            None => self.line.answered(),
            Some(Unasked::Notice) => tell(axis.index, data, 0, out),
            Some(Unasked::Telemetry(kind)) => {
                if let Some(unreported) = axis.telemetry.tells(now, kind) {
                    tell(axis.index, data, unreported, out);
                }
            }
            Some(unasked @ (Unasked::Late | Unasked::Objection)) => {
                self.counters.late = self.counters.late.saturating_add(1);
                // A stop has taken the place of what this answers: the line is free for it.
                let is_to_latest =
                    self.last_served == axis.index && !axis.transactions.is_awaited();
                if unasked == Unasked::Late && is_to_latest {
                    self.line.answered();
                }
            }
        }
    }
}

/// Tells the hosts what the motor of an axis has sent unasked.
fn tell(axis: u8, data: &[u8], unreported: u16, out: &mut Outbox<'_>) {
    let length = u8::try_from(data.len()).unwrap_or(u8::MAX);
    out.event(&Event::MotorNotice { axis, data: filled(data.iter().copied()), length, unreported });
}

/// Whether a frame of its bus comes from the axis's motor: from its node, or from the new one while
/// it changes its id.
fn is_from(axis: &Axis, received: &Received) -> bool {
    let node = received.node();
    axis.config.protocol() == Some(received.protocol())
        && axis.config.node().is_some_and(|own| own == node || axis.awaits_node(node))
}
