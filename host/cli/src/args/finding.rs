//! The arguments of `scan` and `adopt`, and the motors of `sim` that they find.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use host_protocol::{Protocol, StopAction};
use rmd::Dialect;

use super::typed::Typed;
use super::values::{scan_target, seconds, stop_action};

/// A bus, by number or as it was typed, and at which bitrates it is scanned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScanTarget<B = u8> {
    pub bus: B,
    pub bitrates: Bitrates,
}

/// At which bitrates a bus is scanned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Bitrates {
    /// At that which it is configured for.
    Configured,
    /// At these, bit/s.
    Named(Vec<u32>),
    /// At all that the board has for it.
    All,
}

#[derive(Debug, Args)]
pub struct ScanArgs {
    /// The buses; all that are configured without any. With a bitrate, or `all`, the bus is scanned
    /// there instead of at its own, on CAN until motors are found; only one without axes, which is
    /// configured as before afterwards
    #[arg(value_name = "BUS[@BIT/S,…|@all]", value_parser = scan_target)]
    pub targets: Vec<ScanTarget<Typed>>,
    /// Seconds to listen before the first motor is asked: to what motors send by themselves
    #[arg(
        long, default_value = "1.2",
        value_name = "SECONDS",
        value_parser = seconds, allow_negative_numbers = true
    )]
    pub listen: Duration,
    /// Ask thrusters too; any command, a read too, may end the timeout that keeps one at rest
    #[arg(long)]
    pub thrusters: bool,
}

#[derive(Debug, Args)]
pub struct ScanCommand {
    #[command(flatten)]
    pub scan: ScanArgs,
    /// Ask on a CAN bus whose bitrate is not known although something else may send there: at a
    /// wrong bitrate each frame disturbs it
    #[arg(long)]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct AdoptArgs {
    #[command(flatten)]
    pub scan: ScanArgs,
    /// The file to write; standard output without it
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// What `--force` of `mgw scan` does
    #[arg(long)]
    pub force_scan: bool,
    /// Write over a file that is there
    #[arg(long, requires = "output")]
    pub force: bool,
    /// The stop action of motors that have a choice: coast, hold or brake. Without it the file
    /// leaves it to be chosen
    #[arg(long, value_name = "ACTION", value_parser = stop_action)]
    pub stop_action: Option<StopAction>,
}

/// A simulated motor as it comes from its box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FactoryMotor {
    pub bus: u8,
    pub protocol: Protocol,
    pub node: u8,
    /// Of an RMD, where it is named.
    pub dialect: Option<Dialect>,
    /// Where it is not the usual one, bit/s.
    pub bitrate: Option<u32>,
}
