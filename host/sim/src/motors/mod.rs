//! Simulated motors: one model per protocol, and what is the same in all of them.

mod counts;
mod d5;
mod dynamics;
mod injection;
mod log;
mod model;
mod rmd;
mod stall;
#[cfg(test)]
mod test_motor;
mod thruster;

use std::fmt;
use std::time::Duration;

use host_protocol::{CanFrame, Protocol};

pub use self::injection::Injection;
pub use self::log::{LogEntry, MotorEvent, MotorLog};
pub(crate) use self::model::Outgoing;

use self::injection::Injections;
use self::model::{Context, Model};
use crate::random::Random;
use crate::wiring::{MotorWiring, WiringError};

/// Above this speed the log calls a motor moving, rad/s.
const MOVING_RAD_S: f64 = 0.1;
/// Below this speed the log calls it stopped, rad/s.
const STOPPED_RAD_S: f64 = 0.01;

/// One simulated motor.
pub struct Motor {
    wiring: MotorWiring,
    model: Box<dyn Model>,
    injected: Injections,
    log: MotorLog,
    random: Random,
    outbox: Vec<Outgoing>,
    moving: bool,
    logged_faults: u16,
}

impl Motor {
    pub(crate) fn new(wiring: MotorWiring, serial: bool, seed: u64) -> Result<Self, WiringError> {
        let refused = WiringError::Node { protocol: wiring.protocol, node: wiring.node };
        let model: Box<dyn Model> = match wiring.protocol {
            Protocol::Rmd => {
                let node = ::rmd::Node::new(wiring.node).map_err(|_| refused)?;
                let interface =
                    if serial { rmd::Interface::rs485(wiring.bitrate) } else { rmd::Interface::Can };
                Box::new(rmd::Rmd::new(node, interface))
            }
            Protocol::Thruster if !serial => {
                Box::new(thruster::Thruster::new(::thruster::Node::new(wiring.node).map_err(|_| refused)?))
            }
            Protocol::D5 if !serial => {
                Box::new(d5::D5::new(::d5::Node::new(wiring.node).map_err(|_| refused)?))
            }
            Protocol::Thruster | Protocol::D5 => {
                return Err(WiringError::NotOnSerial { protocol: wiring.protocol });
            }
        };
        Ok(Self {
            wiring,
            model,
            injected: Injections::default(),
            log: MotorLog::default(),
            random: Random::new(seed),
            outbox: Vec::new(),
            moving: false,
            logged_faults: 0,
        })
    }

    /// What it speaks.
    pub fn protocol(&self) -> Protocol {
        self.wiring.protocol
    }

    /// Index of its bus.
    pub fn bus(&self) -> u8 {
        self.wiring.bus
    }

    /// The id it was wired with.
    pub fn node(&self) -> u8 {
        self.wiring.node
    }

    /// Speed of the shaft, rad/s, counter-clockwise positive; at most 1 ms old.
    pub fn speed_rad_s(&self) -> f64 {
        self.model.plant().speed_rad_s()
    }

    /// Angle of the shaft since the start, rad; at most 1 ms old.
    pub fn position_rad(&self) -> f64 {
        self.model.plant().position_rad()
    }

    /// Current of the winding, A; at most 1 ms old.
    pub fn current_a(&self) -> f64 {
        self.model.plant().current_a()
    }

    /// Its fault word, bits as its manual numbers them.
    pub fn fault_word(&self) -> u16 {
        self.model.fault_word()
    }

    /// Its own communication timeout; `None` while that is switched off.
    pub fn own_timeout(&self) -> Option<Duration> {
        self.model.own_timeout()
    }

    /// What it saw and did.
    pub fn log(&self) -> &MotorLog {
        &self.log
    }

    pub(crate) fn inject(&mut self, now: Duration, injection: Injection) {
        self.injected.apply(injection);
        self.advance(now);
    }

    pub(crate) fn power_cycle(&mut self, now: Duration) {
        self.advance(now);
        self.outbox.clear();
        self.model.power_cycle();
        self.advance(now);
    }

    /// When it will do something next.
    pub(crate) fn next_event(&self) -> Option<Duration> {
        let sends = self.outbox.first().map(|message| message.at);
        let events = [sends, self.model.next_timer(), self.model.plant().next_step()];
        events.into_iter().flatten().min()
    }

    /// Lets time pass up to `now`.
    pub(crate) fn advance(&mut self, now: Duration) {
        self.model.plant_mut().set_stuck(self.injected.stuck_rotor);
        self.model.plant_mut().advance(now);
        self.with_model(now, |model, cx| model.run(cx));
    }

    pub(crate) fn hear_frame(&mut self, now: Duration, frame: &CanFrame) {
        self.advance(now);
        self.with_model(now, |model, cx| model.hear_frame(cx, frame));
    }

    pub(crate) fn hear_byte(&mut self, now: Duration, byte: u8) {
        self.advance(now);
        self.with_model(now, |model, cx| model.hear_byte(cx, byte));
    }

    /// The next message that is due.
    pub(crate) fn take_ready(&mut self, now: Duration) -> Option<Outgoing> {
        self.outbox.first().is_some_and(|message| message.at <= now).then(|| self.outbox.remove(0))
    }

    /// Calls the model, then logs what has become of the motor.
    fn with_model(&mut self, now: Duration, call: impl FnOnce(&mut dyn Model, &mut Context<'_>)) {
        let Self { model, injected, log, random, outbox, moving, logged_faults, .. } = self;
        call(model.as_mut(), &mut Context { now, injected, log, random, outbox });
        let speed_rad_s = model.plant().speed_rad_s();
        if !*moving && speed_rad_s.abs() > MOVING_RAD_S {
            *moving = true;
            log.add(now, MotorEvent::Moving { speed_rad_s });
        } else if *moving && speed_rad_s.abs() < STOPPED_RAD_S {
            *moving = false;
            log.add(now, MotorEvent::Stopped { speed_rad_s });
        }
        let word = model.fault_word();
        if *logged_faults != word {
            *logged_faults = word;
            log.add(now, MotorEvent::Faults { word });
        }
    }
}

/// Protocol and node, as in `rmd 1` or `thruster 0x0B`.
impl fmt::Display for Motor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.wiring.fmt(f)
    }
}
