//! Which requests a motor answers: register 0x10.

use codec::Effect;

use crate::node::Address;
use crate::request::Request;

/// How much a motor answers (D5 manual, register 0x10).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum AckLevel {
    /// 2, from the factory: reads and writes.
    ReadsAndWrites,
    /// 1: reads only.
    Reads,
    /// Anything else: nothing at all.
    Nothing {
        /// What the register holds.
        raw: u8,
    },
}

impl AckLevel {
    const READS_AND_WRITES: u8 = 2;
    const READS: u8 = 1;

    /// The level that the register holds.
    pub const fn of(raw: u8) -> AckLevel {
        match raw {
            Self::READS_AND_WRITES => AckLevel::ReadsAndWrites,
            Self::READS => AckLevel::Reads,
            raw => AckLevel::Nothing { raw },
        }
    }

    /// What the register holds at this level.
    pub const fn raw(self) -> u8 {
        match self {
            AckLevel::ReadsAndWrites => Self::READS_AND_WRITES,
            AckLevel::Reads => Self::READS,
            AckLevel::Nothing { raw } => raw,
        }
    }

    /// Whether a motor at this level answers the request. What neither reads nor writes a register
    /// counts as a read if it changes nothing in the motor, which is an assumption, as is that
    /// an execute or reset for all is not answered.
    pub fn answers(self, address: Address, request: &Request) -> bool {
        if matches!(request, Request::Execute | Request::Reset) && address == Address::Broadcast {
            return false;
        }
        match self {
            AckLevel::ReadsAndWrites => true,
            AckLevel::Reads => request.effect() == Effect::Reads,
            AckLevel::Nothing { .. } => false,
        }
    }
}
