//! `mgw encode`: a frame from the names of a command and its fields.

mod by_name;
mod list;
mod wanted;

use embedded_can::{ExtendedId, Id, StandardId};
use host_protocol::{CanFrame, Protocol, RawFrame};
use serde_json::{Value, json as object};

use crate::args::{BusKind, CodecChoice, EncodeArgs};
use crate::failure::Failure;
use crate::json;
use crate::output::Output;
use crate::words;
use by_name::{D5, RMD, THRUSTER, refused};
use wanted::To;
pub use wanted::Wanted;

/// Prints the frame, or the list of commands.
pub fn run(args: &EncodeArgs, json: bool) -> Result<(), Failure> {
    let wanted = Wanted::new(args)?;
    let out = Output::new(json);
    if wanted.list {
        return list::run(wanted.protocol, out);
    }
    let (frame, object) = frame(&wanted)?;
    out.either(&frame, &object)
}

/// The frame, and the object of `--json`.
pub fn frame(wanted: &Wanted) -> Result<(String, Value), Failure> {
    let frame = match wanted.protocol {
        CodecChoice::Rmd => rmd_frame(wanted),
        CodecChoice::Thruster => thruster_frame(wanted),
        CodecChoice::D5 => d5_frame(wanted),
    }?;
    let node = match wanted.to {
        Some(To::Node(node)) => object!(node),
        Some(To::All) => object!("all"),
        None => Value::Null,
    };
    let object = object!({ "frame": frame, "protocol": name(wanted.protocol), "node": node, "command": wanted.command()? });
    Ok((frame, object))
}

fn name(protocol: CodecChoice) -> &'static str {
    match protocol {
        CodecChoice::Rmd => "rmd",
        CodecChoice::Thruster => "thruster",
        CodecChoice::D5 => "d5",
    }
}

/// Why what waits in a motor is not to be had natively.
pub const PREPARED: &str = "a speed that waits in the motor is lost between two calls of mgw: each \
    arms the axis before and stops it after, which overwrites what waits. Use `write`, or a \
    program of your own that sends both while the axis is armed";

/// RMD commands that go to an id of their own, to which the gateway sends no data fields.
const IDS_OF_THEIR_OWN: [&str; 5] =
    ["motion_mode", "read_can_id", "set_can_id", "read_rs485_id", "set_rs485_id"];

/// Where one of them goes, and what sends it there.
fn elsewhere(command: &str) -> &'static str {
    match command {
        "motion_mode" => "a CAN id of its own. Use `mgw set AXIS impedance`",
        "read_rs485_id" | "set_rs485_id" => {
            "RS485 id CD, which every motor of the line hears. Use `mgw raw`"
        }
        _ => "CAN id 300, which every motor of the bus hears. Use `mgw raw`",
    }
}

/// The data field of a command for the motor of an axis, without CAN id or serial framing.
pub fn data_field(
    protocol: Protocol,
    node: u8,
    command: &str,
    fields: Vec<(String, String)>,
) -> Result<Vec<u8>, Failure> {
    match protocol {
        Protocol::Rmd => {
            let wanted = Wanted::of(CodecChoice::Rmd, node, command, fields, &IDS_OF_THEIR_OWN);
            let name = wanted.command()?;
            if wanted.leaves_out(name) {
                let elsewhere = elsewhere(name);
                return Err(Failure::Usage(format!(
                    "native commands go to the one motor of the axis; `{name}` goes to {elsewhere}"
                )));
            }
            let request = RMD.build(&wanted)?;
            request.encode().map(|data| data.to_vec()).map_err(refused)
        }
        Protocol::Thruster => {
            let wanted = Wanted::of(CodecChoice::Thruster, node, command, fields, &[]);
            let request = THRUSTER.build(&wanted)?;
            request.encode().map(|data| data.as_slice().to_vec()).map_err(refused)
        }
        Protocol::D5 => {
            let wanted = Wanted::of(CodecChoice::D5, node, command, fields, &["execute"]);
            if wanted.leaves_out(wanted.command()?) {
                return Err(Failure::Usage(PREPARED.to_owned()));
            }
            let request = D5.build(&wanted)?;
            let address = d5::Address::Node(d5::Node::new(node).map_err(refused)?);
            d5::request_frame(address, &request).map(|data| data.to_vec()).map_err(refused)
        }
    }
}

/// These go to every motor whatever the node, so none is needed.
fn is_for_all(request: &rmd::Request) -> bool {
    use rmd::Request;
    matches!(
        request,
        Request::ReadCanId
            | Request::SetCanId { .. }
            | Request::ReadRs485Id
            | Request::SetRs485Id { .. }
    )
}

fn rmd_frame(wanted: &Wanted) -> Result<String, Failure> {
    let request = RMD.build(wanted)?;
    let to = if is_for_all(&request) { wanted.to.unwrap_or(To::All) } else { wanted.to()? };
    let node = match to {
        To::Node(node) => Some(rmd::Node::new(node).map_err(refused)?),
        To::All => None,
    };
    let frame = match (wanted.bus.unwrap_or(BusKind::Can), node) {
        (BusKind::Can, Some(node)) => rmd::can::request(node, &request).map(can_text),
        (BusKind::Can, None) => rmd::can::broadcast(&request).map(can_text),
        (BusKind::Rs485, Some(node)) => {
            rmd::rs485::request(node, &request).map(|bytes| words::hex(&bytes))
        }
        (BusKind::Rs485, None) => rmd::rs485::broadcast(&request).map(|bytes| words::hex(&bytes)),
    };
    frame.map_err(|error| match (refused(error), wanted.command()) {
        // The codec knows its number only.
        (Failure::Refused { name, field: field @ "command", value, range, .. }, Ok(command)) => {
            let message =
                format!("command {command} is refused: it does not go on this kind of bus");
            Failure::Refused { name, field, value, range, message }
        }
        (failure, _) => failure,
    })
}

fn thruster_frame(wanted: &Wanted) -> Result<String, Failure> {
    if wanted.bus == Some(BusKind::Rs485) {
        return Err(Failure::Usage(
            "thrusters have no serial line: leave `--bus rs485` away".to_owned(),
        ));
    }
    let request = THRUSTER.build(wanted)?;
    let To::Node(node) = wanted.to()? else {
        return Err(Failure::Usage(
            "thrusters are commanded one by one: give `--node` a number".to_owned(),
        ));
    };
    let node = thruster::Node::new(node).map_err(refused)?;
    thruster::can::request(node, &request).map(can_text).map_err(refused)
}

fn d5_frame(wanted: &Wanted) -> Result<String, Failure> {
    let request = D5.build(wanted)?;
    let address = match wanted.to()? {
        To::Node(node) => d5::Address::Node(d5::Node::new(node).map_err(refused)?),
        To::All => d5::Address::Broadcast,
    };
    let bytes = d5::request_frame(address, &request).map_err(refused)?;
    if wanted.bus == Some(BusKind::Rs485) {
        return Ok(words::hex(&bytes));
    }
    let id = match &wanted.can_id {
        Some(text) => can_id(text)?,
        // As the codec assumes it: the number of the motor, or of a broadcast.
        None => Id::Standard(StandardId::new(u16::from(address.id())).unwrap_or(StandardId::MAX)),
    };
    d5::can::request(id, address, &request).map(can_text).map_err(refused)
}

fn can_text(frame: CanFrame) -> String {
    json::frame(&RawFrame::Can(frame))
}

/// Up to 3 digits for a standard id, more for an extended one.
fn can_id(text: &str) -> Result<Id, Failure> {
    const HEX: u32 = 16;
    const STANDARD_DIGITS: usize = 3;
    let raw = u32::from_str_radix(text, HEX).ok();
    let id = if text.len() <= STANDARD_DIGITS {
        raw.and_then(|raw| u16::try_from(raw).ok()).and_then(StandardId::new).map(Id::Standard)
    } else {
        raw.and_then(ExtendedId::new).map(Id::Extended)
    };
    id.ok_or_else(|| {
        Failure::Usage(format!(
            "`{text}` is no CAN id. Write it in hexadecimal, 3 digits up to 7FF, or 8 digits up to \
                1FFFFFFF"
        ))
    })
}
