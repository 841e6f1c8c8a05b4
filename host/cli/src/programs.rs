//! What other programs use of `mgw`: configuration files, native commands by name, frames in words,
//! and the words of `--json`. Nothing here prints.

use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisSummary, Bytes, Error, MAX_CAN_DATA, Quantity, SlowState, parameters};
use mgw_client::{Client, ClientError, Transport, server_port};
use serde_json::{Value, json};

use crate::args::{
    BusKind, CodecChoice, DecodeArgs, DirectionChoice, EncodeArgs, ProtocolChoice, choice,
    dialect_of,
};
use crate::commands;
use crate::config::{self, BoardPorts, Configuration, Source};
use crate::decode;
use crate::encode;
use crate::failure::{self, Failure};
use crate::find;
use crate::json;
use crate::native_request;
use crate::output::to_json;

pub use crate::config::schema as configuration_schema;
pub use crate::faults::Protocols as Motors;
pub use crate::frames::{asks, may_answer};
pub use crate::json::cycle::result;
pub use crate::json::event;
pub use crate::json::gateway::{bus, incident, info};

/// Why something has no result.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// A name that programs can rely on: the gateway's own for its errors.
    pub name: &'static str,
    /// What was wrong, what is allowed, the next step.
    pub message: String,
    /// The number of the gateway's error, if it is one.
    pub number: Option<u16>,
    /// Its data, by names.
    pub fields: Value,
}

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        let (name, message) = (failure.name(), failure.to_string());
        let error = failure.gateway_error();
        let number = error.map(Error::number);
        let fields = match error {
            Some(error) => fields(error),
            None => {
                let mut fields = failure.to_json()["error"].take();
                if let Some(fields) = fields.as_object_mut() {
                    fields.remove("name");
                    fields.remove("message");
                    fields.remove("explain");
                }
                fields
            }
        };
        Self { name, message, number, fields }
    }
}

impl From<ClientError> for Problem {
    fn from(error: ClientError) -> Self {
        match error {
            // Its own text knows nothing of `mgw`.
            ClientError::Gateway(error) => Failure::would_be_refused(error).into(),
            error => Failure::from(error).into(),
        }
    }
}

/// An error as `mgw --json` prints it: an object with an `error`.
pub fn error(error: ClientError) -> Value {
    match error {
        // As above.
        ClientError::Gateway(error) => Failure::would_be_refused(error).to_json(),
        error => Failure::from(error).to_json(),
    }
}

/// The data of an error of the gateway, names and values in snake_case.
pub fn fields(error: &Error) -> Value {
    let mut fields = Value::Object(json::variant(error).1);
    let more = match error {
        Error::Unsupported { protocol, .. }
        | Error::ProtocolNotOnBus { protocol, .. }
        | Error::NotACommand { protocol, .. } => json!({ "protocol": protocol.name() }),
        Error::NotANumber { quantity } | Error::CannotCheckLimit { quantity, .. } => {
            json!({ "quantity": quantity.to_string().replace(' ', "_") })
        }
        error => failure::data(error),
    };
    json::extend(&mut fields, more);
    let parameter = match error {
        Error::OutOfRange { quantity: Quantity::Parameter(number), .. } => Some(*number),
        _ => fields["parameter"].as_u64().and_then(|number| u16::try_from(number).ok()),
    };
    if let Some(name) = parameter.and_then(parameters::name) {
        fields["parameter_name"] = json!(name);
    }
    fields
}

/// Opens the port that was named, a running server, or the only port that may lead to a gateway.
///
/// # Errors
/// There is none or more than one, or it cannot be opened, and what to do about it.
pub fn open(named: Option<&str>) -> Result<Box<dyn Transport + Send>, Problem> {
    if named.is_none()
        && let Some(server) = server_port()
        && let Ok(transport) = mgw_client::open(&server)
    {
        return Ok(transport);
    }
    let port = find::cable_port(named)?;
    Ok(mgw_client::open(&port).map_err(find::explain)?)
}

/// One axis of a list.
pub fn axis(summary: &AxisSummary) -> Value {
    json::axis::summary(summary, summary.missing.and_then(parameters::name))
}

/// How an axis is.
pub fn state(report: &AxisReport, motors: &Motors) -> Value {
    json::axis::report(report, motors.of(report.axis))
}

/// What a free-running cycle tells of one axis in turns.
pub fn slow_state(state: &SlowState) -> Value {
    to_json(state)
}

/// What a configuration changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Configured {
    /// Changes made to the gateway, all together.
    pub changes: usize,
    /// Motors whose own timeout was written.
    pub motor_timeouts_written: usize,
}

/// Makes the text of a configuration file the configuration of a gateway; with `merge` only what it
/// names changes. `path` is what the text is called in a [`Problem`]; where it has none, its lines
/// say nothing either.
///
/// # Errors
/// Everything that is wrong with it, before the gateway hears of it; or the gateway's refusal,
/// after which nothing has changed but motor timeouts.
pub fn configure<T: Transport>(
    client: &mut Client<T>,
    path: Option<&str>,
    text: &str,
    merge: bool,
) -> Result<Configured, Problem> {
    // So that nobody else changes what is read now.
    client.take_authority()?;
    let running = config::read(client)?;
    let name = path.unwrap_or("the configuration").to_owned();
    let source = Source { path: name, text: text.to_owned() };
    let base = if merge { running.clone() } else { Configuration::default() };
    let wanted = source.onto(base, &BoardPorts::of(client.hello())).map_err(|mut failure| {
        if let Failure::Configuration { findings, .. } = &mut failure
            && path.is_none()
        {
            findings.iter_mut().for_each(|finding| finding.line = None);
        }
        failure
    })?;
    let changes = running.changes_to(&wanted);
    config::make(client, &changes)?;
    let motor_timeouts_written = config::write_timeouts(client, &wanted)?;
    Ok(Configured { changes: changes.len(), motor_timeouts_written })
}

/// The configuration of a gateway, as the text of a file.
///
/// # Errors
/// As [`Client::request`].
pub fn configuration<T: Transport>(client: &mut Client<T>) -> Result<String, Problem> {
    Ok(config::dump(&config::read(client)?))
}

/// A command of a motor's manual by its name, and what is known of it before it is sent.
#[derive(Debug, Clone)]
pub struct Native {
    motor: native_request::Motor,
    data: Bytes<MAX_CAN_DATA>,
}

impl Native {
    /// The command for the motor of an axis; each field by its name and its value as text.
    ///
    /// # Errors
    /// There is no such axis, its motor has no such command, or a field is missing or out of its
    /// range.
    pub fn new<T: Transport>(
        client: &mut Client<T>,
        axis: u8,
        command: &str,
        fields: Vec<(String, String)>,
    ) -> Result<Self, Problem> {
        let (motor, _) = commands::motor_of(client, axis)?;
        let data = encode::data_field(motor.protocol, motor.node, command, fields)?;
        let data =
            Bytes::from_slice(&data).map_err(|_| ClientError::TooLong { request: "Native" })?;
        Ok(Self { motor, data })
    }

    /// Sends it and decodes the reply; nothing where the motor does not answer this command. What
    /// moves needs the epoch of the arming and is valid for `ttl`; for all else both may be 0, and
    /// it is then sent again while the axis is carrying out another request.
    ///
    /// # Errors
    /// As [`Client::native`].
    pub fn send<T: Transport>(
        &self,
        client: &mut Client<T>,
        epoch: u32,
        ttl: Duration,
    ) -> Result<Value, Problem> {
        let native_request::Motor { axis, protocol, node, .. } = self.motor;
        let data = self.data.clone();
        let reply = if ttl.is_zero() {
            client.native_when_free(axis, epoch, data, ttl)
        } else {
            client.native(axis, epoch, data, ttl)
        };
        let reply = match reply {
            Err(ClientError::Gateway(error)) => {
                return Err(native_request::explain(self.motor, &self.data, error).into());
            }
            reply => reply?,
        };
        if reply.is_empty() {
            return Ok(Value::Null);
        }
        let line = decode::reply(axis, protocol, node, &self.data, &reply, true);
        Ok(serde_json::from_str(&line).unwrap_or(Value::Null))
    }
}

/// One frame from the names of a command and its fields, as `mgw encode` prints it. `words` are
/// its arguments behind the protocol.
///
/// # Errors
/// What is wrong with the words, or a value that the codec refuses.
pub fn encode(protocol: &str, words: Vec<String>) -> Result<String, Problem> {
    let args = EncodeArgs {
        protocol: Some(choice::<CodecChoice>("protocol", protocol)?),
        node: None,
        bus: None,
        can_id: None,
        list: false,
        words,
    };
    Ok(encode::frame(&encode::Wanted::new(&args)?)?.0)
}

/// Captured frames in words, one object for each line that `mgw decode --json` prints. `protocol`
/// is `auto`, `rmd`, `thruster` or `d5`.
///
/// # Errors
/// An option that is none. A line that is no frame is no error: its object has an `error`.
pub fn decode(
    text: &str,
    protocol: &str,
    bus: Option<&str>,
    direction: Option<&str>,
    dialect: &str,
) -> Result<Vec<Value>, Problem> {
    let args = DecodeArgs {
        files: Vec::new(),
        protocol: choice::<ProtocolChoice>("protocol", protocol)?,
        bus: bus.map(|bus| choice::<BusKind>("bus", bus)).transpose()?,
        direction: direction.map(|way| choice::<DirectionChoice>("direction", way)).transpose()?,
        dialect: dialect_of(dialect).map_err(|there_are| {
            Failure::Usage(format!("`{dialect}` is no dialect; {there_are}"))
        })?,
        headerless: false,
    };
    let lines = decode::text(&args, text)?;
    Ok(lines.lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::{AxisState, Protocol};

    #[test]
    fn an_error_of_the_gateway_has_its_number_and_all_its_fields() {
        let error = Error::NotIdle { axis: 3, state: AxisState::Tripped { confirmed: true } };
        let problem = Problem::from(ClientError::Gateway(error));
        assert_eq!((problem.name, problem.number), ("NotIdle", Some(29)));
        let wanted = json!({ "axis": 3, "state": "tripped", "stop_confirmed": true });
        assert_eq!(problem.fields, wanted);
        let error = Error::OutOfRange {
            quantity: Quantity::Parameter(6),
            value: 0.1,
            min: 5_000.0,
            max: 60_000_000.0,
        };
        let of = fields(&error);
        assert_eq!((&of["parameter_name"], &of["value"]), (&json!("ttl_us"), &json!(0.1)));
        let of = fields(&Error::Unsupported { axis: 1, protocol: Protocol::Thruster });
        assert_eq!(of, json!({ "axis": 1, "protocol": "thruster" }));
    }

    #[test]
    fn an_error_reads_as_it_is_printed() {
        let of = error(ClientError::Gateway(Error::UnknownAxis { axis: 40, max_axes: 32 }));
        assert_eq!(of["error"]["name"], json!("unknown_axis"));
        assert_eq!(
            of["error"]["message"],
            json!(Error::UnknownAxis { axis: 40, max_axes: 32 }.to_string())
        );
    }

    #[test]
    fn a_frame_there_and_back() {
        let words = ["--node", "1", "torque_current", "--current_a", "-1.5"];
        let frame = encode("rmd", words.map(str::to_owned).to_vec()).unwrap();
        assert_eq!(frame, "141#A10000006AFF0000");
        let read = decode(&frame, "auto", None, None, "v3_6").unwrap();
        assert_eq!(read.len(), 1);
        assert_eq!(read[0]["current_a"], json!(-1.5));
        assert_eq!(encode("can", Vec::new()).unwrap_err().name, "Usage");
    }
}
