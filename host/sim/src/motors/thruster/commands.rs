//! What a thruster makes of each command.

use std::time::Duration;

use thruster::{
    Faults, POSITION_LIMITS, Reply, Request, SIGNAL_MAX, SPEED_MIN_MAGNITUDE, TIMEOUT_MAX,
    TIMEOUT_MIN, TIMEOUT_OFF,
};

use super::names::name;
use super::positions;
use super::{LATCHED, OUTPUT_OFF, RPM, Thruster};
use crate::motors::model::Context;
use crate::motors::stall::StallGuard;

impl Thruster {
    pub(super) fn carry_out(&mut self, cx: &mut Context<'_>, request: &Request) -> Reply {
        match *request {
            Request::Signal { signal } => {
                let fits = signal.0.unsigned_abs() <= SIGNAL_MAX.unsigned_abs();
                let rad_s =
                    f64::from(signal.0) / f64::from(SIGNAL_MAX) * self.plant.max_speed_rad_s();
                self.run_at(cx, request, fits.then_some(rad_s), Reply::Signal { signal })
            }
            Request::Speed { speed } => {
                let fits = speed.0 == 0 || speed.0.unsigned_abs() >= SPEED_MIN_MAGNITUDE;
                let rad_s = f64::from(speed.0) * RPM;
                self.run_at(cx, request, fits.then_some(rad_s), Reply::Speed { speed })
            }
            Request::EmergencyStop => {
                if self.may_stop(cx, request) {
                    self.wanted_rad_s = 0.0;
                    self.positions.stop();
                }
                Reply::EmergencyStop
            }
            Request::SetTimeout { timeout } => {
                if timeout.0 != TIMEOUT_OFF && !(TIMEOUT_MIN..=TIMEOUT_MAX).contains(&timeout.0) {
                    return refusal(request);
                }
                self.timeout = Duration::from_millis(u64::from(timeout.0));
                Reply::Timeout { timeout }
            }
            Request::ClearFaults => {
                self.faults -= LATCHED;
                self.stall = StallGuard::default();
                Reply::FaultsCleared
            }
            Request::AbsolutePosition { .. }
            | Request::SetAbsoluteZero
            | Request::SetPositionLimits { .. }
            | Request::RelativePosition { .. }
            | Request::SetRelativeZero
            | Request::ClearRelativePosition => self.position(cx, request),
            Request::ReadAbsolutePosition => {
                Reply::MeasuredPosition { position: self.readings().absolute }
            }
            Request::ReadRelativePosition => {
                Reply::MeasuredRelativePosition { position: self.readings().relative }
            }
            Request::ReadPositionLimits => {
                let (reverse, forward) = self.positions.limits();
                Reply::PositionLimits { reverse, forward }
            }
            Request::RequestMode | Request::LowSpeedMode | Request::MediumSpeedMode => {
                self.returns.set_mode(request, cx.now)
            }
            Request::SetId { id } => {
                let reply = accepted(request, Reply::Id { id });
                if let Some(node) = u8::try_from(id).ok().filter(|_| reply == (Reply::Id { id })) {
                    self.stored.next_node = Some(node);
                }
                reply
            }
            Request::SetBitrate { bitrate } => {
                let reply = accepted(request, Reply::Bitrate { bitrate });
                if bitrate.info().is_some() {
                    self.stored.next_kilobits = Some(bitrate.0);
                }
                reply
            }
            Request::ConfigureReturn { flags, frames } => {
                let reply = accepted(request, Reply::ReturnConfigured { flags, frames });
                if reply == (Reply::ReturnConfigured { flags, frames }) {
                    self.returns.configure(flags, frames);
                }
                reply
            }
            Request::ConfigureStream { frames, interval } => {
                let reply = accepted(request, Reply::StreamConfigured { frames, interval });
                if reply == (Reply::StreamConfigured { frames, interval }) {
                    self.returns.stream(frames, interval, cx.now);
                }
                reply
            }
            Request::SetParameter { parameter, data } => {
                self.stored.set_parameter(parameter, data);
                Reply::ParameterSet { parameter, data }
            }
            Request::ReadParameter { parameter } => {
                Reply::Parameter { parameter, data: self.stored.parameter(parameter) }
            }
            Request::ReadSpeed => Reply::MeasuredSpeed { speed: self.readings().speed },
            Request::ReadCurrent => Reply::Current { current: self.readings().current },
            Request::ReadVoltage => Reply::Voltage { voltage: self.readings().voltage },
            Request::ReadMotorTemperature => {
                Reply::MotorTemperature { temperature: self.readings().motor }
            }
            Request::ReadDriverTemperature => {
                Reply::DriverTemperature { temperature: self.readings().driver }
            }
            Request::ReadFaults => Reply::Faults { faults: self.faults },
            Request::ReadFaultRecord => Reply::FaultRecord { faults: self.record },
            Request::Unknown { payload } => Reply::Unknown { payload },
        }
    }

    /// Takes a new speed, or refuses it. `None`: outside the manual's range.
    fn run_at(
        &mut self,
        cx: &mut Context<'_>,
        request: &Request,
        rad_s: Option<f64>,
        accepted: Reply,
    ) -> Reply {
        let Some(rad_s) = rad_s else { return refusal(request) };
        if rad_s == 0.0 {
            if !self.may_stop(cx, request) {
                return accepted;
            }
            self.zero_seen = true;
            self.wanted_rad_s = 0.0;
            self.faults -= Faults::ZERO_PROTECTION;
        } else if !self.zero_seen {
            self.faults |= Faults::ZERO_PROTECTION;
        }
        if self.faults.intersects(OUTPUT_OFF) {
            self.wanted_rad_s = 0.0;
            cx.ignored(name(request).unwrap_or_default(), "fault");
            return refusal(request);
        }
        if rad_s != 0.0 && cx.injected.ignore_motion {
            cx.ignored(name(request).unwrap_or_default(), "injected");
            return accepted;
        }
        self.wanted_rad_s = rad_s;
        if rad_s != 0.0 {
            self.positions.stop();
        }
        accepted
    }

    /// A position command, which a device without an encoder refuses.
    fn position(&mut self, cx: &mut Context<'_>, request: &Request) -> Reply {
        let name = name(request).unwrap_or_default();
        let moves =
            matches!(request, Request::AbsolutePosition { .. } | Request::RelativePosition { .. });
        if !cx.injected.encoder || request.encode().is_err() {
            return refusal(request);
        }
        if moves && self.faults.intersects(OUTPUT_OFF | Faults::ENCODER) {
            cx.ignored(name, "fault");
            return refusal(request);
        }
        if moves && cx.injected.ignore_motion {
            cx.ignored(name, "injected");
        } else if !self.positions.obey(request, &self.plant) {
            cx.ignored(name, "position limit");
        }
        if moves && self.positions.target().is_some() {
            self.wanted_rad_s = 0.0;
        }
        positions::taken(request)
    }

    fn may_stop(&self, cx: &mut Context<'_>, request: &Request) -> bool {
        if cx.injected.ignore_stop {
            let name = name(request).unwrap_or_default();
            cx.ignored(name, "injected");
        }
        !cx.injected.ignore_stop
    }
}

/// The reply to a setting that the manual allows, else the refusal.
fn accepted(request: &Request, reply: Reply) -> Reply {
    if request.encode().is_ok() { reply } else { refusal(request) }
}

pub(super) fn refusal(request: &Request) -> Reply {
    let parameter = match request {
        Request::AbsolutePosition { speed, .. } | Request::RelativePosition { speed, .. } => {
            speed.0
        }
        Request::SetPositionLimits { .. } => POSITION_LIMITS,
        _ => 0,
    };
    Reply::Refused { command: request.command(), parameter }
}
