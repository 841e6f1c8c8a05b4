//! The settings of one motor, configured or not.
//!
//! A motor without an axis is lent one for as long as the command lasts, so that what is sent to it
//! stands under the same rules as a native command of an axis; then the configuration is what it
//! was.

mod actions;
mod change;
mod file;
mod identity;
mod place;
mod settings;
mod unfinished;

use std::time::Duration;

use ::rmd::Dialect;
use codec::EncodeError;
use host_protocol::{AxisParameter, BusKind, Bytes, Change, Error, Protocol, Subject, Value};
use mgw_client::ClientError;
use serde_json::{Map, json};

use crate::config::{self, Configuration};
use crate::explain::Page;
use crate::failure::Failure;
use crate::native_request;
use crate::scan::Found;
use crate::session::Session;
use crate::terminal;

pub use actions::{
    brake, clear_faults, function, reports, reset, returns, stream, timeout, zero, zero_here,
};
pub use change::{change_by_text, change_to};
pub use file::{diff, dump, restore};
pub use identity::{bitrate, id};
pub use place::{Asked, on_motor};
pub use settings::Group;
pub use unfinished::{Unfinished, unfinished_text};

use settings::Values;

/// After 0x76 an RMD was seen silent for 1.1 s.
const RESTARTS_WITHIN: Duration = Duration::from_secs(4);
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A motor, and the axis that it has for now.
#[derive(Debug, Clone)]
pub struct Motor {
    pub axis: u8,
    /// The axis is configured for it, and not only lent.
    pub is_own: bool,
    pub bus: u8,
    pub kind: BusKind,
    pub bitrate: u32,
    pub protocol: Protocol,
    pub node: u8,
    /// RMD: what it may speak; one where that is known.
    pub dialects: Vec<Dialect>,
    /// What it said of itself.
    pub found: Option<Found>,
    /// The other motors of the bus.
    pub others: Vec<Found>,
}

/// A motor at hand.
pub struct Run<'a> {
    pub session: &'a mut Session,
    pub motor: Motor,
    /// Nothing is asked.
    yes: bool,
    /// Something is written from here on.
    writes: bool,
    /// The configuration as it is now.
    now: Configuration,
    /// What it shall be in the end.
    after: Configuration,
    unfinished: Unfinished,
}

impl Motor {
    /// `bus 0, rmd 1`
    pub fn name(&self) -> String {
        format!("bus {}, {}", self.bus, self.at(self.node))
    }

    /// `rmd 1`, `thruster 0x0B`
    pub fn at(&self, node: u8) -> String {
        crate::commands::motor_name(self.protocol, node)
    }

    /// What is typed for the motor at a node.
    pub fn target(&self, node: u8) -> String {
        format!("{}:{}:{node}", self.bus, self.protocol)
    }

    /// The names of what it may speak.
    pub fn dialect_names(&self) -> String {
        let names: Vec<&str> = self.dialects.iter().map(|dialect| dialect.name()).collect();
        names.join(" or ")
    }

    /// The dialect by whose bytes it is asked.
    pub fn dialect(&self) -> Dialect {
        self.dialects.first().copied().unwrap_or(Dialect::Unknown)
    }

    /// Data bytes that are this request in whatever it may speak.
    fn rmd(&self, request: &::rmd::Request) -> Result<Vec<u8>, Failure> {
        let encode = |dialect: &Dialect| request.encode_in(*dialect);
        let all: Result<Vec<_>, EncodeError> = self.dialects.iter().map(encode).collect();
        let all = all.map_err(|error| refused(&error, self))?;
        let data = all.first().ok_or_else(|| {
            failed("NotFound", format!("{}: nothing is known of its dialect", self.name()))
        })?;
        Ok(data.to_vec())
    }

    fn d5(&self, request: &d5::Request) -> Result<Vec<u8>, Failure> {
        let node = d5::Node::new(self.node).map_err(|error| refused(&error, self))?;
        let frame = d5::request_frame(d5::Address::Node(node), request);
        Ok(frame.map_err(|error| refused(&error, self))?.to_vec())
    }

    fn thruster(&self, request: &thruster::Request) -> Result<Vec<u8>, Failure> {
        let payload = request.encode().map_err(|error| refused(&error, self))?;
        Ok(payload.as_slice().to_vec())
    }
}

/// A failure that has a name for programs.
fn failed(name: &'static str, text: impl Into<String>) -> Failure {
    let page = match name {
        "NotFound" | "OtherBitrate" => Page::ScanFindsNothing,
        "TwoMotors" => Page::DoubledId,
        "Turns" => Page::MotorTurns,
        "DialectContradicted" => Page::Dialect,
        _ => Page::MotorSetting,
    };
    Failure::named(name, page, text)
}

/// A codec refuses what was asked for.
fn refused(error: &EncodeError, motor: &Motor) -> Failure {
    let speaks = match motor.protocol {
        Protocol::Rmd => format!(", which speaks {}", motor.dialect_names()),
        Protocol::Thruster | Protocol::D5 => String::new(),
    };
    Failure::Usage(format!("{}{speaks}: {error}", motor.name()))
}

/// A codec refuses a value; the motor is named elsewhere.
fn motor_error(error: EncodeError) -> Failure {
    Failure::Usage(error.to_string())
}

fn is_silence(error: &Error) -> bool {
    matches!(error, Error::NoReply { .. })
}

/// A motor of this protocol has no such setting.
fn lacks(motor: &Motor, what: &str, instead: &str) -> Failure {
    let text = format!("{}: {what}. {instead}", motor.name());
    Failure::Usage(text.trim_end_matches([' ', '.']).to_owned())
}

impl Run<'_> {
    /// The motor does not show that it has obeyed.
    fn unconfirmed(&self, why: &str) -> Failure {
        failed("NotConfirmed", format!("{}: {why}", self.motor.name()))
    }

    /// Has the motor carry out a command of its manual, and returns its reply.
    fn ask(&mut self, data: &[u8]) -> Result<Bytes<8>, Failure> {
        let Motor { axis, protocol, node, kind, .. } = self.motor;
        let bytes = Bytes::from_slice(data).unwrap_or_default();
        let reply = self.session.client.native_when_free(axis, 0, bytes, Duration::ZERO);
        reply.map_err(|error| match error {
            ClientError::Gateway(error) => {
                let motor = native_request::Motor { axis, protocol, node, bus: kind };
                let failure = native_request::explain(motor, data, error);
                if self.motor.is_own {
                    return failure;
                }
                // Nobody knows the axis that it was lent.
                let text = failure.to_string().replace(&format!("axis {axis}"), &self.motor.name());
                Failure::Explained { error, text }
            }
            error => error.into(),
        })
    }

    fn ask_rmd(&mut self, request: &::rmd::Request) -> Result<::rmd::Reply, Failure> {
        let data = self.motor.rmd(request)?;
        let reply = self.ask(&data)?;
        ::rmd::Reply::decode_in(self.motor.dialect(), &reply).map_err(|_| self.unread(&data))
    }

    fn ask_thruster(&mut self, request: &thruster::Request) -> Result<thruster::Reply, Failure> {
        let data = self.motor.thruster(request)?;
        let reply = self.ask(&data)?;
        thruster::Reply::decode(&reply).map_err(|_| self.unread(&data))
    }

    fn ask_d5(&mut self, request: &d5::Request) -> Result<d5::Reply, Failure> {
        let data = self.motor.d5(request)?;
        let reply = self.ask(&data)?;
        let frame = reply.as_slice().try_into().ok();
        let reply = frame.map(d5::decode_reply_frame).and_then(Result::ok);
        reply.map(|(_, reply)| reply).ok_or_else(|| self.unread(&data))
    }

    fn unread(&self, data: &[u8]) -> Failure {
        self.unconfirmed(&format!("no answer to {}", crate::words::hex(data)))
    }

    /// Asks the user whether to do it, unless that is said already.
    fn agree(&mut self, what: &str) -> Result<(), Failure> {
        let off = match self.motor.protocol {
            Protocol::Rmd if !self.motor.is_own => "its output is switched off; it ",
            _ => "",
        };
        let what = format!("{}: {off}{what}", self.motor.name());
        terminal::agree(self.session, self.yes, &what)?;
        self.writes = true;
        Ok(())
    }

    /// Changes the configuration as a whole.
    fn configure(&mut self, wanted: Configuration) -> Result<(), Failure> {
        let changes = self.now.changes_to(&wanted);
        if changes.is_empty() {
            return Ok(());
        }
        self.expect(&wanted);
        config::make(&mut self.session.client, &changes)?;
        self.now = wanted;
        self.unfinished.reached(&self.now);
        Ok(())
    }

    /// Leaves word of what the configuration shall be in the end, if this command does not see it.
    fn expect(&mut self, meanwhile: &Configuration) {
        if let Err(error) = self.unfinished.expect(meanwhile, &self.after) {
            self.session.out.aside(format!(
                "what the configuration was is not kept for a command that is killed: {error}"
            ));
        }
    }

    /// Whether the gateway has another configuration than it was given here, as after a loss of its
    /// power: then there is nothing to take back.
    fn is_reconfigured(&mut self) -> bool {
        let is = |of: &Configuration| (of.buses.clone(), of.axes.clone());
        config::read(&mut self.session.client).is_ok_and(|found| is(&found) != is(&self.now))
    }

    /// Makes the configuration what it shall be in the end.
    fn leave(&mut self) -> Result<(), Failure> {
        let after = self.after.clone();
        self.configure(after)
    }

    /// The configuration that was to be made again, where that did not succeed.
    fn not_left(&self, cause: &Failure) -> Option<String> {
        let changes: Vec<Change> = self.now.changes_to(&self.after);
        (!changes.is_empty()).then(|| {
            let lines: Vec<String> = changes.iter().map(|change| self.now.shown(change)).collect();
            let first = match cause.gateway_error() {
                Some(Error::RestartOwed { axis }) => format!("First `mgw motor {axis} reset`. "),
                _ => String::new(),
            };
            format!(
                "the configuration for this command could not be taken back ({cause}); what is \
                    missing:\n{}\n{first}The file for `mgw config apply` that does it:\n{}",
                lines.join("\n"),
                config::dump(&self.after)
            )
        })
    }

    /// A parameter of the axis's row, from now on and in the end; nothing for a motor without one.
    fn follow(&mut self, parameter: AxisParameter, value: Value) -> Option<String> {
        let Motor { axis, is_own, .. } = self.motor;
        let values = self.after.axes.get_mut(&axis).filter(|_| is_own)?;
        values.insert(parameter, value);
        self.expect(&self.now.clone());
        let name = self.after.names.get(&Subject::Axis(axis));
        let name = name.filter(|_| parameter == AxisParameter::Node);
        let still = name.map(|name| format!(", and its name is `{name}` still"));
        Some(format!(
            "axis {axis}: {} = {value} in its row{}; `mgw config save` keeps that where the \
                configuration is stored",
            parameter.text().name,
            still.unwrap_or_default()
        ))
    }

    /// Restarts an RMD, and says whether it is back.
    fn restart(&mut self) -> Result<bool, Failure> {
        let before = self.run_time()?;
        let told_at = self.session.client.now();
        let data = self.motor.rmd(&::rmd::Request::Reset)?;
        self.ask(&data)?;
        loop {
            self.session.client.pause(LOOK_EVERY)?;
            let since = self.session.client.now().saturating_sub(told_at);
            match self.run_time() {
                Ok(time) if time < before + since / 2 => return Ok(true),
                Ok(_) => {}
                Err(failure) if failure.gateway_error().is_some_and(is_silence) => {}
                Err(failure) => return Err(failure),
            }
            if since > RESTARTS_WITHIN {
                return Ok(false);
            }
        }
    }

    fn run_time(&mut self) -> Result<Duration, Failure> {
        match self.ask_rmd(&::rmd::Request::ReadRunTime)? {
            ::rmd::Reply::RunTime { time } => Ok(Duration::from_millis(time.0.into())),
            _ => Ok(Duration::ZERO),
        }
    }

    /// Prints what the motor said before and after, and what is to be said of it. What is left to do
    /// is done where nobody reads this, and what the motor did not do is a failure.
    fn report(
        &self,
        what: &str,
        before: &Values,
        after: Option<&Values>,
        notes: &[String],
    ) -> Result<(), Failure> {
        match self.print(what, before, after, notes) {
            Err(failure) if failure.is_silent() => Ok(()),
            printed => printed,
        }
    }

    fn print(
        &self,
        what: &str,
        before: &Values,
        after: Option<&Values>,
        notes: &[String],
    ) -> Result<(), Failure> {
        let (out, motor) = (self.session.out, &self.motor);
        for (key, value) in after.unwrap_or(before) {
            let line = match before.get(key) {
                Some(old) if after.is_some() && old != value => {
                    format!("{}: {key} {old} -> {value}", motor.name())
                }
                _ => format!("{}: {key} = {value}", motor.name()),
            };
            out.text(line)?;
        }
        for note in notes {
            out.text(format!("{}: {note}", motor.name()))?;
        }
        let values = |values: &Values| -> Map<String, serde_json::Value> {
            values.iter().map(|(key, value)| (key.clone(), value.to_json())).collect()
        };
        out.object(&json!({
            "motor": {
                "bus": motor.bus, "protocol": motor.protocol.name(), "node": motor.node,
                "axis": motor.is_own.then_some(motor.axis), "bitrate_bit_s": motor.bitrate,
            },
            "setting": what, "before": values(before), "after": after.map(values), "notes": notes,
        }))
    }
}
