//! The tasks: each waits for its port or for the core, carries bytes or frames between the two, and
//! decides nothing.

pub mod can;
pub mod deadline;
pub mod flight;
pub mod history;
pub mod host;
pub mod light;
pub mod log;
pub mod rs485;
pub mod safety;
pub mod storage;
pub mod supervisor;
pub mod usb;
