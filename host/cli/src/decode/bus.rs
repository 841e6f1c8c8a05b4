//! What has been said on each bus of a capture.

use super::{rmd, thruster};

/// Interfaces told apart; the rest share the last place.
const MOST: usize = 16;

/// The buses of a capture by the names of their interfaces.
pub struct Buses {
    headerless: bool,
    dialect: ::rmd::Dialect,
    known: Vec<(Box<[u8]>, Bus)>,
    spare: Box<Bus>,
}

/// The conversations on one bus; a capture without interfaces may hold a CAN bus and a serial line.
pub struct Bus {
    pub rmd_can: rmd::Conversation,
    pub rmd_rs485: rmd::Conversation,
    pub thruster: thruster::Conversation,
}

impl Buses {
    /// No bus yet; `headerless` if thrusters return frames without a header from the start;
    /// `dialect` is that of the RMD motors.
    pub fn new(headerless: bool, dialect: ::rmd::Dialect) -> Self {
        let spare = Box::new(Bus::new(headerless, dialect));
        Self { headerless, dialect, known: Vec::new(), spare }
    }

    /// The bus of this interface; frames without an interface are on one bus.
    pub fn of(&mut self, interface: Option<&[u8]>) -> &mut Bus {
        let name = interface.unwrap_or_default();
        let place = self.known.iter().position(|(known, _)| **known == *name);
        let place = place.unwrap_or_else(|| {
            if self.known.len() < MOST {
                self.known.push((name.into(), Bus::new(self.headerless, self.dialect)));
            }
            self.known.iter().position(|(known, _)| **known == *name).unwrap_or(MOST)
        });
        self.known.get_mut(place).map_or(&mut self.spare, |(_, bus)| bus)
    }
}

impl Bus {
    fn new(headerless: bool, dialect: ::rmd::Dialect) -> Self {
        Self {
            rmd_can: rmd::Conversation::new(dialect),
            rmd_rs485: rmd::Conversation::new(dialect),
            thruster: thruster::Conversation::new(headerless),
        }
    }
}
