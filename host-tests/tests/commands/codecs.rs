//! What the three codecs make of a frame.

use host_protocol::Protocol;
use mgw_sim::Wire;

use crate::page;

/// A decoded frame: what the page calls it, and the frame that it is encoded to.
pub struct Meaning {
    names: Vec<String>,
    pub frame: Wire,
    pub encoded: Option<Wire>,
}

impl Meaning {
    pub fn is(&self, command: &str) -> bool {
        self.names.iter().any(|name| name == command)
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn is_encoded_to_itself(&self) -> bool {
        self.encoded.as_ref() == Some(&self.frame)
    }
}

pub fn protocol_named(name: &str) -> Protocol {
    *Protocol::ALL
        .iter()
        .find(|protocol| protocol.to_string() == name)
        .unwrap_or_else(|| panic!("{name}?"))
}

/// Every row that a protocol must have, with its section without the manual's title.
pub fn commands(protocol: Protocol) -> Vec<(String, String)> {
    let listed = |table: &[rmd::CommandInfo], title: &str| -> Vec<(String, String)> {
        let section =
            |section: &str| section.replace(title, "").trim_start_matches([' ', ',']).to_owned();
        table.iter().map(|info| (info.name.to_owned(), section(info.section))).collect()
    };
    match protocol {
        // What newer versions add, docs/rmd-dialects.md has.
        Protocol::Rmd => {
            let mut rows = listed(rmd::COMMANDS, "RMD V3.6");
            rows.retain(|(_, section)| !section.starts_with("RMD V"));
            rows
        }
        Protocol::Thruster => listed(thruster::COMMANDS, "Thruster manual"),
        Protocol::D5 => listed(d5::COMMANDS, "D5 manual").into_iter().chain(registers()).collect(),
    }
}

/// Of each register a row for reading it and, where the manual lets it be written, one for that.
fn registers() -> Vec<(String, String)> {
    let mut rows = Vec::new();
    for info in &d5::REGISTERS {
        let section = format!("register table, 0x{:02X}", info.register.0);
        rows.push((format!("read {}", info.name), section.clone()));
        if info.access == d5::Access::ReadWrite {
            rows.push((format!("write {}", info.name), section));
        }
    }
    rows
}

/// A frame as a request.
pub fn request(protocol: Protocol, frame: &Wire) -> Option<Meaning> {
    let (names, encoded) = match (protocol, frame) {
        (Protocol::Rmd, Wire::Can(can)) => {
            let (target, request) = rmd::can::decode_any_request(can).ok()?;
            let encoded = match target {
                rmd::Target::Node(node) => rmd::can::request(node, &request),
                rmd::Target::All => rmd::can::broadcast(&request),
            };
            (named(request.info()), encoded.ok().map(Wire::Can))
        }
        (Protocol::Rmd, Wire::Serial(bytes)) => {
            let (target, request) =
                rmd::rs485::decode_any_request(bytes.as_slice().try_into().ok()?).ok()?;
            let encoded = match target {
                rmd::Target::Node(node) => rmd::rs485::request(node, &request),
                rmd::Target::All => rmd::rs485::broadcast(&request),
            };
            (named(request.info()), encoded.ok().map(|bytes| Wire::Serial(bytes.to_vec())))
        }
        (Protocol::Thruster, Wire::Can(can)) => {
            let (node, request) = thruster::can::decode_request(can).ok()?;
            (named(request.info()), thruster::can::request(node, &request).ok().map(Wire::Can))
        }
        (Protocol::D5, Wire::Can(can)) => {
            let (address, request) = d5::can::decode_request(can).ok()?;
            let register = match request {
                d5::Request::Read { register, .. } => named_register("read", register),
                d5::Request::Write { register, .. } => named_register("write", register),
                _ => None,
            };
            let names = named(request.info()).into_iter().chain(register).collect();
            (names, d5::can::request(embedded_id(can), address, &request).ok().map(Wire::Can))
        }
        (Protocol::Thruster | Protocol::D5, Wire::Serial(_)) => return None,
    };
    Some(Meaning { names, frame: frame.clone(), encoded })
}

/// A frame as a reply, or as an event.
pub fn reply(protocol: Protocol, frame: &Wire) -> Option<Meaning> {
    let (names, encoded) = match (protocol, frame) {
        (Protocol::Rmd, Wire::Can(can)) => {
            let (node, reply) = rmd::can::decode_reply(can).ok()?;
            (named(reply.info()), rmd::can::reply(node, &reply).ok().map(Wire::Can))
        }
        (Protocol::Rmd, Wire::Serial(bytes)) => {
            let (node, reply) = rmd::rs485::decode_reply(bytes.as_slice().try_into().ok()?).ok()?;
            let encoded = rmd::rs485::reply(node, &reply).ok();
            (named(reply.info()), encoded.map(|bytes| Wire::Serial(bytes.to_vec())))
        }
        (Protocol::Thruster, Wire::Can(can)) => {
            let (node, reply) = thruster::can::decode_reply(can).ok()?;
            (named(reply.info()), thruster::can::reply(node, &reply).ok().map(Wire::Can))
        }
        (Protocol::D5, Wire::Can(can)) => {
            let (node, reply) = d5::can::decode_reply(can).ok()?;
            let register = match reply {
                d5::Reply::Read { register, .. } => named_register("read", register),
                d5::Reply::Written { register, .. } => named_register("write", register),
                _ => None,
            };
            let names = named(reply.info()).into_iter().chain(register).collect();
            (names, d5::can::reply(embedded_id(can), node, &reply).ok().map(Wire::Can))
        }
        (Protocol::Thruster | Protocol::D5, Wire::Serial(_)) => return None,
    };
    Some(Meaning { names, frame: frame.clone(), encoded })
}

/// The replies and events of the golden vectors.
pub fn vectors(protocol: Protocol) -> Vec<Meaning> {
    let path = format!("{}/vectors/{protocol}.txt", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let mut replies = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut columns = line.split(" | ");
        let (Some(_), Some("reply" | "event"), Some(_), Some(hex)) =
            (columns.next(), columns.next(), columns.next(), columns.next())
        else {
            continue;
        };
        replies.extend(reply(protocol, &page::wire(hex)));
    }
    replies
}

fn named(info: Option<&'static rmd::CommandInfo>) -> Vec<String> {
    info.map(|info| info.name.to_owned()).into_iter().collect()
}

fn named_register(verb: &str, register: d5::Register) -> Option<String> {
    register.info().map(|info| format!("{verb} {}", info.name))
}

fn embedded_id(frame: &host_protocol::CanFrame) -> embedded_can::Id {
    embedded_can::Frame::id(frame)
}
