//! The core in virtual time: typed requests on one side, literal bytes on the other.

mod bad_input;
mod bench;
mod motion;
mod rig;
mod stops;
mod wire;
