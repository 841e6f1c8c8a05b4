//! What follows from a request that was carried out, or refused (G1, G2).

use crate::axis::Axis;
use crate::bus::{Bus, D5};
use crate::motor::Timeout;
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::{Body, BusSetting, Change, Clears, Message, Request};

/// bit/s (D5 manual, point 3).
const D5_BITRATES: std::ops::RangeInclusive<u32> = 200_001..=222_222;

impl Oracle {
    /// A request was carried out.
    pub(super) fn granted(
        &mut self,
        now: u64,
        link: u8,
        sequence: u16,
        request: &Request,
        message: &Message,
    ) {
        match *request {
            Request::LinkSilence(us) => self.changed(now, &[Change::LinkSilence(us)]),
            Request::ConfigureBus { bus, setting } => {
                self.changed(now, &[Change::Bus(bus, Some(setting))]);
            }
            Request::ConfigureAxis { axis, parameter, value } => {
                self.changed(now, &[Change::Axis(axis, parameter, Some(value))]);
            }
            Request::BeginChanges => self.links[usize::from(link)].changes.clear(),
            Request::AddChanges(ref changes) => {
                self.links[usize::from(link)].changes.extend_from_slice(changes);
            }
            Request::ApplyChanges => {
                let changes = std::mem::take(&mut self.links[usize::from(link)].changes);
                self.changed(now, &changes);
            }
            Request::RemoveAxis(index) => self.removed(now, index),
            Request::Provision { axis, timeout_ms } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.motor_timeout_ms =
                        (1..=60_000).contains(&timeout_ms).then_some(timeout_ms);
                    axis.motor_timeouts_asked.clear();
                }
            }
            Request::Arm(axes) => {
                let epoch = Body(message.body()).u32();
                for axis in (0..32).filter(|axis| axes >> axis & 1 == 1) {
                    if let Some(epoch) = epoch.filter(|epoch| !self.epochs.insert((axis, *epoch))) {
                        self.broken(Check::EpochRepeated, now, format!("axis {axis}: {epoch}"));
                    }
                    let axis = self.axes.get_mut(usize::from(axis));
                    if let Some(axis) = axis.filter(|axis| axis.armed) {
                        axis.is_of_epoch(epoch);
                    }
                }
            }

            Request::Clear(Clears::Axis(axis))
            | Request::ClearByRestart(axis)
            | Request::ClearUnreachable(axis) => {
                let at = self.asked_us(link, sequence).unwrap_or(now);
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.cleared_us = Some(now);
                    if let Request::ClearUnreachable(_) = request {
                        // Unsafe, and named so: nothing is owed any more but what became due since,
                        // its host having read late.
                        axis.duty = axis.duty.take().filter(|duty| duty.since_us > at);
                        axis.unreachable = false;
                        axis.timeout = Timeout::Unknown;
                    }
                }
            }
            Request::Setpoint { axis, epoch, expires_at_us } => {
                self.grant(now, link, sequence, axis, (epoch, expires_at_us));
            }
            Request::Cycle { axes, .. } => {
                let Some(refused) = refused_in_cycle(message) else {
                    let seen = format!("link {link}: {:02X?} is no report", message.body());
                    return self.broken(Check::ResultUnasked, now, seen);
                };
                for axis in (0..32).filter(|axis| axes >> axis & 1 == 1) {
                    if refused >> axis & 1 == 0 {
                        self.fulfil(now, link, sequence, axis);
                    } else if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                        axis.permits.retain(|p| (p.link, p.sequence) != (link, sequence));
                    }
                }
            }
            Request::MoveRelative { axis, epoch, expires_at_us } => {
                self.grant(now, link, sequence, axis, (epoch, expires_at_us));
            }
            Request::Native { axis, .. } => {
                // A motion was granted when it was not refused; a stop says so by its events.
                self.fulfil(now, link, sequence, axis);
            }
            Request::RawOpen { bus, .. } | Request::RawOpenAt { bus } => {
                let unsafe_access = matches!(request, Request::RawOpen { unsafe_access: true, .. });
                // With an axis on it a bus runs as it is configured.
                let bare = unsafe_access || matches!(request, Request::RawOpenAt { .. });
                let here = |axis: &&Axis| axis.bus() == Some(usize::from(bus));
                if self.axes.iter().filter(here).any(|axis| axis.armed || bare) {
                    self.broken(
                        Check::RawUnopened,
                        now,
                        format!("bus {bus} is opened with an axis on it"),
                    );
                }
                // What closed it may have come before its host read that it was open. Allowance:
                // what closed it at the instant of the request came before that.
                let at = self.asked_us(link, sequence);
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.raw_open =
                        bus.raw_closed_us.is_none_or(|closed| at.is_some_and(|at| at >= closed));
                    bus.raw_unsafe = unsafe_access;
                    bus.raw_opened_us = Some(now);
                }
            }
            Request::RawSend { bus, id, ref data } => {
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.raw.push_back((id, data.clone()));
                }
            }
            Request::RawClose(bus) => {
                if let Some(bus) = self.buses.get_mut(usize::from(bus)) {
                    bus.close_raw(now);
                }
            }
            _ => {}
        }
    }

    /// All these changes were made together: of those of one row the last counts.
    fn changed(&mut self, now: u64, changes: &[Change]) {
        for (at, change) in changes.iter().enumerate() {
            if changes.iter().skip(at + 1).any(|later| later.is_of_the_row_of(change)) {
                continue;
            }
            match *change {
                Change::LinkSilence(us) => self.silence_us = us.into(),
                Change::Bus(bus, setting) => self.bus_changed(now, bus, setting),
                Change::Axis(axis, parameter, value) => {
                    self.axis_changed(now, axis, parameter, value);
                }
                Change::Name => {}
            }
        }
        self.note_extended();
        for change in changes {
            if let Change::Axis(axis, ..) = *change {
                match self.axes.get(usize::from(axis)) {
                    Some(blank) if blank.is_blank() => self.removed(now, axis),
                    Some(_) => self.judge_configuration(now, axis.into()),
                    None => {}
                }
            }
        }
    }

    pub(super) fn bus_changed(&mut self, now: u64, index: u8, setting: Option<BusSetting>) {
        // Of a bus that does not run nothing is known.
        let BusSetting { bitrate, protocols, exclusive, reply_window_us } =
            setting.unwrap_or(BusSetting {
                bitrate: 0,
                protocols: 0,
                exclusive: false,
                reply_window_us: 0,
            });
        let is_can = self.buses.get(usize::from(index)).is_some_and(Bus::is_can);
        let has_rate = !is_can || D5_BITRATES.contains(&bitrate);
        if protocols & D5 != 0 && (protocols != D5 || !has_rate) {
            let seen = format!("bus {index} at {bitrate} bit/s, protocols {protocols:03b}");
            self.broken(Check::BusShared, now, seen);
        }
        if let Some(bus) = self.buses.get_mut(usize::from(index)) {
            bus.bitrate = bitrate;
            bus.protocols = protocols;
            bus.exclusive = exclusive;
            bus.window_us = reply_window_us.into();
            bus.close_raw(now);
        }
    }

    fn axis_changed(&mut self, now: u64, index: u8, parameter: u16, value: Option<u32>) {
        let Some(axis) = self.axes.get_mut(usize::from(index)) else { return };
        let before = axis.bus();
        let moved = axis.set(parameter, value);
        let after = axis.bus();
        let open =
            after.and_then(|bus| self.buses.get(bus)).filter(|bus| bus.raw_open && bus.raw_unsafe);
        if open.is_some() {
            let seen = format!(
                "axis {index} is configured on bus {after:?}, which is open for everything"
            );
            self.broken(Check::RawUnopened, now, seen);
        }
        self.close_raw(before, now);
        self.close_raw(after, now);
        if moved {
            self.orphan(index);
        }
    }

    fn removed(&mut self, now: u64, index: u8) {
        let Some(axis) = self.axes.get_mut(usize::from(index)) else { return };
        let before = std::mem::take(axis).bus();
        self.close_raw(before, now);
        self.orphan(index);
        self.note_extended();
    }

    /// When a request was made.
    fn asked_us(&self, link: u8, sequence: u16) -> Option<u64> {
        self.links[usize::from(link)]
            .records
            .iter()
            .find(|r| r.sequence == sequence)
            .map(|r| r.at_us)
    }

    /// No bus is open for raw frames any more.
    pub(crate) fn close_all_raw(&mut self, now: u64) {
        for bus in &mut self.buses {
            bus.close_raw(now);
        }
    }

    /// A setpoint was accepted: it should not have been unless it was offered.
    fn grant(
        &mut self,
        now: u64,
        link: u8,
        sequence: u16,
        index: u8,
        (epoch, expires_at_us): (u32, u32),
    ) {
        let Some(axis) = self.axes.get_mut(usize::from(index)) else { return };
        let offered = axis.permits.iter().rposition(|p| (p.link, p.sequence) == (link, sequence));
        if let Some(offered) = offered {
            in_force(axis, offered);
            self.deliver(now, index.into());
            return;
        }
        // The axis may have been stopped since, or the host may read late.
        let at = self.asked_us(link, sequence);
        let axis = &self.axes[usize::from(index)];
        if at != Some(now) {
            return;
        }
        let check = match axis.epoch {
            _ if !axis.armed => Check::MotionUnarmed,
            Some(current) if current != epoch => Check::EpochIgnored,
            Some(_) => Check::ExpiryIgnored,
            // Its host has not read yet which epoch it is.
            None => return,
        };
        let seen = format!(
            "axis {index} takes a setpoint of epoch {epoch} that expires at {expires_at_us}"
        );
        self.broken(check, now, seen);
    }

    /// A permission whose result is there: in force if it was not before.
    fn fulfil(&mut self, now: u64, link: u8, sequence: u16, index: u8) {
        let Some(axis) = self.axes.get_mut(usize::from(index)) else { return };
        let offered =
            |p: &crate::axis::Permit| (p.link, p.sequence) == (link, sequence) && !p.in_force;
        if let Some(offered) = axis.permits.iter().rposition(offered) {
            in_force(axis, offered);
            self.deliver(now, index.into());
        }
    }

    /// A request was refused: what it offered is void. A native motion that fails later trips its
    /// axis or was replaced.
    pub(super) fn refused(&mut self, link: u8, sequence: u16) {
        for axis in &mut self.axes {
            axis.permits.retain(|p| (p.link, p.sequence) != (link, sequence) || p.in_force);
        }
    }
}

/// A bit for each axis that took nothing of a cycle, as its report says (PROTOCOL.md, the cycle).
fn refused_in_cycle(message: &Message) -> Option<u32> {
    const REFUSED: u8 = 4;
    const POSITION: u8 = 0;
    const FAULTS: u8 = 6;
    let mut body = Body(message.body());
    let (_time, fields, axes) = (body.fixed_u32()?, body.byte()?, body.u32()?);
    let mut states = Body(body.bytes(480)?);
    let mut refused = 0;
    for axis in (0..32).filter(|axis| axes >> axis & 1 == 1) {
        if states.byte()? >> 4 == REFUSED {
            refused |= 1 << axis;
            states.u16()?;
        }
        states.u16()?;
        for field in (0..=FAULTS).filter(|field| fields >> field & 1 == 1) {
            match field {
                POSITION => drop(states.f32()?),
                FAULTS => drop(states.optional(Body::u16)?),
                _ => drop(states.u32()?),
            }
        }
    }
    states.end(())?;
    body.end(refused)
}

/// Puts a permission in force: it takes the place of those before it.
pub(super) fn in_force(axis: &mut Axis, index: usize) {
    axis.permits[index].in_force = true;
    axis.permits[index].is_relative = false;
    axis.permits.drain(..index);
}
