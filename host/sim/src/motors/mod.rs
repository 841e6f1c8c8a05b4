//! Simulated motors: one model per protocol, and what is the same in all of them.

mod counts;
mod d5;
mod dynamics;
mod framer;
mod injection;
mod lenient;
mod log;
mod model;
mod rmd;
#[cfg(test)]
mod scripts;
#[cfg(feature = "snapshot")]
mod snapshot;
#[cfg(all(test, feature = "snapshot"))]
mod snapshot_tests;
mod stall;
#[cfg(test)]
mod test_motor;
mod thruster;
mod watch;

use std::fmt;
use std::time::Duration;

use host_protocol::{CanFrame, Protocol};

pub use self::injection::{Beginning, Injection, Turning};
pub use self::log::{LogEntry, MotorEvent, MotorLog};
pub use self::model::Outgoing;

use self::injection::Injections;
use self::model::{Context, Model};
use crate::random::Random;
use crate::wiring::{MotorWiring, WiringError};

/// Above this speed the log calls a motor moving, rad/s.
const MOVING_RAD_S: f64 = 0.1;
/// Below this speed the log calls it stopped, rad/s.
const STOPPED_RAD_S: f64 = 0.01;

/// The firmware of a motor.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
enum Make {
    Rmd(Box<rmd::Rmd>),
    Thruster(Box<thruster::Thruster>),
    D5(Box<d5::D5>),
}

impl Make {
    fn model(&self) -> &dyn Model {
        match self {
            Self::Rmd(model) => model.as_ref(),
            Self::Thruster(model) => model.as_ref(),
            Self::D5(model) => model.as_ref(),
        }
    }

    fn model_mut(&mut self) -> &mut dyn Model {
        match self {
            Self::Rmd(model) => model.as_mut(),
            Self::Thruster(model) => model.as_mut(),
            Self::D5(model) => model.as_mut(),
        }
    }
}

/// One simulated motor.
///
/// A [`World`](crate::World) runs its motors itself. On a bus of your own you are the bus: you let
/// the motor's time pass ([`Motor::advance`]) at each [`Motor::next_event`] and before you look at
/// it, tell it what it hears, and carry what it sends ([`Motor::take_ready`]). Times count from one
/// start and never go back; at a time that has passed already nothing more happens.
///
/// With the feature `snapshot` it can be serialised; one that was deserialised goes on exactly as
/// the original would.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "snapshot", serde(bound(deserialize = "'de: 'static")))]
pub struct Motor {
    wiring: MotorWiring,
    make: Make,
    injected: Injections,
    log: MotorLog,
    random: Random,
    outbox: Vec<Outgoing>,
    moving: bool,
    logged_faults: u16,
}

impl Motor {
    /// A motor on a CAN bus of your own. `seed` decides its reply times and its garbage.
    ///
    /// # Errors
    /// If its protocol has no such node.
    pub fn on_can(wiring: MotorWiring, seed: u64) -> Result<Self, WiringError> {
        Self::new(wiring, false, seed)
    }

    /// A motor on an RS485 line of your own. `seed` decides its reply times and its garbage.
    ///
    /// # Errors
    /// If its protocol has no such node, or the simulator has it on CAN only.
    pub fn on_rs485(wiring: MotorWiring, seed: u64) -> Result<Self, WiringError> {
        Self::new(wiring, true, seed)
    }

    pub(crate) fn new(wiring: MotorWiring, serial: bool, seed: u64) -> Result<Self, WiringError> {
        let refused = WiringError::Node { protocol: wiring.protocol, node: wiring.node };
        if wiring.can_id.is_some() && wiring.protocol != Protocol::D5 {
            return Err(WiringError::CanId { protocol: wiring.protocol });
        }
        let make = match wiring.protocol {
            Protocol::Rmd => {
                let node = ::rmd::Node::new(wiring.node).map_err(|_| refused)?;
                let interface = if serial {
                    rmd::Interface::rs485(wiring.bitrate)
                } else {
                    rmd::Interface::Can
                };
                Make::Rmd(Box::new(rmd::Rmd::new(node, interface)))
            }
            Protocol::Thruster if !serial => {
                let node = ::thruster::Node::new(wiring.node).map_err(|_| refused)?;
                Make::Thruster(Box::new(thruster::Thruster::new(node)))
            }
            Protocol::D5 => {
                let node = ::d5::Node::new(wiring.node).map_err(|_| refused)?;
                let interface =
                    if serial { d5::Interface::serial(wiring.bitrate) } else { d5::Interface::Can };
                Make::D5(Box::new(d5::D5::new(node, wiring.can_id, interface)))
            }
            Protocol::Thruster => {
                return Err(WiringError::NotOnSerial { protocol: wiring.protocol });
            }
        };
        Ok(Self {
            wiring,
            make,
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

    /// Its bitrate, bit/s: that of its wiring until it has been set to another one and switched on
    /// again.
    pub fn bitrate(&self) -> u32 {
        self.make.model().bitrate().unwrap_or(self.wiring.bitrate)
    }

    /// Whether its cable is off the bus: then it hears nothing, and nothing that it sends arrives.
    pub fn is_unplugged(&self) -> bool {
        self.injected.unplugged
    }

    /// Speed of the shaft, rad/s, counter-clockwise positive; at most 1 ms old.
    pub fn speed_rad_s(&self) -> f64 {
        self.make.model().plant().speed_rad_s()
    }

    /// Angle of the shaft since the start, rad; at most 1 ms old.
    pub fn position_rad(&self) -> f64 {
        self.make.model().plant().position_rad()
    }

    /// Current of the winding, A; at most 1 ms old.
    pub fn current_a(&self) -> f64 {
        self.make.model().plant().current_a()
    }

    /// Its fault word, bits as its manual numbers them.
    pub fn fault_word(&self) -> u16 {
        self.make.model().fault_word()
    }

    /// Its own communication timeout; `None` while that is switched off.
    pub fn own_timeout(&self) -> Option<Duration> {
        self.make.model().own_timeout()
    }

    /// What it saw and did.
    pub fn log(&self) -> &MotorLog {
        &self.log
    }

    /// Puts a fault into it, or takes it out again. That an unplugged motor hears nothing is the
    /// bus's business.
    pub fn inject(&mut self, now: Duration, injection: Injection) {
        self.injected.apply(injection);
        self.advance(now);
    }

    /// Switches it off and on again. What it was about to send is lost; its shaft keeps its speed
    /// for that moment.
    pub fn power_cycle(&mut self, now: Duration) {
        self.advance(now);
        self.outbox.clear();
        self.make.model_mut().power_cycle();
        self.advance(now);
    }

    /// When it will do something next; `None` while it only waits.
    pub fn next_event(&self) -> Option<Duration> {
        let sends = self.outbox.first().map(|message| message.at);
        let events = [sends, self.make.model().next_timer(), self.make.model().plant().next_step()];
        events.into_iter().flatten().min()
    }

    /// Lets time pass up to `now`.
    pub fn advance(&mut self, now: Duration) {
        self.make.model_mut().plant_mut().set_stuck(self.injected.stuck_rotor);
        self.make.model_mut().plant_mut().set_outside(self.injected.outside);
        self.make.model_mut().plant_mut().advance(now);
        self.with_model(now, |model, cx| model.run(cx));
    }

    /// Takes in a frame of its CAN bus, to it or to another, when its last bit has arrived.
    pub fn hear_frame(&mut self, now: Duration, frame: &CanFrame) {
        self.advance(now);
        self.with_model(now, |model, cx| model.hear_frame(cx, frame));
    }

    /// Takes in a byte of its RS485 line when its stop bit has arrived.
    pub fn hear_byte(&mut self, now: Duration, byte: u8) {
        self.advance(now);
        self.with_model(now, |model, cx| model.hear_byte(cx, byte));
    }

    /// The next message that is due for its bus controller.
    pub fn take_ready(&mut self, now: Duration) -> Option<Outgoing> {
        self.outbox.first().is_some_and(|message| message.at <= now).then(|| self.outbox.remove(0))
    }

    /// Calls the model, then logs what has become of the motor.
    fn with_model(&mut self, now: Duration, call: impl FnOnce(&mut dyn Model, &mut Context<'_>)) {
        let Self { make, injected, log, random, outbox, moving, logged_faults, .. } = self;
        let model = make.model_mut();
        call(model, &mut Context { now, injected, log, random, outbox });
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
