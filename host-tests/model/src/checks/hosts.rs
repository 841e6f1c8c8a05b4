//! What hosts ask for: authority, permissions, stops (G1, G2, G9).

use super::together::bit_of;
use crate::axis::{Axis, Cause, Permit, Start};
use crate::link::Arrival;
use crate::motor::Purpose;
use crate::oracle::Oracle;
use crate::wire::{Clears, Deframer, Kind, Request, Stops, Told};

impl Oracle {
    /// Bytes of a host arrive.
    pub fn to_gateway(&mut self, now: u64, link: u8, bytes: &[u8]) {
        self.advance(now);
        for byte in bytes {
            let Some(port) = self.links.get_mut(usize::from(link)) else { return };
            let Some(message) = port.incoming.push(*byte) else { continue };
            let watches = message.kind == Kind::WatcherRequest;
            if !watches && message.kind != Kind::Request {
                continue;
            }
            // Any request that can be read shows that the host is there, a repeated one too, but none
            // that it passes on for who only watches.
            if let Some((holder, heard_us)) = &mut self.holder
                && *holder == link
                && !watches
                && Request::read(&message) != Request::Unreadable
            {
                *heard_us = now;
            }
            match port.arrive(now, message) {
                Arrival::New => self.execute(now, link, watches),
                Arrival::Repeated(request) => {
                    if matches!(request, Request::Stop(_) | Request::EStop | Request::Disarm(_)) {
                        self.stop_on_request(now, &request);
                    }
                }
                // Stops are executed all the same.
                Arrival::NoPlace(request) => self.stop_on_request(now, &request),
            }
        }
    }

    /// Whether the gateway may take these bytes of a host for a request that was there before, or
    /// for a new one.
    #[must_use]
    pub fn may_know(&self, link: u8, bytes: &[u8]) -> bool {
        let Some(port) = self.links.get(usize::from(link)) else { return false };
        let mut incoming = Deframer::default();
        bytes
            .iter()
            .filter_map(|byte| incoming.push(*byte))
            .any(|message| port.may_know(&message.bytes))
    }

    /// Executes the newest request of a link, as far as that does not depend on its result.
    fn execute(&mut self, now: u64, link: u8, watches: bool) {
        let record = &mut self.links[usize::from(link)].records[0];
        let (request, sequence) = (record.request.clone(), record.sequence);
        let takes = request.takes_authority() || self.native_takes(&request);
        let record = &mut self.links[usize::from(link)].records[0];
        match self.holder {
            _ if takes && watches => {
                record.must_be_refused = true;
                return;
            }
            None if takes => {
                self.holder = Some((link, now));
                record.took = true;
            }
            Some((holder, _)) if takes && holder != link => {
                record.must_be_refused = true;
                return;
            }
            _ => {}
        }
        self.stop_on_request(now, &request);
        let in_command = !watches && self.holder.is_some_and(|(holder, _)| holder == link);
        match request {
            Request::Clear(Clears::Axis(axis))
            | Request::ClearByRestart(axis)
            | Request::ClearUnreachable(axis) => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.clearing += 1;
                }
            }
            Request::Provision { axis, timeout_ms } => {
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.is_to_be_told = true;
                    axis.motor_timeouts_asked.push(timeout_ms);
                }
            }
            Request::Hello if in_command => self.lose_authority(now),
            Request::OutputOff(axis) => {
                let axis = self.axes.get_mut(usize::from(axis));
                if let Some(axis) = axis.filter(|axis| axis.told == Told::Holding) {
                    axis.output_off_asked = true;
                }
            }
            Request::ReleaseAuthority if in_command => self.lose_authority(now),
            Request::Setpoint { axis, epoch, expires_at_us } => {
                self.offer(now, axis, epoch, expires_at_us, |permit| Permit {
                    link,
                    sequence,
                    ..permit
                });
            }
            Request::MoveRelative { axis, epoch, expires_at_us } => {
                let is_relative = true;
                self.offer(now, axis, epoch, expires_at_us, |permit| Permit {
                    link,
                    sequence,
                    is_relative,
                    ..permit
                });
            }
            Request::Cycle { axes, epoch, expires_at_us } => {
                for axis in (0..32).filter(|axis| axes >> axis & 1 == 1) {
                    let of_cycle = true;
                    self.offer(now, axis, epoch, expires_at_us, |permit| Permit {
                        link,
                        sequence,
                        of_cycle,
                        ..permit
                    });
                }
            }
            Request::StartTogether { expires_at_us, members } => {
                let named = members.iter().fold(0, |named, (axis, _)| named | bit_of(*axis));
                for (axis, epoch) in members {
                    let start = Start {
                        members: named,
                        asked_us: now,
                        told: None,
                        told_us: 0,
                        waits: false,
                        has_started: false,
                    };
                    self.offer(now, axis, epoch, expires_at_us, |permit| Permit {
                        link,
                        sequence,
                        start: Some(start),
                        ..permit
                    });
                }
            }
            Request::Native { axis, epoch, expires_at_us, data } => {
                let protocol = self.axes.get(usize::from(axis)).and_then(|axis| axis.protocol());
                // Allowance: arming may end at the very instant at which it is asked.
                let may_take = |axis: &&mut Axis| matches!(axis.told, Told::Idle | Told::Arming);
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.is_to_be_told = true;
                }
                if let Some(axis) = self.axes.get_mut(usize::from(axis)).filter(may_take)
                    && protocol.map(|protocol| protocol.purpose(&data)) == Some(Purpose::Stop)
                    && !axis.native_stops.contains(&data)
                {
                    axis.native_stops.push(data.clone());
                }
                let once = match protocol.map(|protocol| protocol.asked_by_host(&data)) {
                    Some(Purpose::Motion { once }) => once,
                    Some(Purpose::Rest) => false,
                    _ => return,
                };
                let native = Some(data);
                self.offer(now, axis, epoch, expires_at_us, |permit| Permit {
                    link,
                    sequence,
                    native,
                    once,
                    ..permit
                });
            }
            _ => {}
        }
    }

    /// Whether a native command takes authority: by what its bytes do (PROTOCOL.md, Native
    /// commands).
    fn native_takes(&self, request: &Request) -> bool {
        let Request::Native { axis, epoch, data, .. } = request else { return false };
        let Some(axis) = self.axes.get(usize::from(*axis)) else { return false };
        let Some(protocol) = axis.protocol().filter(|_| axis.is_complete()) else { return false };
        if !protocol.has_data_fields_of(data.len()) {
            return false;
        }
        // Behind a stop that nobody has been told of yet it is not idle any more.
        let is_idle = axis.told == Told::Idle && axis.duty.is_none();
        match protocol.asked_by_host(data) {
            Purpose::Read => false,
            Purpose::Motion { .. } | Purpose::Change => true,
            Purpose::Stop => is_idle,
            // With the epoch of an armed axis it is a setpoint, else a stop.
            Purpose::Rest => is_idle || axis.armed && axis.epoch == Some(*epoch),
        }
    }

    /// A permission to move that is in force once the gateway says so, if nothing known speaks
    /// against it.
    fn offer(
        &mut self,
        now: u64,
        axis: u8,
        epoch: u32,
        expires_at_us: u32,
        complete: impl FnOnce(Permit) -> Permit,
    ) {
        let Some(axis) = self.axes.get_mut(usize::from(axis)) else { return };
        // Allowance: armed, its epoch not told yet, as others are still being armed: a host may
        // guess.
        if !axis.armed || axis.epoch.is_some_and(|current| current != epoch) || self.e_stopped {
            return;
        }
        #[allow(clippy::cast_possible_truncation)] // The low 32 bits are what the wire carries.
        let lead = u64::from(expires_at_us.wrapping_sub(now as u32));
        let expires_us = if axis.is_without_expiry() {
            None
        } else if (1..=axis.ttl_us()).contains(&lead) {
            Some(now + lead)
        } else {
            return;
        };
        axis.permits.push(complete(Permit {
            link: 0,
            sequence: 0,
            epoch,
            expires_us,
            in_force: false,
            is_relative: false,
            of_cycle: false,
            native: None,
            data: None,
            once: false,
            sent: false,
            start: None,
        }));
    }

    /// What stops does so whatever its result.
    pub(crate) fn stop_on_request(&mut self, now: u64, request: &Request) {
        let (one, cause) = match request {
            Request::Stop(Stops::Axis(axis)) | Request::Disarm(axis) => {
                (Some(usize::from(*axis)), Cause::Asked)
            }
            Request::Stop(Stops::All) => (None, Cause::Asked),
            Request::EStop => {
                self.e_stopped = true;
                self.e_stop_asked_us = Some(now);
                self.close_all_raw(now);
                (None, Cause::EStop)
            }
            _ => return,
        };
        for index in 0..self.axes.len() {
            let axis = &self.axes[index];
            let meant = one.is_none_or(|one| one == index);
            // On a bus that is off it is owed until the bus is back.
            let runs =
                axis.bus().and_then(|bus| self.buses.get(bus)).is_some_and(|bus| bus.bitrate > 0);
            // All of them: those at rest too, where something else may have set the motor in
            // motion.
            let at_rest = one.is_none() && axis.told.is_at_rest() && axis.is_complete() && runs;
            if meant && (axis.armed || axis.told == Told::Arming || at_rest) {
                self.owe_stop(index, cause, now);
            }
        }
    }

    /// Nobody is in command any more, since `at`.
    pub(crate) fn lose_authority(&mut self, at: u64) {
        self.holder = None;
        self.close_all_raw(at);
        for axis in 0..self.axes.len() {
            if self.axes[axis].armed {
                self.owe_stop(axis, Cause::Host, at);
            }
        }
    }
}
