//! What an RMD motor does with each command, and what it answers (RMD V3.6 §2, §4, §5, §7).

use std::time::Duration;

use super::super::dynamics::Drive;
use super::super::log::MotorEvent;
use super::super::model::Context;
use super::{ACCELERATION, NM_PER_AMPERE, Rmd};
use rmd::{
    Centidegrees, DegreesPerSecondSquared, EncoderPulses, Function, Milliseconds, Model, Node,
    Ramp, Reply, Request, VersionDate, command,
};

/// The brake takes this long to open, and only then is the command answered (observed).
const RELEASE_MIN: Duration = Duration::from_millis(50);
const RELEASE_MAX: Duration = Duration::from_millis(150);
/// What the manual prints in its examples (RMD V3.6 §2.29.4, §2.32.4).
const VERSION: u32 = 20_220_206;
const MODEL: [u8; 7] = *b"X8S2V10";

/// Commands that move: closed-loop ones, and motion mode.
pub(super) fn is_motion(request: &Request) -> bool {
    command::CLOSED_LOOP.contains(&request.command())
        || matches!(request, Request::MotionMode { .. })
}

impl Rmd {
    pub(super) fn carry_out(&mut self, cx: &mut Context<'_>, request: &Request) {
        if self.only_echoes(cx, request) {
            return self.echo(cx, request);
        }
        self.wanted = self.drive_for(cx, request).unwrap_or(self.wanted);
        let Some(reply) = self.reply_to(cx, request) else { return };
        if is_motion(request) && std::mem::take(&mut self.locked_by_timeout) && self.has_brake {
            // Communication is back to normal, and so is the motor (RMD V3.6 §2.30.4).
            cx.log(MotorEvent::BrakeReleased);
        }
        self.answer(cx, &reply);
    }

    /// What a command asks of the shaft.
    fn drive_for(&self, cx: &Context<'_>, request: &Request) -> Option<Drive> {
        let target = |angle: Centidegrees| self.memory.zero_rad() + radians(angle);
        Some(match *request {
            Request::Shutdown => Drive::Off,
            Request::Stop => Drive::Speed { rad_s: 0.0, acceleration: ACCELERATION },
            Request::TorqueCurrent { current } => Drive::Current(f64::from(current.0) / 100.0),
            Request::Velocity { speed } | Request::CappedVelocity { speed, .. } => {
                let rad_s = (f64::from(speed.0) / 100.0).to_radians();
                let dps_s = self.memory.ramp(Ramp::VELOCITY_ACCELERATION);
                Drive::Speed { rad_s, acceleration: f64::from(dps_s).to_radians() }
            }
            Request::PositionTracking { angle } => {
                Drive::Position { rad: target(angle), max_speed: self.plant.max_speed_rad_s() }
            }
            Request::AbsolutePosition { max_speed, angle }
            | Request::CappedPosition { max_speed, angle, .. } => Drive::Position {
                rad: target(angle),
                max_speed: f64::from(max_speed.0).to_radians(),
            },
            Request::LimitedPositionTracking { max_speed, angle } => {
                let max_speed = (f64::from(max_speed.0) / 100.0).to_radians();
                Drive::Position { rad: target(angle), max_speed }
            }
            Request::IncrementalPosition { max_speed, angle } => {
                let rad = self.plant.position_rad() + radians(angle);
                Drive::Position { rad, max_speed: f64::from(max_speed.0).to_radians() }
            }
            Request::MotionMode { command } => {
                let target = self.ranges(cx).target(&command);
                Drive::Spring {
                    rad: self.memory.zero_rad() + target.position_rad,
                    rad_s: target.velocity_rad_s,
                    amps_per_rad: target.kp / NM_PER_AMPERE,
                    amp_s_per_rad: target.kd / NM_PER_AMPERE,
                    amps: target.torque_nm / NM_PER_AMPERE,
                }
            }
            _ => return None,
        })
    }

    /// Does the rest, and says what is answered now.
    fn reply_to(&mut self, cx: &mut Context<'_>, request: &Request) -> Option<Reply> {
        let motion = self.motion();
        let shaft_rad = self.plant.position_rad();
        Some(match *request {
            Request::ReadPid => Reply::Pid { gains: self.memory.gains() },
            Request::WritePidRam { gains } => {
                self.memory.set_gains(&gains, false);
                Reply::PidRamWritten { gains }
            }
            Request::WritePidRom { gains } => {
                self.memory.set_gains(&gains, true);
                Reply::PidRomWritten { gains }
            }
            Request::ReadAcceleration => {
                let dps_s = self.memory.ramp(Ramp::POSITION_ACCELERATION);
                Reply::Acceleration { acceleration: DegreesPerSecondSquared(dps_s) }
            }
            Request::WriteAcceleration { ramp, acceleration } => {
                self.memory.set_ramp(ramp, acceleration.0);
                Reply::AccelerationWritten { ramp, acceleration }
            }
            Request::ReadEncoderPosition => {
                let pulses = self.memory.pulses(shaft_rad).wrapping_sub(self.memory.offset());
                Reply::EncoderPosition { position: EncoderPulses(pulses) }
            }
            Request::ReadEncoderRawPosition => {
                Reply::EncoderRawPosition { position: EncoderPulses(self.memory.pulses(shaft_rad)) }
            }
            Request::ReadEncoderOffset => {
                Reply::EncoderOffset { offset: EncoderPulses(self.memory.offset()) }
            }
            Request::WriteEncoderOffset { offset } => {
                self.memory.store_offset(offset.0);
                Reply::EncoderOffsetWritten { offset }
            }
            Request::WritePositionAsZero => {
                let pulses = self.memory.pulses(shaft_rad);
                self.memory.store_offset(pulses);
                Reply::PositionWrittenAsZero { offset: EncoderPulses(pulses) }
            }
            Request::ReadMultiTurnAngle => Reply::MultiTurnAngle { angle: self.angle() },
            Request::ReadStatus1 => self.status_1(),
            Request::ReadStatus2 => Reply::Status2 { motion },
            Request::ReadStatus3 => self.status_3(),
            Request::Shutdown => Reply::Shutdown,
            Request::Stop => Reply::Stop,
            Request::TorqueCurrent { .. } => Reply::TorqueCurrent { motion },
            Request::Velocity { .. } => Reply::Velocity { motion },
            Request::PositionTracking { .. } => Reply::PositionTracking { motion },
            Request::AbsolutePosition { .. } => Reply::AbsolutePosition { motion },
            Request::LimitedPositionTracking { .. } => Reply::LimitedPositionTracking { motion },
            Request::IncrementalPosition { .. } => Reply::IncrementalPosition { motion },
            Request::MotionMode { .. } => Reply::MotionMode { feedback: self.feedback() },
            Request::ReadRunMode => Reply::RunMode { mode: self.run_mode() },
            Request::ReadPower => Reply::Power { power: self.power() },
            Request::Reset => {
                if !cx.injected.ignore_restart {
                    self.restart(cx);
                }
                return None;
            }
            Request::ReleaseBrake => {
                let takes = match cx.injected.prompt_brake {
                    true => Duration::ZERO,
                    false => cx.random.between(RELEASE_MIN, RELEASE_MAX),
                };
                self.release_at = Some(cx.now + takes);
                self.interface.send(cx, self.node, takes, &Reply::BrakeReleased);
                return None;
            }
            Request::LockBrake => {
                self.release_at = None;
                if self.has_brake && !self.is_locked() {
                    cx.log(MotorEvent::BrakeLocked);
                }
                self.brake_released = false;
                Reply::BrakeLocked
            }
            Request::ReadRunTime => Reply::RunTime { time: Milliseconds(self.run_time_ms(cx.now)) },
            Request::ReadVersionDate => {
                let injected = cx.injected.rmd_firmware;
                let date = if injected == 0 { VERSION } else { injected };
                Reply::VersionDate { date: VersionDate(date) }
            }
            Request::SetCommunicationTimeout { timeout } => {
                self.memory.timeout_ms = timeout.0;
                Reply::CommunicationTimeout { timeout }
            }
            Request::SetBaudRate { code } => {
                let bitrate = self.interface.rate(code, self.dialect(cx));
                self.memory.store_bitrate(bitrate);
                Reply::BaudRateSet { raw: std::array::from_fn(|_| cx.random.byte()) }
            }
            Request::ReadModel => Reply::Model { model: Model(MODEL) },
            Request::Function { function } if !matches!(function, Function::NextCanId { .. }) => {
                self.memory.function(function, shaft_rad);
                Reply::Function { function }
            }
            Request::ReadCanId => Reply::CanId { id: self.node },
            Request::ReadRs485Id => Reply::Rs485Id { id: self.node },
            Request::SetCanId { id } => {
                self.node = Node::new(id).ok()?;
                Reply::CanIdSet { id: self.node }
            }
            Request::SetRs485Id { id } => {
                self.node = Node::new(id).ok()?;
                Reply::Rs485IdSet { id: self.node }
            }
            _ => return self.reply_to_newer(request),
        })
    }
}

fn radians(angle: Centidegrees) -> f64 {
    (f64::from(angle.0) / 100.0).to_radians()
}

/// A command as the log names it.
pub(super) fn name(request: &Request) -> &'static str {
    match request {
        Request::ReadPid => "0x30 read gains",
        Request::WritePidRam { .. } => "0x31 gains",
        Request::WritePidRom { .. } => "0x32 gains",
        Request::ReadAcceleration => "0x42 read acceleration",
        Request::WriteAcceleration { .. } => "0x43 acceleration",
        Request::ReadEncoderPosition => "0x60 read encoder",
        Request::ReadEncoderRawPosition => "0x61 read encoder",
        Request::ReadEncoderOffset => "0x62 read zero point",
        Request::WriteEncoderOffset { .. } => "0x63 zero point",
        Request::WritePositionAsZero => "0x64 zero here",
        Request::ReadMultiTurnAngle => "0x92 read angle",
        Request::ReadStatus1 => "0x9A read status 1",
        Request::ReadStatus2 => "0x9C read status 2",
        Request::ReadStatus3 => "0x9D read status 3",
        Request::Shutdown => "0x80 shutdown",
        Request::Stop => "0x81 stop",
        Request::TorqueCurrent { .. } => "0xA1 current",
        Request::Velocity { .. } => "0xA2 velocity",
        Request::PositionTracking { .. } => "0xA3 position",
        Request::AbsolutePosition { .. } => "0xA4 position",
        Request::LimitedPositionTracking { .. } => "0xA5 position",
        Request::IncrementalPosition { .. } => "0xA8 incremental position",
        Request::MotionMode { .. } => "motion mode",
        Request::ReadRunMode => "0x70 read run mode",
        Request::ReadPower => "0x71 read power",
        Request::Reset => "0x76 restart",
        Request::ReleaseBrake => "0x77 release brake",
        Request::LockBrake => "0x78 lock brake",
        Request::ReadRunTime => "0xB1 read run time",
        Request::ReadVersionDate => "0xB2 read version",
        Request::SetCommunicationTimeout { .. } => "0xB3 timeout",
        Request::SetBaudRate { .. } => "0xB4 baud rate",
        Request::ReadModel => "0xB5 read model",
        Request::Function { .. } => "0x20 function",
        Request::ReadCanId | Request::ReadRs485Id => "0x79 read id",
        Request::SetCanId { .. } | Request::SetRs485Id { .. } => "0x79 id",
        Request::CappedVelocity { .. } => "0xA2 velocity, capped",
        Request::CappedPosition { .. } => "0xA9 position, capped",
        Request::ReadGain { .. } => "0x30 read gain",
        Request::WriteGainRam { .. } => "0x31 gain",
        Request::WriteGainRom { .. } => "0x32 gain",
        Request::ReadRamp { .. } => "0x42 read acceleration",
        Request::ReadModelPart { .. } => "0xB5 read model",
        _ => "unknown",
    }
}
