//! What the emulator could not stand in for.

use std::collections::{BTreeMap, BTreeSet};

use rigless::device::Told;
use rigless::machine::Board;
use rigless::session::{Reset, Session, Undefined, Unimplemented, Unmapped};
use rigless::soc::Fault;

/// The gaps that a run has met, and its resets, since the board was switched on.
#[derive(Debug, Clone, Default)]
pub struct Reports {
    /// By address: registers of the part that no model implements.
    pub unimplemented: BTreeMap<u64, Unimplemented>,
    /// Addresses that no register covers.
    pub unmapped: Vec<Unmapped>,
    /// By address: accesses that the part refuses, as while a clock gate is shut.
    pub refused: BTreeMap<u64, Fault>,
    /// By address: accesses inside a peripheral's block where there is no register.
    pub undefined: BTreeMap<u64, Undefined>,
    /// Interrupts for which the core has no line, by instance and number.
    pub unrouted: BTreeSet<(&'static str, u16)>,
    /// What a model says it was asked to do and does not do, or what the manual forbids.
    pub told: Vec<Told>,
    /// Every restart, in order.
    pub resets: Vec<Reset>,
}

impl Reports {
    pub(super) fn of<D: Board + ?Sized>(session: &Session<D>) -> Self {
        Self {
            unimplemented: session.unimplemented().clone(),
            unmapped: session.unmapped(),
            refused: session.refused().clone(),
            undefined: session.undefined().clone(),
            unrouted: session.unrouted().clone(),
            told: session.told().copied().collect(),
            resets: session.resets().to_vec(),
        }
    }
}
