//! What motors answer: acknowledgements, standstill, faults, refusals (G3, G4).

use crate::axis::{Asked, Cause};
use crate::bus::BusKind;
use crate::can_id::{is_extended, rank};
use crate::motor::{Protocol, Purpose, Reading, Timeout};
use crate::oracle::{Frame, Oracle};

/// A thruster that was silent for so long may have been without power (G1).
const THRUSTER_SILENCE_US: u64 = 1_000_000;
/// With which a reply of a D5 begins.
const D5_REPLY: u8 = 0x5D;

impl Oracle {
    /// A frame has come in.
    pub fn received(&mut self, now: u64, bus: u8, frame: Frame<'_>) {
        self.advance(now);
        match frame {
            Frame::Can(id, data) => {
                if let Some(state) = self.buses.get_mut(usize::from(bus)) {
                    state.tally.received += 1;
                    state.saw_extended |= is_extended(id);
                }
                let length = self
                    .buses
                    .get(usize::from(bus))
                    .map_or(0, |bus| bus.foreign_us(id, data.len()));
                for index in 0..self.axes.len() {
                    let axis = &mut self.axes[index];
                    if axis.bus() != Some(usize::from(bus)) {
                        continue;
                    }
                    // With the same id they destroy each other.
                    if axis.request_id().is_some_and(|own| rank(id) <= rank(own)) {
                        axis.outranked_us += length;
                    }
                    let (Some(protocol), Some(node)) = (axis.protocol(), axis.node()) else {
                        continue;
                    };
                    if let Some(data) = protocol.reply_of(node, axis.d5_reply_id(), id, data) {
                        self.reply(now, index, protocol, &data);
                    }
                }
            }
            Frame::Serial(bytes) => self.heard(now, bus, bytes),
        }
    }

    /// Bytes of a serial line: our own, as they come back, are none of a motor's.
    fn heard(&mut self, now: u64, bus: u8, bytes: &[u8]) {
        let mut foreign = 0;
        for byte in bytes {
            let Some(state) = self.buses.get_mut(usize::from(bus)) else { return };
            if let (BusKind::Rs485 { echo: true }, Some(own)) =
                (state.kind, state.echo.front().copied())
            {
                if own == *byte {
                    state.echo.pop_front();
                    continue;
                }
                // A collision: whatever comes may be a motor's.
                state.echo.clear();
            }
            foreign += 1;
            state.heard.push(*byte);
            let protocol = state.spoken();
            if state.heard.len() > protocol.serial_len() {
                state.heard.remove(0);
            }
            if let Some((node, data)) = protocol.serial_frame(&state.heard) {
                state.heard.clear();
                let of_node = |axis: &crate::axis::Axis| {
                    axis.bus() == Some(usize::from(bus))
                        && axis.node() == Some(node)
                        && axis.protocol() == Some(protocol)
                        && (protocol == Protocol::Rmd || data.first() == Some(&D5_REPLY))
                };
                if let Some(index) = self.axes.iter().position(of_node) {
                    self.reply(now, index, protocol, &data);
                }
            }
        }
        if let Some(state) = self.buses.get_mut(usize::from(bus)).filter(|_| foreign > 0) {
            state.disturbed(foreign);
        }
    }

    /// A motor's frame: the answer to the oldest request that it can be the answer to. Allowance:
    /// one whose reply window has passed is that only where there is no other.
    fn reply(&mut self, now: u64, index: usize, protocol: Protocol, data: &[u8]) {
        let bus = self.axes[index].bus().unwrap_or_default();
        let Some(bus) = self.buses.get(bus) else { return };
        let (outside, window) = (bus.outside_us(now), bus.window_us);
        let axis = &mut self.axes[index];
        // Its power may have been off.
        if protocol == Protocol::Thruster && axis.heard.0 + THRUSTER_SILENCE_US < now {
            axis.timeout = Timeout::Unknown;
        }
        axis.heard = (now, outside);
        axis.objects |= protocol.is_objection(data);
        let (still, warnings, returns) = (axis.still(), axis.warning_bits(), axis.return_mode());
        if let Some(arming) = &mut axis.arming {
            arming.answered(now, protocol, returns, data, still, warnings);
        }
        let written = |asked: &Asked| {
            let touched = protocol
                .timeout_touched(&asked.data)
                .filter(|touched| *touched != Timeout::Unknown);
            touched.filter(|_| protocol.answer(returns, &asked.data, data).is_some())
        };
        axis.timeout = axis.asked.iter().rev().find_map(written).unwrap_or(axis.timeout);
        let answers = |asked: &Asked| protocol.answer(returns, &asked.data, data);
        let is_slow = |asked: &Asked| protocol.is_slow(&asked.data);
        let in_window = |asked: &Asked| is_slow(asked) || now < asked.left_us + window;
        let fits = |asked: &Asked| answers(asked).is_some();
        let oldest = axis.asked.iter().position(|asked| fits(asked) && in_window(asked));
        let Some(place) = oldest.or_else(|| axis.asked.iter().rposition(fits)) else { return };
        let same = axis.asked.iter().filter(|asked| fits(asked)).count();
        let asked = axis.asked.remove(place);
        let Some(reading) = answers(&asked) else { return };
        let in_time = same == 1 && now < asked.left_us + window;
        self.axes[index].has_said_what_waits(&asked, &reading);
        self.read_for_stop(now, index, &asked, &reading);
        let moved = matches!(protocol.purpose(&asked.data), Purpose::Motion { .. });
        let axis = &self.axes[index];
        if !axis.armed || !in_time {
            // What comes late may belong to an older request: the next reading counts.
            return;
        }
        if reading.faults.is_some_and(|word| word & !axis.warning_bits() != 0) {
            self.owe_stop(index, Cause::Fault, now);
        } else if axis.is_exceeded_by(&reading) {
            self.owe_stop(index, Cause::Limit, now);
        } else if reading.refused && moved {
            self.owe_stop(index, Cause::Refused, now);
        } else if let Some(speed) = reading.speed {
            self.watch_speed(now, index, speed);
        }
    }

    fn read_for_stop(&mut self, now: u64, index: usize, asked: &Asked, reading: &Reading) {
        let axis = &mut self.axes[index];
        let still = axis.still();
        let Some(duty) = axis.duty.as_mut().filter(|duty| asked.left_us >= duty.since_us) else {
            return;
        };
        if reading.stops {
            duty.acknowledged_us.get_or_insert(now);
        }
        if let Some(speed) = reading.speed
            && duty.acknowledged_us.is_some_and(|at| asked.handed_us >= at)
        {
            duty.still = if speed <= still { duty.still + 1 } else { 0 };
            duty.stood |= duty.still >= 2;
        }
        if let Some(locked) = reading.locked {
            duty.locked = locked && duty.locking;
        }
    }
}
