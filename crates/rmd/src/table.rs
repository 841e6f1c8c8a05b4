//! The protocol as data: every command by name with its fields, for tools that list, build and print commands.
//!
//! Names of commands and fields, their units and ranges are written here and nowhere else.

mod commands;
pub(crate) mod field;

pub use commands::COMMANDS;
pub(crate) use commands::*;

#[cfg(test)]
mod tests;
