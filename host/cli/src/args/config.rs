//! The arguments of `config`.

use clap::{Args, Subcommand};

use super::typed::Typed;
use crate::config::Source;

#[derive(Debug, Subcommand)]
pub enum ConfigAction {
    /// Make the configuration of a TOML file the gateway's: what is not in it has its default
    Apply {
        #[command(flatten)]
        file: ConfigFile,
        /// Only look for errors, and send nothing; without --port as far as that is possible
        #[arg(long)]
        check: bool,
    },
    /// Look for errors in a file, and send nothing; without --port as far as that is possible
    Check {
        #[command(flatten)]
        file: ConfigFile,
    },
    /// Show what applying a file would change; exit code 1 if that is something
    Diff {
        #[command(flatten)]
        file: ConfigFile,
    },
    /// Print the configuration as a file
    Dump {
        /// In the words of this file: its comments and its order; `-` is standard input
        #[arg(long, value_name = "FILE", value_parser = Source::read)]
        template: Option<Source>,
    },
    /// Store the running configuration in the gateway, so that it runs again after a loss of power
    ///
    /// Only while every axis is at rest; nothing is armed and nothing changes until it is stored.
    Save,
    /// Configure nothing: no bus, no axis
    Reset {
        /// Forget what is stored, and leave what runs as it is
        #[arg(long)]
        stored: bool,
    },
    /// Give parameters their default again
    Unset {
        #[command(subcommand)]
        row: ConfigRow,
    },
    /// Print the JSON schema of the file, for editors
    Schema,
    #[command(flatten)]
    Set(ConfigRow),
    /// Write the motor's own communication timeout; it stays in the motor. 0 switches it off
    Timeout {
        /// The axis
        axis: Typed,
        /// Milliseconds
        milliseconds: u32,
    },
    /// Show every parameter of an axis with its value, unit and range
    Show {
        /// The axis
        axis: Typed,
    },
    /// Remove an axis from the configuration
    Remove {
        /// The axis
        axis: Typed,
    },
}

#[derive(Debug, Args)]
pub struct ConfigFile {
    /// The file, or `-` for standard input
    #[arg(value_name = "FILE", value_parser = Source::read)]
    pub source: Source,
    /// Change only what the file names
    #[arg(long)]
    pub merge: bool,
}

#[derive(Debug, Subcommand)]
pub enum ConfigRow {
    /// Parameters of a bus: name, bitrate, protocols (rmd,thruster,d5), exclusive, reply_window_us
    Bus {
        /// The bus
        bus: Typed,
        /// NAME=VALUE; to unset it NAME
        #[arg(required = true, value_name = "NAME[=VALUE]")]
        words: Vec<String>,
    },
    /// Parameters of an axis, its name too; `mgw config show AXIS` lists them
    Axis {
        /// The axis
        axis: Typed,
        /// NAME=VALUE; to unset it NAME
        #[arg(required = true, value_name = "NAME[=VALUE]")]
        words: Vec<String>,
    },
    /// Parameters of the gateway: name, link_silence_us
    Gateway {
        /// NAME=VALUE; to unset it NAME
        #[arg(required = true, value_name = "NAME[=VALUE]")]
        words: Vec<String>,
    },
}
