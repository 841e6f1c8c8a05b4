//! The program `mgw` as a user runs it.

mod commands;
mod demonstration;
mod killed_host;
mod refusals;
mod support;
