//! The program `mgw` as a user runs it.

mod bench;
mod commands;
mod config;
mod cycle;
mod decode;
mod delays;
mod demonstration;
#[cfg(unix)]
mod device;
mod doctor;
mod encode;
mod explain;
mod faults;
#[cfg(unix)]
mod flood;
mod guide;
mod hostile_text;
#[cfg(unix)]
mod jog;
mod killed_host;
mod motor;
mod moving;
mod names;
mod native;
#[cfg(target_os = "linux")]
mod plan;
mod pty;
mod record;
mod refusals;
mod replay;
mod scan;
mod schema;
#[cfg(unix)]
mod server;
mod support;
mod terminal;
#[cfg(target_os = "linux")]
mod top;
mod trips;
mod typed;
#[cfg(target_os = "linux")]
mod unread;
mod update;
mod vectors;
#[cfg(unix)]
mod view;
mod watch;
