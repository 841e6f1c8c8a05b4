//! USB: the controller of a chip as a device, and a scripted host at the other end of the cable.

pub mod function;
pub mod host;
pub mod otg;
