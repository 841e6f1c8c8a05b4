//! Motors that a frame is not meant for, and raw frames: what a lenient motor makes of them (G7,
//! G10).

use crate::bus::{Held, SOFTWARE_US};
use crate::motor::{Deed, Protocol, RMD_SERIAL_ALL};
use crate::oracle::{Frame, Oracle};
use crate::violation::Check;

/// D5: the id of all motors.
const D5_ALL: u8 = 0xFE;

impl Oracle {
    /// A frame that is being handed over to a bus must move and change nobody but the motor that it
    /// is for. Allowance: it may stop others, and what is on the bus without an axis the
    /// gateway cannot know.
    pub(super) fn judge_bystanders(&mut self, now: u64, bus: u8, frame: Frame<'_>, held: &Held) {
        let bus = usize::from(bus);
        let obeys = |deed: Option<Deed>| matches!(deed, Some(Deed::Moves | Deed::Changes));
        let (Frame::Can(id, data), false) = (frame, held.is_raw) else { return };
        if self.axes.iter().all(|axis| axis.bus() != Some(bus)) {
            return;
        }
        let meant = held.axis.map(usize::from);
        let of_axis = self.axes.iter().enumerate().find(|(index, axis)| {
            let address = axis.protocol().zip(axis.node()).filter(|_| axis.bus() == Some(bus));
            axis.is_complete()
                && Some(*index) != meant
                && address
                    .is_some_and(|(p, node)| obeys(p.obeys(node, axis.d5_request_id(), id, data)))
        });
        if let Some((index, _)) = of_axis {
            let seen =
                format!("{} is for axis {meant:?} and moves or changes axis {index}", frame.text());
            self.broken(Check::WrongMotor, now, seen);
        }
    }

    /// A raw frame must be harmless to every motor of every protocol of its bus.
    pub(super) fn judge_raw(&mut self, now: u64, bus: u8, frame: Frame<'_>) {
        let index = usize::from(bus);
        if !self.buses[index].raw_open || !self.may_be_raw(index) {
            self.broken(Check::RawUnopened, now, format!("bus {bus}: {}", frame.text()));
        }
        if self.buses[index].raw_unsafe {
            return;
        }
        let (Frame::Can(id, data), protocols) = (frame, self.buses[index].protocols) else {
            return;
        };
        let spoken = [Protocol::Rmd, Protocol::Thruster, Protocol::D5].into_iter().enumerate();
        let obeyed = spoken
            .filter(|(bit, _)| protocols >> bit & 1 == 1)
            .find_map(|(_, protocol)| protocol.some_obeys(id, data));
        let here = self.axes.iter().filter(|axis| axis.bus() == Some(index));
        let by_axis = here.filter_map(|axis| {
            axis.protocol()?.obeys(axis.node()?, axis.d5_request_id(), id, data)
        });
        if let Some(deed) = obeyed.or(by_axis.into_iter().next()) {
            self.broken(Check::RawHarmful, now, format!("bus {bus}: {} {deed:?}", frame.text()));
        }
    }

    /// A frame of an access for everything must not leave when that has ended: its motor may be an
    /// axis by now. Allowance: the one on the wire ends.
    pub(super) fn judge_outlived(&mut self, now: u64, bus: usize, held: &Held) {
        let state = &self.buses[bus];
        let ended = state.raw_closed_us.filter(|_| !state.raw_open);
        if held.is_unsafe && ended.is_some_and(|at| at + SOFTWARE_US + state.frame_us() < now) {
            let seen = format!(
                "bus {bus}: a raw frame of {} µs leaves, closed at {ended:?}",
                held.handed_us
            );
            self.broken(Check::RawUnopened, now, seen);
        }
    }

    /// Bytes on a serial line: whatever in a row is a frame, a motor may obey, as it may begin to
    /// listen anywhere.
    pub(super) fn judge_serial(&mut self, now: u64, bus: u8, bytes: &[u8], held: &Held) {
        let meant = held
            .axis
            .map(usize::from)
            .and_then(|axis| self.axes.get(axis))
            .and_then(|axis| axis.node());
        for (place, byte) in bytes.iter().enumerate() {
            let protocol = self.buses[usize::from(bus)].spoken();
            let line = &mut self.buses[usize::from(bus)].line;
            line.push(*byte);
            if line.len() > protocol.serial_len() {
                line.remove(0);
            }
            let Some((node, data)) = protocol.serial_frame(line) else { continue };
            let is_meant = !held.is_raw && place + 1 == bytes.len() && meant == Some(node);
            let Some(deed) = protocol.serial_deed(&data).filter(|_| !is_meant) else { continue };
            let stops_all =
                protocol == Protocol::Rmd && node == RMD_SERIAL_ALL && deed == Deed::Rests;
            // What starts D5 motors together is judged for itself.
            if !held.is_raw && protocol == Protocol::D5 && node == D5_ALL {
                continue;
            }
            if held.is_raw && self.buses[usize::from(bus)].raw_unsafe {
                continue;
            }
            if held.is_raw {
                let seen = format!("bus {bus}: node {node} hears {data:02X?} {deed:?}");
                self.broken(Check::RawHarmful, now, seen);
            } else if !stops_all {
                let seen =
                    format!("bus {bus}: node {node} hears {data:02X?}, which is for {meant:?}");
                self.broken(Check::WrongMotor, now, seen);
            }
        }
    }

    /// Whether a bus may be open for raw frames (G10).
    pub(crate) fn may_be_raw(&self, bus: usize) -> bool {
        !self.e_stopped
            && self.axes.iter().all(|axis| axis.bus() != Some(bus) || !axis.needs_its_bus())
    }

    /// Raw access ends there, and what waits with it.
    pub(crate) fn close_raw(&mut self, bus: Option<usize>, now: u64) {
        if let Some(bus) = bus.and_then(|bus| self.buses.get_mut(bus)) {
            bus.close_raw(now);
        }
    }

    /// An axis is another motor's now, or nobody's: what its old one has been sent is no longer its
    /// affair.
    pub(super) fn orphan(&mut self, index: u8) {
        let held = self.buses.iter_mut().flat_map(|bus| &mut bus.held);
        held.filter(|held| held.axis == Some(index)).for_each(|held| {
            held.axis = None;
            held.is_left_behind = true;
        });
    }

    /// What was left behind by an axis that was moved away is asked back; from a serial line
    /// nothing is, but nothing harmful is on its way then.
    pub(super) fn judge_left_behind(&mut self, now: u64, held: &Held) {
        if held.is_left_behind && !held.asked_back && (held.is_harmful || held.id.is_some()) {
            let seen = format!(
                "{:02X?} of {} µs is sent for an axis that was moved",
                held.data, held.handed_us
            );
            self.broken(Check::LeftBehind, now, seen);
        }
    }
}
