//! What a motor of any make is to the simulation.

use std::time::Duration;

use host_protocol::CanFrame;

use super::dynamics::Plant;
use super::injection::Injections;
use super::log::{MotorEvent, MotorLog};
use crate::bus::Wire;
use crate::random::Random;

/// The firmware of one motor: what it makes of commands, and what it does without.
///
/// Its plant has been advanced to the current time before each call.
pub(super) trait Model: Send {
    /// Takes in a CAN frame of the bus, to this motor or to another.
    fn hear_frame(&mut self, cx: &mut Context<'_>, frame: &CanFrame);

    /// Takes in a byte of the line.
    fn hear_byte(&mut self, _cx: &mut Context<'_>, _byte: u8) {}

    /// When it will do something by itself.
    fn next_timer(&self) -> Option<Duration>;

    /// Does what is due, and takes in what the injections have changed.
    fn run(&mut self, cx: &mut Context<'_>);

    /// The fault word, bits as the manual numbers them.
    fn fault_word(&self) -> u16;

    /// Its own communication timeout; `None` while that is off.
    fn own_timeout(&self) -> Option<Duration>;

    /// The bitrate that it was set to before it was last switched on, bit/s; `None`: that of its
    /// wiring.
    fn bitrate(&self) -> Option<u32> {
        None
    }

    /// Back to the state after switching on; what it stores survives.
    fn power_cycle(&mut self);

    fn plant(&self) -> &Plant;

    fn plant_mut(&mut self) -> &mut Plant;
}

/// A message that a motor sends.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Outgoing {
    /// When it hands the message to its bus controller.
    pub at: Duration,
    /// What it sends.
    pub wire: Wire,
    /// It has a wrong CAN checksum: every receiver destroys it, and it is not sent again.
    pub corrupt: bool,
}

/// What surrounds a model while it is called.
pub(super) struct Context<'a> {
    pub(super) now: Duration,
    pub(super) injected: &'a mut Injections,
    pub(super) log: &'a mut MotorLog,
    pub(super) random: &'a mut Random,
    pub(super) outbox: &'a mut Vec<Outgoing>,
}

impl Context<'_> {
    pub(super) fn log(&mut self, what: MotorEvent) {
        self.log.add(self.now, what);
    }

    /// Logs a command that arrived.
    pub(super) fn command(&mut self, name: &'static str) {
        self.log.command(self.now, name);
    }

    /// Logs a command that is not carried out.
    pub(super) fn ignored(&mut self, name: &'static str, because: &'static str) {
        self.log.ignored(self.now, name, because);
    }

    /// Sends after `delay`, unless and as the injections say. `has_checksum`: the last byte is one.
    pub(super) fn send(&mut self, delay: Duration, mut wire: Wire, has_checksum: bool) {
        let Injections {
            mute, reply_time, late_reply, reply_jitter, garbage, wrong_checksum, ..
        } = *self.injected;
        let data = match &wire {
            Wire::Can(frame) => frame.data(),
            Wire::Serial(bytes) => bytes,
        };
        if mute || self.injected.lost.is_of(data) {
            return;
        }
        if let Some(left) = self.injected.lose_replies.checked_sub(1) {
            self.injected.lose_replies = left;
            return;
        }
        let jitter = match reply_jitter {
            Duration::ZERO => Duration::ZERO,
            most => self.random.between(Duration::ZERO, most),
        };
        if garbage {
            self.replace_data(&mut wire, |random, _| random.byte());
        }
        let corrupt = wrong_checksum && !has_checksum;
        if wrong_checksum && has_checksum {
            let last = match &wire {
                Wire::Can(frame) => frame.data().len(),
                Wire::Serial(bytes) => bytes.len(),
            };
            let mut at = 0;
            self.replace_data(&mut wire, |_, byte| {
                at += 1;
                if at == last { !byte } else { byte }
            });
        }
        let delay = reply_time.unwrap_or(delay);
        self.outbox.push(Outgoing { at: self.now + delay + late_reply + jitter, wire, corrupt });
        self.outbox.sort_by_key(|message| message.at);
    }

    fn replace_data(&mut self, wire: &mut Wire, mut with: impl FnMut(&mut Random, u8) -> u8) {
        match wire {
            Wire::Serial(bytes) => {
                for byte in bytes {
                    *byte = with(self.random, *byte);
                }
            }
            Wire::Can(frame) => {
                let data: Vec<u8> =
                    frame.data().iter().map(|byte| with(self.random, *byte)).collect();
                *frame = CanFrame::data_frame(frame.id(), &data).unwrap_or(*frame);
            }
        }
    }
}
