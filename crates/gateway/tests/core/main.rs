//! The core in virtual time: typed requests on one side, literal bytes on the other.

mod bad_input;
mod bench;
mod brake;
mod capabilities;
mod clearing;
mod d5;
mod dead_bus;
mod echo;
mod fairness;
mod holding;
mod motion;
mod motors;
mod random;
mod rig;
mod stops;
mod text;
mod wire;
