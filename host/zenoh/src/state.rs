//! How a gateway, a bus or an axis is, as `mgw --json` prints it.

use host_protocol::{AxisSummary, Named, Subject};
use mgw_cli::programs::{self, Motors};
use mgw_client::{Client, ClientError, Transport};
use serde_json::{Value, json};

/// What has a state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The gateway.
    Gateway,
    /// A bus.
    Bus(u8),
    /// An axis.
    Axis(u8),
}

impl Part {
    /// As it stands in a key.
    pub fn text(self) -> String {
        match self {
            Self::Gateway => "gateway".to_owned(),
            Self::Bus(bus) => format!("bus/{bus}"),
            Self::Axis(axis) => format!("axis/{axis}"),
        }
    }

    /// All that a gateway has.
    pub fn all(buses: usize, axes: &[AxisSummary]) -> Vec<Self> {
        let buses = (0..u8::try_from(buses).unwrap_or(u8::MAX)).map(Self::Bus);
        let axes = axes.iter().map(|axis| Self::Axis(axis.axis));
        [Self::Gateway].into_iter().chain(buses).chain(axes).collect()
    }
}

/// What is known of names and motors.
pub struct Known {
    /// By which faults are named.
    pub motors: Motors,
    /// The names that the gateway has given.
    pub names: Vec<Named>,
}

impl Known {
    /// The name of something.
    pub fn name(&self, of: Subject) -> Option<&str> {
        self.names.iter().find(|named| named.of == of).map(|named| named.name.as_str())
    }

    /// Asks how something is.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn ask<T: Transport>(
        &self,
        client: &mut Client<T>,
        part: Part,
    ) -> Result<Value, ClientError> {
        let (mut state, of) = match part {
            Part::Bus(bus) => return Ok(programs::bus(bus, &client.bus_status(bus)?)),
            Part::Gateway => {
                let (status, stored) = (client.gateway_status()?, client.read_stored()?);
                let image = client.image()?;
                (programs::info(client.hello(), &status, &stored, &image), Subject::Gateway)
            }
            Part::Axis(axis) => {
                let report = client.read_state_when_free(axis)?;
                (programs::state(&report, &self.motors), Subject::Axis(axis))
            }
        };
        state["name"] = json!(self.name(of));
        Ok(state)
    }
}
