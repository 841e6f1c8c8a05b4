//! The motors of the simulator as nodes of a virtual CAN bus.

use std::collections::VecDeque;
use std::fmt;

use mgw_sim::{Injection, Motor, MotorWiring, Outgoing, Wire, WiringError};
use rigless::chip::Timeline;
use rigless::chip::can::{Fault, Frame, Offer, Peer};
use rigless::snapshot::store;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use crate::nodes::{Alarm, catch_up, from_bus, instant, since_start, to_bus};

/// Frames that a motor's controller holds; on a dead bus the oldest is lost.
const QUEUE: usize = 8;

/// A frame in a motor's controller.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Waiting {
    since: VirtualNanos,
    frame: Frame,
    corrupt: bool,
}

/// A motor and its CAN controller.
///
/// Whether the bus understands it, and its error counters, are the bus's business: hang it there at
/// its own [`bitrate`](CanMotor::bitrate). A snapshot keeps the whole motor.
#[derive(Serialize, Deserialize)]
#[serde(bound(deserialize = "'de: 'static"))]
pub struct CanMotor {
    motor: Motor,
    queue: VecDeque<Waiting>,
    alarm: Alarm,
}

store!(CanMotor);

impl CanMotor {
    /// A motor at rest. `seed` decides its reply times and its garbage.
    /// Fails if its protocol has no such node.
    pub fn new(wiring: MotorWiring, seed: u64) -> Result<Self, WiringError> {
        Ok(Self {
            motor: Motor::on_can(wiring, seed)?,
            queue: VecDeque::new(),
            alarm: Alarm::default(),
        })
    }

    /// Its bitrate, bit/s.
    pub fn bitrate(&self) -> u32 {
        self.motor.bitrate()
    }

    /// The motor: its shaft, its faults, its log.
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Puts a fault into the motor, or takes it out again.
    ///
    /// With [`Injection::Unplugged`] it hears and sends nothing; that it acknowledges nothing
    /// either takes the bus's own silencing of a node.
    pub fn inject(&mut self, injection: Injection, timeline: &mut Timeline<'_, '_>) {
        self.live(timeline, |motor, now| motor.inject(now, injection));
    }

    /// Switches the motor off and on again: what it was about to send is lost.
    pub fn power_cycle(&mut self, timeline: &mut Timeline<'_, '_>) {
        self.live(timeline, Motor::power_cycle);
        self.queue.clear();
    }

    /// Brings the motor to the present, does something with it, and waits for what it does next.
    fn live(
        &mut self,
        timeline: &mut Timeline<'_, '_>,
        act: impl FnOnce(&mut Motor, std::time::Duration),
    ) {
        let now = since_start(timeline.now());
        let Self { motor, queue, alarm } = self;
        catch_up(motor, now, |message| enqueue(queue, message));
        act(motor, now);
        catch_up(motor, now, |message| enqueue(queue, message));
        alarm.set(motor.next_event(), timeline);
    }
}

fn enqueue(queue: &mut VecDeque<Waiting>, Outgoing { at, wire, corrupt }: Outgoing) {
    // A motor made for CAN sends nothing else.
    let Wire::Can(frame) = wire else { return };
    if queue.len() == QUEUE {
        queue.pop_front();
    }
    queue.push_back(Waiting { since: instant(at), frame: to_bus(&frame), corrupt });
}

impl Peer for CanMotor {
    fn receive(&mut self, frame: &Frame, timeline: &mut Timeline<'_, '_>) {
        self.live(timeline, |motor, now| {
            if let Some(frame) = from_bus(frame).filter(|_| !motor.is_unplugged()) {
                motor.hear_frame(now, &frame);
            }
        });
    }

    fn offer(&self) -> Option<Offer> {
        let Waiting { since, frame, corrupt } = *self.queue.front()?;
        let fault = corrupt.then_some(Fault::Crc);
        (!self.motor.is_unplugged()).then_some(Offer { since, frame, fault })
    }

    /// One with a wrong checksum is not sent again: the motor knows nothing of its damage.
    fn sent(&mut self, acknowledged: bool, _timeline: &mut Timeline<'_, '_>) {
        self.queue.pop_front_if(|front| acknowledged || front.corrupt);
    }

    fn on_event(&mut self, event: EventId, timeline: &mut Timeline<'_, '_>) {
        if self.alarm.take(event) {
            self.live(timeline, |_, _| ());
        }
    }

    fn restarted(&mut self, timeline: &mut Timeline<'_, '_>) {
        self.alarm.lost();
        self.live(timeline, |_, _| ());
    }

    fn power_changed(&mut self, on: bool, timeline: &mut Timeline<'_, '_>) {
        if on {
            self.power_cycle(timeline);
        }
    }
}

/// Names the motor; its inside is the simulator's.
impl fmt::Debug for CanMotor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CanMotor")
            .field("motor", &format_args!("{}", self.motor))
            .field("queue", &self.queue)
            .field("alarm", &self.alarm)
            .finish()
    }
}

#[cfg(test)]
mod tests;
