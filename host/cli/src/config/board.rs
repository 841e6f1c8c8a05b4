//! The board that a configuration is checked for.

use host_protocol::BusKind;
use host_protocol::replies::HelloReply;

use super::Configuration;

/// The buses of a board, as far as a configuration depends on them: kind and bitrates of each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoardPorts {
    pub ports: Vec<(BusKind, Vec<u32>)>,
    pub max_axes: u8,
}

/// What carries a bus of a gateway, also of one that it has not.
pub fn kind_of(hello: &HelloReply, bus: u8) -> BusKind {
    hello.buses.get(usize::from(bus)).map_or(BusKind::Can, |bus| bus.kind)
}

/// Buses that a board can have.
const BUSES: usize = gateway::MAX_BUSES;

impl BoardPorts {
    /// That of the gateway which said this hello.
    pub fn of(hello: &HelloReply) -> Self {
        let ports = hello.buses.iter().map(|bus| (bus.kind, bus.bitrates.to_vec())).collect();
        Self { ports, max_axes: hello.max_axes }
    }

    /// Every board that a configuration could be for: each bus of either kind, with the bitrate
    /// that the configuration asks for.
    pub fn possible(configuration: &Configuration) -> impl Iterator<Item = Self> {
        let bitrates: Vec<Vec<u32>> = (0..BUSES)
            .map(|bus| {
                let bus = u8::try_from(bus).unwrap_or(u8::MAX);
                configuration.buses.get(&bus).map(|bus| bus.bitrate).into_iter().collect()
            })
            .collect();
        (0..1u32 << BUSES).map(move |kinds| {
            let kind =
                |bus: usize| if kinds >> bus & 1 == 0 { BusKind::Can } else { BusKind::Rs485 };
            let ports = bitrates.iter().enumerate().map(|(bus, rates)| (kind(bus), rates.clone()));
            #[expect(clippy::cast_possible_truncation, reason = "32")]
            Self { ports: ports.collect(), max_axes: gateway::MAX_AXES as u8 }
        })
    }

    /// The kind of a bus.
    pub fn kind(&self, bus: usize) -> Option<BusKind> {
        self.ports.get(bus).map(|(kind, _)| *kind)
    }
}
