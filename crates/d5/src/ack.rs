//! Which requests a motor answers: register 0x10.

use codec::Effect;

use crate::node::Address;
use crate::request::Request;

/// How much a motor answers (D5 manual, register 0x10).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Node;
    use crate::payload::{Value, Width};
    use crate::register::Register;

    /// D5 manual, register 0x10.
    #[test]
    fn levels_answer_reads_and_writes() {
        let motor = Address::Node(Node::FACTORY);
        let read = Request::Read { register: Register::STATUS, width: Width::Byte };
        let write = Request::Write { register: Register::SPEED, value: Value::Word(0) };
        for (raw, reads, writes) in
            [(2, true, true), (1, true, false), (0, false, false), (3, false, false)]
        {
            let level = AckLevel::of(raw);
            assert_eq!(
                (level.answers(motor, &read), level.answers(motor, &write)),
                (reads, writes),
                "{raw}"
            );
            assert_eq!(level.raw(), raw);
        }
    }

    /// D5 manual, table row 1 and quick start (1), (4): all answer a query; no reply to the others
    /// is printed.
    #[test]
    fn of_broadcasts_only_the_query_is_answered() {
        let level = AckLevel::ReadsAndWrites;
        assert!(level.answers(Address::Broadcast, &Request::QueryId));
        assert!(!level.answers(Address::Broadcast, &Request::Execute));
        assert!(!level.answers(Address::Broadcast, &Request::Reset));
        assert!(level.answers(Address::Node(Node::FACTORY), &Request::Reset));
    }
}
