//! Tests of the whole: a host, a gateway and motors on simulated buses, in virtual time.
//!
//! Scenarios are text files in `scenarios/`, named for the behaviour they show; [`scenario`] runs
//! them. Those of the host's side, `mgw` on a bad line, are in `client-scenarios/`;
//! [`client_scenario`] runs them.
#![forbid(unsafe_code)]

pub mod client_scenario;
pub mod full_load;
pub mod long_run;
mod play;
pub mod scenario;

pub use play::play_all;
