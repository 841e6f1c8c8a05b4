//! What travels on the motor buses, decoded.

use std::cell::RefCell;
use std::rc::Rc;

use host_protocol::ProtocolSet;
use mgw_sim::{Station, TraceEntry, World};
use serde_json::{Value, json};

use crate::config::Configuration;
use crate::failure::Failure;
use crate::frames::{self, Meaning};
use crate::json;
use crate::output::Output;
use crate::table::Table;
use crate::words;

/// A frame and its meaning.
pub struct Decoded {
    pub entry: TraceEntry,
    pub meaning: Option<Meaning>,
}

/// All frames since the last time they were taken.
pub struct Trace {
    /// The protocols of each bus, by number.
    protocols: Vec<(u8, ProtocolSet)>,
    frames: Vec<Decoded>,
}

impl Trace {
    /// Frames are read with the protocols that the configuration gives their bus.
    pub fn new(configuration: &Configuration) -> Self {
        Self { protocols: configuration.protocols(), frames: Vec::new() }
    }

    /// Takes the frames that travelled since the last call, forgetting those before.
    pub fn collect(&mut self, world: &Rc<RefCell<World>>) -> &[Decoded] {
        self.frames =
            world.borrow_mut().trace().into_iter().map(|entry| self.decode(entry)).collect();
        &self.frames
    }

    fn decode(&self, entry: TraceEntry) -> Decoded {
        let protocols = self
            .protocols
            .iter()
            .find(|(bus, _)| *bus == entry.bus)
            .map(|(_, protocols)| *protocols);
        let from_gateway = entry.from == Station::Gateway;
        let meaning =
            protocols.and_then(|protocols| frames::read(&entry.wire, from_gateway, protocols));
        Decoded { entry, meaning }
    }
}

/// Prints frames as a table.
pub fn print<'a>(frames: impl Iterator<Item = &'a Decoded>, out: Output) -> Result<(), Failure> {
    let mut table = Table::new(&[">t s", ">bus", "", "frame", "motor", "meaning"]);
    for Decoded { entry, meaning } in frames {
        let (motor, text) = match meaning {
            Some(meaning) => (meaning.motor.clone(), meaning.text.clone()),
            None => (String::new(), "not of this protocol".to_owned()),
        };
        let direction = if entry.from == Station::Gateway { "->" } else { "<-" };
        out.object(&json::line("frame", object(entry, meaning.as_ref())))?;
        table.row([
            words::seconds(entry.time_us).trim_end_matches(" s").to_owned(),
            entry.bus.to_string(),
            direction.to_owned(),
            entry.wire.to_string(),
            motor,
            text,
        ]);
    }
    out.table(&table)
}

fn object(entry: &TraceEntry, meaning: Option<&Meaning>) -> Value {
    json!({
        "time_us": entry.time_us,
        "bus": entry.bus,
        "from_gateway": entry.from == Station::Gateway,
        "frame": entry.wire.to_string(),
        "motor": meaning.map(|meaning| &meaning.motor),
        "meaning": meaning.map(|meaning| &meaning.text),
    })
}
