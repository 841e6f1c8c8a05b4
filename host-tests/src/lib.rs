//! Tests of the whole: a host, a gateway and motors on simulated buses, in virtual time.
//!
//! Scenarios are text files in `scenarios/`, named for the behaviour they show; [`scenario`] runs them.
#![forbid(unsafe_code)]

pub mod scenario;
