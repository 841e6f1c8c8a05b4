//! Steps that are one request of a host.

use super::bench::{Bench, SETPOINT_TTL};
use super::faults::can_frame;
use super::steps::StepError;
use super::words::{duration, fields, hex, parameter, parse, protocols, setpoint};
use host_protocol::{
    AxisParameter, BusConfig, BusMode, Bytes, Change, ClearTarget, GatewayParameter, MAX_CAN_DATA,
    RawFrame, StateField, StateFields, StopTarget, Subject, Text, Value, replies::Armed, requests,
};
use mgw_client::AxisSetpoint;
use std::time::Duration;

impl Bench {
    /// A step that is one request, or several of one kind.
    pub fn request(&mut self, words: &[&str]) -> Result<(), StepError> {
        let (verb, rest) = words.split_first().ok_or("an empty step".to_string())?;
        match *verb {
            "four-axes" => self.four_axes()?,
            "bus" | "axis" | "timeout" | "link-silence" | "remove" => self.configure(verb, rest)?,
            "begin-changes" => self.client.begin_changes()?,
            "add-changes" => {
                let changes = changes(rest)?;
                self.client.add_changes(&changes)?;
            }
            "apply-changes" => self.client.apply_changes()?,
            "together" => self.start_together(rest)?,
            "arm-together" | "cycle" => self.cycle(verb, rest)?,
            "run-cycle" => self.run_cycle(rest)?,
            "set" | "set-for" | "set-epoch" | "set-expired" | "move" => {
                self.set_motion(verb, rest)?
            }
            "native" | "native-epoch" | "native-expired" => self.natively(verb, rest)?,
            "raw-open" | "raw-open-at" | "raw-close" | "raw-send" => self.raw(verb, rest)?,
            "arm" => {
                for at in 0..rest.len() {
                    let axis = parse(rest, at, "axis")?;
                    let Armed { epoch, .. } = self.ask(&requests::Arm { axis })?;
                    self.epochs.retain(|(armed, _)| *armed != axis);
                    self.epochs.push((axis, epoch));
                }
            }
            "disarm" => {
                self.ask(&requests::Disarm { axis: parse(rest, 0, "axis")? })?;
            }
            "stop" => {
                let target = match rest.first() {
                    Some(&"all") => StopTarget::All,
                    _ => StopTarget::Axis(parse(rest, 0, "axis")?),
                };
                self.ask(&requests::Stop { target })?;
            }
            "estop" => {
                self.ask(&requests::EStop {})?;
            }
            "clear-by-restart" => {
                self.ask(&requests::ClearByRestart { axis: parse(rest, 0, "axis")? })?;
            }
            "clear" => {
                let target = match rest.first() {
                    Some(&"gateway") => ClearTarget::Gateway,
                    _ => ClearTarget::Axis(parse(rest, 0, "axis")?),
                };
                self.ask(&requests::Clear { target })?;
            }
            "clear-unreachable" => {
                self.ask(&requests::ClearUnreachable { axis: parse(rest, 0, "axis")? })?;
            }
            "output-off" => {
                self.ask(&requests::OutputOff { axis: parse(rest, 0, "axis")? })?;
            }
            "read" => {
                self.ask(&requests::ReadState { axis: parse(rest, 0, "axis")? })?;
            }
            "ping" => {
                self.ask(&requests::Ping {})?;
            }
            "take" => {
                self.ask(&requests::TakeAuthority {})?;
            }
            "release" => {
                self.ask(&requests::ReleaseAuthority {})?;
            }
            "reconnect" => self.client.reconnect()?,
            "begin-image" | "write-image" | "finish-image" | "confirm-image" => {
                self.image(verb, rest)?;
            }
            "subscribe" => {
                let axes = axes(rest)?;
                let fields = fields(rest.get(1).copied().unwrap_or_default())?;
                self.client.subscribe(&axes, fields, duration(rest, 2)?)?;
            }
            "unsubscribe" => self.client.unsubscribe()?,
            other => return Err(StepError::Script(format!("{other} is no step"))),
        }
        Ok(())
    }

    fn configure(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        match verb {
            "bus" => {
                let exclusive = words.last() == Some(&"exclusive");
                let numbers = words.len() - usize::from(exclusive);
                let request = requests::ConfigureBus {
                    bus: parse(words, 0, "bus")?,
                    bitrate: parse(words, 1, "bitrate")?,
                    protocols: protocols(words.get(2).copied().unwrap_or_default())?,
                    exclusive,
                    reply_window_us: if numbers > 3 {
                        parse(words, 3, "reply window")?
                    } else {
                        5_000
                    },
                };
                self.ask(&request)?;
            }
            "axis" => {
                let axis = parse(words, 0, "axis")?;
                for text in words.iter().skip(1) {
                    let (parameter, value) = parameter(text)?;
                    self.ask(&requests::ConfigureAxis {
                        axis,
                        parameter: parameter.number(),
                        value,
                    })?;
                }
            }
            "remove" => {
                self.ask(&requests::RemoveAxis { axis: parse(words, 0, "axis")? })?;
            }
            "timeout" => {
                let (axis, timeout_ms) = (parse(words, 0, "axis")?, parse(words, 1, "timeout")?);
                self.ask(&requests::ProvisionMotorTimeout { axis, timeout_ms })?;
            }
            _ => {
                let us = u32::try_from(duration(words, 0)?.as_micros()).unwrap_or(u32::MAX);
                let parameter = GatewayParameter::LinkSilenceUs.number();
                self.ask(&requests::ConfigureGateway { parameter, value: Value::Unsigned(us) })?;
            }
        }
        Ok(())
    }

    fn set_motion(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        let axis: u8 = parse(words, 0, "axis")?;
        match verb {
            "set" => self.set(axis, setpoint(words, 1)?)?,
            "set-for" => {
                let (ttl, setpoint) = (duration(words, 1)?, setpoint(words, 3)?);
                self.ask(&self.setpoint_until(axis, setpoint, ttl))?;
            }
            "set-epoch" => {
                let (epoch, setpoint) = (parse(words, 1, "epoch")?, setpoint(words, 2)?);
                let expires_at_us = self.gateway_time(SETPOINT_TTL);
                self.ask(&requests::Setpoint { axis, epoch, expires_at_us, setpoint })?;
            }
            "set-expired" => {
                let (epoch, expires_at_us) = (self.epoch(axis), self.expired());
                let setpoint = setpoint(words, 1)?;
                self.ask(&requests::Setpoint { axis, epoch, expires_at_us, setpoint })?;
            }
            _ => {
                let request = requests::MoveRelative {
                    axis,
                    epoch: self.epoch(axis),
                    expires_at_us: self.gateway_time(SETPOINT_TTL),
                    distance_rad: parse(words, 1, "distance")?,
                    speed_limit_rad_s: parse(words, 3, "speed limit")?,
                };
                let target = self.ask(&request)?;
                self.move_target_rad = Some(target.target_rad);
            }
        }
        Ok(())
    }

    /// `together AXIS SPEED AXIS SPEED …`: rad/s.
    fn start_together(&mut self, words: &[&str]) -> Result<(), StepError> {
        let mut members = host_protocol::Vec::new();
        for at in (0..words.len()).step_by(2) {
            let axis = parse(words, at, "axis")?;
            let velocity_rad_s = parse(words, at + 1, "speed")?;
            let member = requests::Member { axis, epoch: self.epoch(axis), velocity_rad_s };
            members.push(member).map_err(|_| "too many axes".to_string())?;
        }
        let expires_at_us = self.gateway_time(SETPOINT_TTL);
        self.ask(&requests::StartTogether { expires_at_us, members })?;
        Ok(())
    }

    /// `arm-together AXIS …`, and `cycle AXIS SETPOINT | AXIS SETPOINT …` with the epoch of the
    /// first.
    fn cycle(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        if verb == "arm-together" {
            let axes: Result<Vec<u8>, _> =
                (0..words.len()).map(|at| parse(words, at, "axis")).collect();
            let axes = axes?;
            let epoch = self.client.arm_together(&axes)?;
            self.epochs.retain(|(armed, _)| !axes.contains(armed));
            self.epochs.extend(axes.into_iter().map(|axis| (axis, epoch)));
            return Ok(());
        }
        let mut setpoints = Vec::new();
        for part in words.split(|word| *word == "|") {
            let (axis, setpoint) = (parse(part, 0, "axis")?, setpoint(part, 1)?);
            setpoints.push(AxisSetpoint { axis, setpoint });
        }
        let epoch = setpoints.first().map_or(0, |first| self.epoch(first.axis));
        let fields = StateFields::of(StateField::ALL);
        self.cycled = self.client.cycle(epoch, &setpoints, fields, SETPOINT_TTL)?;
        Ok(())
    }

    /// `run-cycle AXIS,… TIME`, `run-cycle none`
    fn run_cycle(&mut self, words: &[&str]) -> Result<(), StepError> {
        let (axes, period) = match words {
            ["none"] => (Vec::new(), Duration::ZERO),
            _ => (axes(words)?, duration(words, 1)?),
        };
        self.client.run_cycle(&axes, StateFields::of(StateField::ALL), period)?;
        Ok(())
    }

    fn natively(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        let axis: u8 = parse(words, 0, "axis")?;
        let (epoch, data_at) = match verb {
            "native-epoch" => (parse(words, 1, "epoch")?, 2),
            _ => (self.epoch(axis), 1),
        };
        let expires_at_us = match verb {
            "native-expired" => self.expired(),
            _ => self.gateway_time(SETPOINT_TTL),
        };
        let data = data_field(words, data_at)?;
        self.native_reply = self.ask(&requests::Native { axis, epoch, expires_at_us, data })?.data;
        Ok(())
    }

    fn raw(&mut self, verb: &str, words: &[&str]) -> Result<(), StepError> {
        let bus = parse(words, 0, "bus")?;
        match verb {
            "raw-open" => {
                let unsafe_access = words.get(1) == Some(&"unsafe");
                self.ask(&requests::RawOpen { bus, unsafe_access })?;
            }
            // `raw-open-at BUS BITRATE PROTOCOLS normal|listen-only|one-shot`
            "raw-open-at" => {
                let mode = match words.get(3) {
                    Some(&"listen-only") => BusMode::ListenOnly,
                    Some(&"one-shot") => BusMode::OneShot,
                    Some(&"normal") => BusMode::Normal,
                    other => return Err(format!("{other:?} is no mode").into()),
                };
                let (bitrate, protocols) = (
                    parse(words, 1, "bitrate")?,
                    protocols(words.get(2).copied().unwrap_or_default())?,
                );
                let reply_window_us = 5_000;
                let open = requests::RawOpenAt { bus, bitrate, protocols, reply_window_us, mode };
                self.ask(&open)?;
            }
            "raw-close" => {
                self.ask(&requests::RawClose { bus })?;
            }
            _ => {
                let frame = raw_frame(words.get(1).copied().unwrap_or_default())?;
                self.ask(&requests::RawSend { bus, frame })?;
            }
        }
        Ok(())
    }

    /// An expiry 1 ms ago.
    fn expired(&self) -> u32 {
        self.gateway_time(Duration::ZERO).wrapping_sub(1_000)
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
}

/// `axis N name=value|name=unset …`, `bus N BITRATE PROTOCOLS`, `bus N off`, `link-silence TIME` or
/// `name gateway|bus N|axis N NAME|none`.
fn changes(words: &[&str]) -> Result<Vec<Change>, String> {
    let bus = |config| Ok(vec![Change::Bus { bus: parse(words, 1, "bus")?, config }]);
    match words {
        ["axis", axis, texts @ ..] => {
            let axis = axis.parse().map_err(|_| format!("{axis} is no axis"))?;
            let change = |text: &&str| {
                let (parameter, value) = match text.strip_suffix("=unset") {
                    Some(name) => {
                        let unknown = || format!("{name} is no parameter");
                        (AxisParameter::from_name(name).ok_or_else(unknown)?, None)
                    }
                    None => parameter(text).map(|(parameter, value)| (parameter, Some(value)))?,
                };
                Ok(Change::Axis { axis, parameter: parameter.number(), value })
            };
            texts.iter().map(change).collect()
        }
        ["bus", _, "off"] => bus(None),
        ["bus", _, _, names] => bus(Some(BusConfig {
            bitrate: parse(words, 2, "bitrate")?,
            protocols: protocols(names)?,
            exclusive: false,
            reply_window_us: 5_000,
        })),
        ["link-silence", _, _] => {
            let us = u32::try_from(duration(words, 1)?.as_micros()).unwrap_or(u32::MAX);
            let parameter = GatewayParameter::LinkSilenceUs.number();
            Ok(vec![Change::Gateway { parameter, value: Value::Unsigned(us) }])
        }
        ["name", of @ .., name] => {
            let name = match *name {
                "none" => None,
                name => Some(Text::try_from(name).map_err(|_| format!("{name} is too long"))?),
            };
            Ok(vec![Change::Name { of: subject(of)?, name }])
        }
        _ => Err("change what?".to_string()),
    }
}

/// `gateway`, `bus N` or `axis N`.
pub fn subject(words: &[&str]) -> Result<Subject, String> {
    match words {
        ["gateway"] => Ok(Subject::Gateway),
        ["bus", _] => Ok(Subject::Bus(parse(words, 1, "bus")?)),
        ["axis", _] => Ok(Subject::Axis(parse(words, 1, "axis")?)),
        _ => Err(format!("{words:?} has no name")),
    }
}

/// The data field of a native command, in hexadecimal.
fn data_field(words: &[&str], at: usize) -> Result<Bytes<MAX_CAN_DATA>, String> {
    let bytes = hex(words.get(at).ok_or("the data field is missing")?)?;
    Bytes::from_slice(&bytes).map_err(|_| "too many bytes".to_string())
}

/// Axes with commas between them.
fn axes(words: &[&str]) -> Result<Vec<u8>, String> {
    let numbers = words.first().copied().unwrap_or_default().split(',');
    let axes: Result<Vec<u8>, _> = numbers.map(str::parse).collect();
    axes.map_err(|e| format!("{e}: axes are numbers with commas"))
}

/// A raw frame as candump or hex text.
fn raw_frame(text: &str) -> Result<RawFrame, String> {
    if let Some(frame) = can_frame(text)? {
        return Ok(RawFrame::Can(frame));
    }
    let bytes = Bytes::from_slice(&hex(text)?).map_err(|_| "too many bytes")?;
    Ok(RawFrame::Serial(bytes))
}
