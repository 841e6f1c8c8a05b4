//! The arguments of `configure`.

use clap::{Args, Subcommand};

use crate::plan::Plan;

#[derive(Debug, Args)]
pub struct ConfigureArgs {
    /// Apply a TOML file with buses, axes and motor timeouts
    #[arg(long, value_name = "FILE", value_parser = Plan::read)]
    pub file: Option<Plan>,
    #[command(subcommand)]
    pub target: Option<ConfigureTarget>,
}

#[derive(Debug, Subcommand)]
pub enum ConfigureTarget {
    /// Set a bus: bitrate=, protocols= (rmd,thruster,d5), exclusive=, reply_window_us=
    Bus {
        /// The bus
        bus: u8,
        /// NAME=VALUE
        #[arg(required = true, value_name = "NAME=VALUE")]
        assignments: Vec<String>,
    },
    /// Set parameters of an axis; `mgw configure show AXIS` lists them
    Axis {
        /// The axis
        axis: u8,
        /// NAME=VALUE, applied in this order
        #[arg(required = true, value_name = "NAME=VALUE")]
        assignments: Vec<String>,
    },
    /// Set parameters of the gateway: link_silence_us=
    Gateway {
        /// NAME=VALUE
        #[arg(required = true, value_name = "NAME=VALUE")]
        assignments: Vec<String>,
    },
    /// Write the motor's own communication timeout; it stays in the motor. 0 switches it off
    Timeout {
        /// The axis
        axis: u8,
        /// Milliseconds
        milliseconds: u32,
    },
    /// Show every parameter of an axis with its value, unit and range
    Show {
        /// The axis
        axis: u8,
    },
    /// Remove an axis from the configuration
    Remove {
        /// The axis
        axis: u8,
    },
}
