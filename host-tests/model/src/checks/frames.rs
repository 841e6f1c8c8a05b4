//! What is handed to the buses: motion, stops, and the order of both (G1, G2, G4).

use crate::axis::{Asked, Axis, Cause, StopAction};
use crate::bus::{Held, SOFTWARE_US};
use crate::can_id::{is_extended, rank};
use crate::motor::{Protocol, Purpose, Timeout};
use crate::oracle::{Frame, Oracle};
use crate::violation::Check;
use crate::wire::Told;

/// Id of a request to every RMD motor (RMD V3.6 §3), and the same on RS485.
const RMD_BROADCAST: u32 = 0x280;
const RMD_SERIAL_BROADCAST: u8 = 0xCD;
/// D5: the id of all motors.
const D5_BROADCAST: u8 = 0xFE;
/// A first stop bars what belongs to other stops for so many frames (G4).
const STOP_BARS_FRAMES: u64 = 4;
/// A stop has nothing but these before it, where the motor asks for them.
const LOCK_BRAKE: u8 = 0x78;
/// Part of arming where the axis says so.
const FREE_BRAKE: u8 = 0x77;
const OUTPUT_OFF: u8 = 0x80;

/// A thruster's ST (Thruster manual §2.3).
fn set_timeout(ms: u32) -> Vec<u8> {
    [&b"ST\0\0"[..], &ms.to_be_bytes()].concat()
}

impl Oracle {
    /// Judges a frame that is being handed over.
    pub(crate) fn judge(&mut self, now: u64, bus: u8, slot: u8, frame: Frame<'_>) -> Held {
        let found = self.addressee(bus, frame);
        let raw = self.take_raw(bus, frame);
        let mut held = Held {
            slot,
            handed_us: now,
            axis: None,
            data: Vec::new(),
            is_motion: false,
            is_stop: false,
            is_step: false,
            waits_until: None,
            asked_back: false,
            asked_back_us: None,
            is_raw: false,
            is_unsafe: false,
            id: if let Frame::Can(id, _) = frame { Some(id) } else { None },
            is_harmful: false,
            is_setpoint: false,
            prepares: false,
            start: None,
            is_left_behind: false,
            acknowledged_by: 0,
            missed_us: None,
        };
        held.is_raw = raw;
        if raw {
            held.is_unsafe = self.buses[usize::from(bus)].raw_unsafe;
            self.judge_raw(now, bus, frame);
        }
        if !raw && self.judge_start(now, bus, frame, &mut held) {
            self.judge_order(now, bus, &held, frame);
            return held;
        }
        held.axis = found.as_ref().filter(|_| !raw).and_then(|(axis, _)| u8::try_from(*axis).ok());
        if !moves_all(frame) {
            self.judge_bystanders(now, bus, frame, &held);
        }
        if let Frame::Serial(bytes) = frame {
            self.judge_serial(now, bus, bytes, &held);
        }
        let Some((axis, data)) = found.filter(|_| !raw) else {
            if !raw {
                self.judge_stray(now, bus, frame, &mut held);
            }
            self.judge_order(now, bus, &held, frame);
            return held;
        };
        if !self.axes[axis].protocol().is_none_or(|p| p.has(self.axes[axis].dialect(), &data)) {
            self.broken(Check::NotInDialect, now, format!("axis {axis}: {}", frame.text()));
        }
        let purpose = self.axes[axis].protocol().map_or(Purpose::Change, |p| p.purpose(&data));
        let purpose = self.axes[axis].purpose_as_it_waits(purpose, &data);
        held.prepares = self.prepares(now, axis, &data);
        held.is_motion = matches!(purpose, Purpose::Motion { .. });
        held.is_stop = purpose == Purpose::Stop;
        held.is_harmful = held.is_motion || purpose == Purpose::Change;
        held.is_setpoint = !held.prepares
            && matches!(purpose, Purpose::Motion { .. } | Purpose::Stop | Purpose::Rest);
        match purpose {
            Purpose::Motion { .. } | Purpose::Rest if held.prepares => {
                self.judge_prepared(now, axis, &data, frame)
            }
            Purpose::Motion { once } => self.judge_motion(now, axis, once, &data, frame),
            Purpose::Stop => {
                self.axes[axis].has_sent_native(&data);
                self.judge_stop(now, axis, &data);
            }
            Purpose::Change if self.axes[axis].armed => {
                self.broken(
                    Check::ChangedWhileArmed,
                    now,
                    format!("axis {axis}: {}", frame.text()),
                );
            }
            Purpose::Change if self.axes[axis].arming.is_some() => {
                let frees = self.axes[axis].protocol() == Some(Protocol::Rmd)
                    && data.first() == Some(&FREE_BRAKE);
                // A thruster is told its timeout again, which it may have lost with its power.
                let renews = self.axes[axis].protocol() == Some(Protocol::Thruster)
                    && self.axes[axis].timeouts_ms().any(|ms| data == set_timeout(ms));
                if !renews && (!frees || !self.axes[axis].releases_brake()) {
                    self.broken(
                        Check::ChangedWhileArmed,
                        now,
                        format!("axis {axis} arms: {}", frame.text()),
                    );
                }
            }
            Purpose::Change if data.first() == Some(&LOCK_BRAKE) => {
                if let Some(duty) = &mut self.axes[axis].duty {
                    duty.locking = true;
                    held.is_step = true;
                }
            }
            // What changes a motor needs an axis at rest, or a confirmed stop that is being
            // cleared.
            Purpose::Change
                if self.axes[axis].duty.as_ref().is_some_and(|duty| !duty.confirmed) =>
            {
                self.broken(
                    Check::ChangedWhileArmed,
                    now,
                    format!("axis {axis} stops: {}", frame.text()),
                );
            }
            Purpose::Rest => {
                self.axes[axis].has_sent_native(&data);
                held.is_step = self.axes[axis].duty.is_some();
            }
            _ => {}
        }
        held.data = data;
        self.judge_order(now, bus, &held, frame);
        held
    }

    /// The axis to whose motor a frame goes, and what it is told.
    fn addressee(&self, bus: u8, frame: Frame<'_>) -> Option<(usize, Vec<u8>)> {
        let here = |axis: &&Axis| axis.bus() == Some(usize::from(bus)) && axis.is_complete();
        self.axes.iter().enumerate().filter(|(_, axis)| here(axis)).find_map(|(index, axis)| {
            let (protocol, node) = (axis.protocol()?, axis.node()?);
            let data = match frame {
                Frame::Can(id, data) => {
                    protocol.request_to(node, axis.d5_request_id(), id, data)?
                }
                Frame::Serial(bytes) => {
                    let (to, data) = protocol.serial_frame(bytes)?;
                    (to == node).then_some(data.to_vec())?
                }
            };
            Some((index, data))
        })
    }

    fn take_raw(&mut self, bus: u8, frame: Frame<'_>) -> bool {
        let Some(bus) = self.buses.get_mut(usize::from(bus)) else { return false };
        let wanted = match frame {
            Frame::Can(id, data) => (Some(id), data),
            Frame::Serial(bytes) => (None, bytes),
        };
        bus.saw_extended |= wanted.0.is_some_and(is_extended);
        let place = bus.raw.iter().position(|(id, data)| (*id, data.as_slice()) == wanted);
        place.is_some_and(|place| bus.raw.remove(place).is_some())
    }

    /// A frame to no axis: a stop to all of them, where the bus is exclusive, or the motor of an
    /// axis that was changed.
    fn judge_stray(&mut self, now: u64, bus: u8, frame: Frame<'_>, held: &mut Held) {
        let stops = match frame {
            Frame::Can(RMD_BROADCAST, data) => matches!(data.first(), Some(0x80 | 0x81)),
            Frame::Serial([0x3E, RMD_SERIAL_BROADCAST, 8, first, ..]) => {
                matches!(first, 0x80 | 0x81)
            }
            _ => false,
        };
        held.is_stop = stops;
        let may = stops && self.buses[usize::from(bus)].exclusive;
        let what = if moves_all(frame) || stops { Check::Broadcast } else { Check::RawUnopened };
        if !may {
            self.broken(what, now, format!("bus {bus}: {}", frame.text()));
        }
    }

    /// Nothing is started before a first stop that is due; once that has waited for four frames,
    /// what belongs to another stop is, and what keeps a motor holding.
    fn judge_order(&mut self, now: u64, bus: u8, held: &Held, frame: Frame<'_>) {
        if held.is_stop || held.is_step {
            return;
        }
        let stops = |axis: u8| {
            let axis = &self.axes[usize::from(axis)];
            axis.duty.is_some() || axis.may_be_fed()
        };
        let is_of_a_stop = !held.is_motion && held.axis.is_some_and(stops);
        let held_up_us = STOP_BARS_FRAMES * self.buses[usize::from(bus)].own_frame_us();
        let due = |axis: &Axis| {
            let duty = axis.duty.as_ref();
            axis.bus() == Some(usize::from(bus))
                && duty.is_some_and(|d| {
                    d.is_first_due()
                        && d.since_us <= now
                        && !(is_of_a_stop && d.since_us + held_up_us <= now)
                })
        };
        if let Some(index) = self.axes.iter().position(due) {
            let seen = format!("{} goes before the stop of axis {index}", frame.text());
            self.broken(Check::StopNotFirst, now, seen);
        }
    }

    fn judge_motion(&mut self, now: u64, index: usize, once: bool, data: &[u8], frame: Frame<'_>) {
        self.motions += 1;
        let axis = &mut self.axes[index];
        let protocol = axis.protocol();
        let seen = format!("axis {index}, {:?}: {}", axis.told, frame.text());
        if !axis.armed {
            let (check, why) = match axis.revoked {
                Some((Cause::Expired, at)) => {
                    (Check::MotionExpired, format!("{seen}, expired at {at}"))
                }
                Some((cause, at)) => (Check::MotionAfterStop, format!("{seen}, {cause:?} at {at}")),
                None => (Check::MotionUnarmed, seen),
            };
            self.broken(check, now, why);
            return;
        }
        let lives = |p: &&mut crate::axis::Permit| {
            p.expires_us.is_none_or(|at| now < at) && !p.is_of_a_start_to_come()
        };
        let mut alive = axis.permits.iter_mut().filter(lives).peekable();
        if alive.peek().is_none() {
            self.broken(Check::MotionExpired, now, seen);
            return;
        }
        let fits = |p: &&mut crate::axis::Permit| {
            let is_native =
                |native: &Vec<u8>| protocol.is_some_and(|p| p.same_command(native, data));
            p.once == once
                && p.native.as_ref().is_none_or(is_native)
                && p.data.as_ref().is_none_or(|d| d == data)
        };
        // What is refreshed is what is in force; what is new belongs to the newest that it can be.
        let fitting: Vec<&mut crate::axis::Permit> = alive.filter(fits).collect();
        let known = fitting.iter().rposition(|p| p.data.is_some());
        let place = known.or(fitting.len().checked_sub(1));
        let Some(permit) = place.and_then(|place| fitting.into_iter().nth(place)) else {
            self.broken(if once { Check::MotionTwice } else { Check::MotionStale }, now, seen);
            return;
        };
        if permit.once && permit.sent {
            self.broken(Check::MotionTwice, now, seen);
            return;
        }
        permit.sent = true;
        if !permit.is_relative {
            permit.data = Some(data.to_vec());
        }
        self.judge_limits(now, index, data, frame);
    }

    pub(super) fn judge_limits(&mut self, now: u64, index: usize, data: &[u8], frame: Frame<'_>) {
        let axis = &self.axes[index];
        let limit =
            axis.protocol().and_then(|protocol| axis.limit_exceeded_by(&protocol.goal(data)));
        if let Some(parameter) = limit {
            let seen = format!("axis {index}: {} exceeds parameter {parameter}", frame.text());
            self.broken(Check::LimitOnWire, now, seen);
        }
    }

    /// The stop must be the configured one; what a native command asks of an axis at rest is its
    /// host's affair.
    fn judge_stop(&mut self, now: u64, index: usize, data: &[u8]) {
        let axis = &self.axes[index];
        let (Some(Protocol::Rmd), Some(first)) = (axis.protocol(), data.first()) else { return };
        let locking = axis.duty.as_ref().is_some_and(|duty| duty.locking);
        let fits = match axis.stop_action() {
            Some(StopAction::Coast) => *first == OUTPUT_OFF,
            Some(StopAction::Hold) => *first != OUTPUT_OFF,
            // The output goes off behind a locked brake.
            Some(StopAction::Brake) => *first != OUTPUT_OFF || locking,
            None => true,
        };
        let native = axis.native_stops.iter().any(|asked| Protocol::Rmd.same_command(asked, data));
        let let_go = axis.told == Told::Holding && axis.output_off_asked && *first == OUTPUT_OFF;
        let asked = axis.told == Told::Idle && native || let_go;
        // An RMD ignores what it is told first behind its own timeout: that goes before what a host
        // has it told.
        let goes_before = axis.told == Told::Idle && axis.is_to_be_told && *first == OUTPUT_OFF;
        // Arming begins with the stop command too.
        if !fits && !asked && !goes_before {
            self.broken(Check::WrongStopAction, now, format!("axis {index}: {first:02X}"));
        }
    }

    /// A frame of ours has left. One that stops another axis may have waited for it, if its own id
    /// is a higher one: behind 4 F a stop does not keep the repeats and readings of others any
    /// more (G4).
    pub(crate) fn outrank_stops(&mut self, now: u64, bus: usize, held: &Held) {
        let (Some(id), Some(state)) = (held.id, self.buses.get(bus)) else { return };
        let (waits, length) =
            (PATIENCE_FRAMES * state.frame_us(), state.foreign_us(id, held.data.len().max(8)));
        for axis in self.axes.iter_mut().filter(|axis| axis.bus() == Some(bus)) {
            let waits =
                axis.duty.as_ref().is_some_and(|d| d.is_first_due() && d.since_us + waits < now);
            if waits && axis.request_id().is_some_and(|own| rank(id) < rank(own)) {
                axis.outranked_us += length;
            }
        }
    }

    /// A frame has left: what its motor may answer from now on, and what it was to a stop.
    pub(crate) fn count_left(&mut self, now: u64, bus: usize, held: Held) {
        let axes = self.axes_on(bus);
        self.judge_left_behind(now, &held);
        self.judge_outlived(now, bus, &held);
        self.started(now, bus, &held);
        let Some(index) = held.axis.map(usize::from) else { return };
        let window = self.buses[bus].window_us;
        let outside = self.not_ours_us(now, &self.axes[index]);
        self.delivered(now, index, &held.data, held.is_setpoint, held.handed_us);
        let axis = &mut self.axes[index];
        // The software may take g to see that time is up.
        let revoked = axis.revoked.is_some_and(|(_, at)| !axis.armed && at + SOFTWARE_US < now);
        if held.is_motion && revoked && !held.asked_back && self.buses[bus].is_can() {
            let seen = format!("motion of axis {index} leaves and was never asked back");
            self.broken(Check::MotionKept, now, seen);
        }
        let axis = &mut self.axes[index];
        let protocol = axis.protocol();
        if let (Some(arming), Some(protocol)) = (&mut axis.arming, protocol) {
            arming.left(protocol, held.handed_us, now + window, &held.data);
        }
        // What it is then, the motor has to say.
        if protocol.and_then(|p| p.timeout_touched(&held.data)).is_some() {
            axis.timeout = Timeout::Unknown;
        }
        axis.asked.retain(|asked| {
            let slow = protocol.is_some_and(|protocol| protocol.is_slow(&asked.data));
            asked.left_us + 2 * window.max(if slow { SLOW_US } else { 0 }) > now
        });
        axis.waits_from_now(&held.data);
        axis.asked.push(Asked { data: held.data.clone(), handed_us: held.handed_us, left_us: now });
        // One that was on its way before the cause stops the motor as well: it has left after it.
        let Some(duty) = axis.duty.as_mut() else { return };
        let first = held.data.first();
        if held.is_stop || held.is_step {
            duty.last = Some((now, outside));
        }
        if duty.locking && first == Some(&OUTPUT_OFF) {
            // Behind the lock this is no stop command, but the end of the brake's sequence.
            duty.output_off |= duty.locked;
        } else if held.is_stop {
            duty.left += 1;
            if duty.left == 1 && !duty.rests {
                let used = (now - duty.since_us).saturating_sub(outside - duty.outside_us);
                let bound = self.buses[bus].stop_bound_us(duty.k, protocol, axes);
                if used > bound {
                    let seen = format!(
                        "axis {index}: first stop after {used} µs of {bound}, {:?}",
                        duty.cause
                    );
                    self.broken(Check::StopLate, now, seen);
                }
            }
        }
    }
}

/// A first stop that has waited longer than so many frames bars only motion (G4).
const PATIENCE_FRAMES: u64 = 4;
/// A reply that takes its motor long may come so late, µs: freeing and locking a brake
/// (PROTOCOL-NOTES R20).
const SLOW_US: u64 = 250_000;

/// Whether a frame moves every motor that hears it.
fn moves_all(frame: Frame<'_>) -> bool {
    match frame {
        Frame::Can(RMD_BROADCAST, data) => {
            matches!(Protocol::Rmd.purpose(data), Purpose::Motion { .. })
        }
        Frame::Can(_, data) if data.get(..2) == Some(&[0xD5, D5_BROADCAST]) => {
            matches!(Protocol::D5.purpose(data), Purpose::Motion { .. })
        }
        Frame::Serial(data) if data.get(..2) == Some(&[0xD5, D5_BROADCAST]) => {
            matches!(Protocol::D5.purpose(data), Purpose::Motion { .. })
        }
        Frame::Serial(bytes) => Protocol::Rmd.serial_frame(bytes).is_some_and(|(node, data)| {
            node == RMD_SERIAL_BROADCAST
                && matches!(Protocol::Rmd.purpose(&data), Purpose::Motion { .. })
        }),
        Frame::Can(..) => false,
    }
}
