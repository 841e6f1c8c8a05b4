//! What a scenario does.

use super::bench::{Bench, SETPOINT_TTL};
use super::words::{duration, parameter, parse, protocols, setpoint};
use host_protocol::{ClearTarget, RawFrame, StopTarget, replies::Armed, requests};
use mgw_client::ClientError;
use mgw_sim::{BusFault, Injection};

impl Bench {
    pub fn step(&mut self, words: &[&str]) -> Result<(), String> {
        let (verb, rest) = words.split_first().ok_or("an empty step")?;
        let result = match *verb {
            "run" => self.run(duration(rest, 0)?),
            "silence" => {
                self.silence(duration(rest, 0)?);
                Ok(())
            }
            "mark" => {
                self.mark_us = self.now_us();
                Ok(())
            }
            "keep" => {
                let axis = parse(rest, 0, "axis")?;
                self.kept.retain(|(kept, _)| *kept != axis);
                self.kept.push((axis, setpoint(rest, 1)?));
                self.run(std::time::Duration::ZERO)
            }
            "drop" => {
                let axis: u8 = parse(rest, 0, "axis")?;
                self.kept.retain(|(kept, _)| *kept != axis);
                Ok(())
            }
            "inject" => self.inject(rest),
            "bus-cut" => self.disturb(rest, BusFault::Cut),
            "bus-short" => self.disturb(rest, BusFault::Short),
            "bus-join" => self.disturb(rest, BusFault::None),
            "expect" => self.expect(rest),
            "refused" => self.refused(rest),
            "bytes" => {
                let bytes = rest.iter().map(|byte| u8::from_str_radix(byte, 16));
                let bytes: Result<Vec<u8>, _> = bytes.collect();
                self.world.borrow_mut().host_send(0, &bytes.map_err(|e| e.to_string())?);
                Ok(())
            }
            _ => self.request(words).map_err(|error| error.to_string()),
        };
        self.collect();
        result
    }

    /// A step that is one request of the host.
    fn request(&mut self, words: &[&str]) -> Result<(), StepError> {
        let (verb, rest) = words.split_first().ok_or("an empty step".to_string())?;
        match *verb {
            "bus" => {
                let bus = parse(rest, 0, "bus")?;
                let bitrate = parse(rest, 1, "bitrate")?;
                let protocols = protocols(rest.get(2).copied().unwrap_or_default())?;
                let window = if rest.len() > 3 { parse(rest, 3, "reply window")? } else { 5_000 };
                let request = requests::ConfigureBus {
                    bus,
                    bitrate,
                    protocols,
                    wholly_ours: false,
                    reply_window_us: window,
                };
                self.client.request(&request)?;
            }
            "axis" => {
                let axis = parse(rest, 0, "axis")?;
                for text in rest.iter().skip(1) {
                    let (name, value) = parameter(text)?;
                    self.client.configure_axis(axis, name, value)?;
                }
            }
            "four-axes" => self.four_axes()?,
            "timeout" => {
                self.client.provision_motor_timeout(parse(rest, 0, "axis")?, parse(rest, 1, "timeout")?)?;
            }
            "arm" => {
                for at in 0..rest.len() {
                    let axis = parse(rest, at, "axis")?;
                    let Armed { epoch, .. } = self.client.arm(axis)?;
                    self.epochs.retain(|(armed, _)| *armed != axis);
                    self.epochs.push((axis, epoch));
                }
            }
            "disarm" => self.client.disarm(parse(rest, 0, "axis")?)?,
            "set" => {
                let value = setpoint(rest, 1)?;
                self.set(parse(rest, 0, "axis")?, value)?;
            }
            "set-epoch" => {
                let (axis, epoch): (u8, u32) = (parse(rest, 0, "axis")?, parse(rest, 1, "epoch")?);
                self.client.set(axis, epoch, setpoint(rest, 2)?, SETPOINT_TTL)?;
            }
            "set-expired" => {
                let axis: u8 = parse(rest, 0, "axis")?;
                let epoch =
                    self.epochs.iter().find(|(armed, _)| *armed == axis).map_or(0, |(_, epoch)| *epoch);
                let expires_at_us = self.client.expiry(std::time::Duration::ZERO).wrapping_sub(1_000);
                let setpoint = setpoint(rest, 1)?;
                self.client.request(&requests::Setpoint { axis, epoch, expires_at_us, setpoint })?;
            }
            "stop" => match rest.first() {
                Some(&"all") => self.client.stop(StopTarget::All)?,
                _ => self.client.stop(StopTarget::Axis(parse(rest, 0, "axis")?))?,
            },
            "estop" => self.client.estop()?,
            "clear" => match rest.first() {
                Some(&"gateway") => self.client.clear(ClearTarget::Gateway)?,
                _ => self.client.clear(ClearTarget::Axis(parse(rest, 0, "axis")?))?,
            },
            "clear-unreachable" => {
                self.client.request(&requests::ClearUnreachable { axis: parse(rest, 0, "axis")? })?;
            }
            "read" => {
                self.client.read_state(parse(rest, 0, "axis")?)?;
            }
            "release" => self.client.release_authority()?,
            "reconnect" => self.client.reconnect()?,
            "raw-open" => self.client.raw_open(parse(rest, 0, "bus")?)?,
            "raw-close" => self.client.raw_close(parse(rest, 0, "bus")?)?,
            "raw-send" => {
                let frame = raw_frame(rest.get(1).copied().unwrap_or_default())?;
                self.client.raw_send(parse(rest, 0, "bus")?, frame)?;
            }
            other => return Err(StepError::Script(format!("{other} is no step"))),
        }
        Ok(())
    }

    /// The axes of `Wiring::four_motors`: 0 RMD on CAN, 1 RMD on RS485, 2 thruster, 3 D5.
    fn four_axes(&mut self) -> Result<(), StepError> {
        for line in [
            "bus 0 1000000 rmd,thruster",
            "bus 1 210526 d5",
            "bus 2 115200 rmd",
            "axis 0 bus=0 protocol=rmd node=1 stop_action=hold",
            "axis 1 bus=2 protocol=rmd node=1 stop_action=hold",
            "axis 2 bus=0 protocol=thruster node=11 stop_action=coast",
            "axis 3 bus=1 protocol=d5 node=11 stop_action=hold",
            "timeout 0 500",
            "timeout 1 500",
            "timeout 2 500",
        ] {
            self.request(&line.split_whitespace().collect::<Vec<_>>())?;
        }
        Ok(())
    }

    /// `refused ERROR STEP…`: the step must be answered with that error of the host protocol.
    fn refused(&mut self, words: &[&str]) -> Result<(), String> {
        let (wanted, step) = words.split_first().ok_or("refused needs the error's name")?;
        match self.request(step) {
            Err(StepError::Client(ClientError::Gateway(error))) if error.name() == *wanted => Ok(()),
            Err(error) => Err(format!("expected {wanted}, got {error}")),
            Ok(()) => Err(format!("expected {wanted}, but it was done")),
        }
    }

    fn disturb(&mut self, words: &[&str], fault: BusFault) -> Result<(), String> {
        self.world.borrow_mut().set_bus_fault(parse(words, 0, "bus")?, fault);
        Ok(())
    }

    /// `inject MOTOR KIND VALUE`
    fn inject(&mut self, words: &[&str]) -> Result<(), String> {
        let motor: usize = parse(words, 0, "motor")?;
        let on = words.get(2) == Some(&"on");
        let injection = match words.get(1) {
            Some(&"mute") => Injection::Mute(on),
            Some(&"unplugged") => Injection::Unplugged(on),
            Some(&"garbage") => Injection::Garbage(on),
            Some(&"wrong-checksum") => Injection::WrongChecksum(on),
            Some(&"stuck-rotor") => Injection::StuckRotor(on),
            Some(&"ignore-stop") => Injection::IgnoreStop(on),
            Some(&"resume-after-timeout") => Injection::ResumeAfterTimeout(on),
            Some(&"faults") => Injection::FaultBits(parse(words, 2, "fault word")?),
            Some(&"late") => Injection::LateReply(duration(words, 2)?),
            other => return Err(format!("{other:?} is no injection")),
        };
        self.world.borrow_mut().inject(motor, injection);
        Ok(())
    }
}

/// A raw frame as candump or hex text.
fn raw_frame(text: &str) -> Result<RawFrame, String> {
    let bytes = |hex: &str| {
        (0..hex.len())
            .step_by(2)
            .map(|at| u8::from_str_radix(hex.get(at..at + 2).unwrap_or("?"), 16))
            .collect::<Result<Vec<u8>, _>>()
            .map_err(|e| e.to_string())
    };
    match text.split_once('#') {
        Some((id, data)) => {
            let id = u16::from_str_radix(id, 16).map_err(|e| e.to_string())?;
            let frame = host_protocol::CanFrame::standard(id, &bytes(data)?).ok_or("no such CAN frame")?;
            Ok(RawFrame::Can(frame))
        }
        None => {
            let bytes = host_protocol::Bytes::from_slice(&bytes(text)?).map_err(|_| "too many bytes")?;
            Ok(RawFrame::Serial(bytes))
        }
    }
}

/// Why a step was not done.
enum StepError {
    /// The scenario is wrong.
    Script(String),
    /// The gateway or the way to it.
    Client(ClientError),
}

impl From<String> for StepError {
    fn from(error: String) -> Self {
        Self::Script(error)
    }
}

impl From<ClientError> for StepError {
    fn from(error: ClientError) -> Self {
        Self::Client(error)
    }
}

impl std::fmt::Display for StepError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Script(error) => error.fmt(f),
            Self::Client(ClientError::Gateway(error)) => write!(f, "{}: {error}", error.name()),
            Self::Client(error) => error.fmt(f),
        }
    }
}
