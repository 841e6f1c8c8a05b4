//! The arguments of `watch` and `raw`.

use std::time::Duration;

use clap::{Args, Subcommand};
use host_protocol::StateField;

use super::typed::Typed;
use super::values::{seconds, state_field};

#[derive(Debug, Args)]
pub struct WatchArgs {
    /// The axes; all configured ones without any
    #[arg(value_name = "AXIS")]
    pub axes: Vec<Typed>,
    /// What to tell of them: position, velocity, current, voltage, motor_temperature,
    /// driver_temperature, faults; all without it
    #[arg(long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field)]
    pub fields: Vec<StateField>,
    /// Milliseconds between two samples of an axis
    #[arg(
        long, default_value_t = 500,
        value_name = "MS",
        value_parser = clap::value_parser!(u64).range(1..=10_000)
    )]
    pub period: u64,
    /// Samples of each axis; without it until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}

#[derive(Debug, Args)]
pub struct TopArgs {
    /// Milliseconds between two samples of an axis
    #[arg(
        long, default_value_t = 200,
        value_name = "MS",
        value_parser = clap::value_parser!(u64).range(10..=10_000)
    )]
    pub period: u64,
}

#[derive(Debug, Subcommand)]
pub enum RawAction {
    /// Send a CAN frame, ID#DATA in hexadecimal (3 digits: standard id, 8: extended), and print
    /// what arrives
    Send {
        /// For example 141#9A00000000000000
        frame: String,
        /// Seconds to listen afterwards
        #[arg(
            long, default_value = "0.2",
            value_name = "SECONDS",
            value_parser = seconds, allow_negative_numbers = true
        )]
        wait: Duration,
    },
    /// Send bytes on a serial bus, in hexadecimal, and print what arrives
    SendHex {
        /// For example 3E01089A00000000000000721A
        bytes: String,
        /// Seconds to listen afterwards
        #[arg(
            long, default_value = "0.2",
            value_name = "SECONDS",
            value_parser = seconds, allow_negative_numbers = true
        )]
        wait: Duration,
    },
    /// Print what arrives, as `candump -L` does: `mgw decode` reads it
    Listen {
        /// Seconds to listen; without it until Ctrl-C
        #[arg(long = "for", value_parser = seconds, allow_negative_numbers = true)]
        seconds: Option<Duration>,
    },
}
