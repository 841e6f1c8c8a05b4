//! The core among random hosts, buses and motors, in virtual time, judged by the model of the
//! promises.
//!
//! A run is a list of [`Step`]s: what hosts send, what breaks, and when. Nothing else is random, so
//! the same list gives the same run, and a list that breaks a promise can be made shorter
//! ([`shrink()`]) and printed ([`text`]).
#![forbid(unsafe_code)]

mod action;
pub mod bad_host;
mod bus;
mod dice;
pub mod exhaust;
pub mod generate;
mod host;
mod motor;
mod panics;
mod plant;
mod shrink;
pub mod text;
mod world;

pub use action::Step;
pub use shrink::{broken_by, broken_with, shrink};
pub use world::{Counts, World};
