//! The promises of the gateway, as a model of its own.
//!
//! An [`Oracle`] is told what is on the wires: the bytes of every host link in both directions, the
//! frames of every bus when they are handed to its controller, when they have left, when they come
//! in, and when the controller is off. From that alone it knows which axis may move, until when,
//! and which stop is due; a frame that should not be there, and one that should and is not, is a
//! [`Violation`]. It has tables of its own, from the manuals and PROTOCOL.md, and depends on no
//! crate of the project, so that nothing that is wrong there can be wrong here in the same way.
//!
//! The order at one instant is that of cause and effect: first what has happened, then what the
//! gateway says to its hosts, then what it hands to its buses, then [`Oracle::settle`]. One host
//! link at least must be listening: it has said `Hello`, and everything for it is read at once
//! ([`Oracle::drained`]), for the events tell which axis is in which state.
//!
//! What an event says is believed where it restricts the gateway (an axis has tripped) and checked
//! where it does not (an axis is armed, a stop is confirmed).
#![forbid(unsafe_code)]

mod axis;
mod bus;
mod can_id;
mod checks;
mod link;
mod motor;
mod oracle;
mod state_text;
mod violation;
mod wire;

pub use axis::Place;
pub use bus::BusKind;
pub use can_id::{EXTENDED, is_extended, rank};
pub use oracle::{Frame, Oracle};
pub use violation::{Check, Violation};
pub use wire::{Told, frame};

#[cfg(test)]
mod tests;
