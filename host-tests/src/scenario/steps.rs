//! What a scenario does.

use super::bench::{Bench, SETPOINT_TTL};
use super::words::{duration, fields, hex, parameter, parse, protocols, setpoint};
use host_protocol::{Bytes, ClearTarget, MAX_CAN_DATA, RawFrame, StopTarget, replies::Armed, requests};
use mgw_client::ClientError;
use mgw_sim::{BusFault, Injection};
use std::time::Duration;

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
                self.run(Duration::ZERO)
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
            "unanswered" => self.unanswered(duration(rest, 0)?, rest.get(2..).unwrap_or_default()),
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
                let (epoch, expires_at_us) = (self.epoch(axis), self.expired());
                let setpoint = setpoint(rest, 1)?;
                self.client.request(&requests::Setpoint { axis, epoch, expires_at_us, setpoint })?;
            }
            "native" => {
                let axis = parse(rest, 0, "axis")?;
                let data = data_field(rest, 1)?;
                self.native_reply = self.client.native(axis, self.epoch(axis), data, SETPOINT_TTL)?;
            }
            "native-epoch" => {
                let (axis, epoch): (u8, u32) = (parse(rest, 0, "axis")?, parse(rest, 1, "epoch")?);
                self.client.native(axis, epoch, data_field(rest, 2)?, SETPOINT_TTL)?;
            }
            "native-expired" => {
                let axis = parse(rest, 0, "axis")?;
                let (epoch, expires_at_us) = (self.epoch(axis), self.expired());
                let data = data_field(rest, 1)?;
                self.client.request(&requests::Native { axis, epoch, expires_at_us, data })?;
            }
            "move" => {
                let request = self.relative_move(rest)?;
                let target = self.client.request(&request)?;
                self.move_target_rad = Some(target.target_rad);
            }
            "subscribe" => {
                let axes: Result<Vec<u8>, _> =
                    rest.first().copied().unwrap_or_default().split(',').map(str::parse).collect();
                let axes = axes.map_err(|e| format!("{e}: axes are numbers with commas"))?;
                let fields = fields(rest.get(1).copied().unwrap_or_default())?;
                self.client.subscribe(&axes, fields, duration(rest, 2)?)?;
            }
            "unsubscribe" => self.client.unsubscribe()?,
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

    /// An expiry 1 ms ago.
    fn expired(&self) -> u32 {
        self.client.expiry(Duration::ZERO).wrapping_sub(1_000)
    }

    /// `AXIS DISTANCE speed V`
    fn relative_move(&self, words: &[&str]) -> Result<requests::MoveRelative, String> {
        let axis = parse(words, 0, "axis")?;
        Ok(requests::MoveRelative {
            axis,
            epoch: self.epoch(axis),
            expires_at_us: self.client.expiry(SETPOINT_TTL),
            distance_rad: parse(words, 1, "distance")?,
            speed_limit_rad_s: parse(words, 3, "speed limit")?,
        })
    }

    /// `unanswered TIME move …`: the host waits for the answer so long, in vain, and goes on.
    fn unanswered(&mut self, wait: Duration, words: &[&str]) -> Result<(), String> {
        let Some((&"move", rest)) = words.split_first() else {
            return Err("only a move can stay unanswered".to_string());
        };
        let request = self.relative_move(rest)?;
        match self.client.request_within(&request, wait) {
            Err(ClientError::NoAnswer { .. }) => Ok(()),
            Err(error) => Err(error.to_string()),
            Ok(target) => Err(format!("it was answered: {target:?}")),
        }
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

/// The data field of a native command, in hexadecimal.
fn data_field(words: &[&str], at: usize) -> Result<Bytes<MAX_CAN_DATA>, String> {
    let bytes = hex(words.get(at).ok_or("the data field is missing")?)?;
    Bytes::from_slice(&bytes).map_err(|_| "too many bytes".to_string())
}

/// A raw frame as candump or hex text.
fn raw_frame(text: &str) -> Result<RawFrame, String> {
    match text.split_once('#') {
        Some((id, data)) => {
            let id = u16::from_str_radix(id, 16).map_err(|e| e.to_string())?;
            let frame = host_protocol::CanFrame::standard(id, &hex(data)?).ok_or("no such CAN frame")?;
            Ok(RawFrame::Can(frame))
        }
        None => {
            let bytes = Bytes::from_slice(&hex(text)?).map_err(|_| "too many bytes")?;
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
