#![doc = include_str!("../README.md")]

pub mod chip;

pub mod crs;
mod edges;
pub mod fdcan;
pub mod fetch;
pub mod g474;
pub mod h743;
pub mod iwdg;
pub mod message_ram;
pub mod pins;
pub mod processor;
pub mod revision;
mod row;
pub mod serial_port;
pub mod socket;
pub mod usb;

pub use chip::Chip;
pub use row::Row;
