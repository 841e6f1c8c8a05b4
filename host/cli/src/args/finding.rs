//! The arguments of `scan`.

use std::time::Duration;

use clap::Args;

use super::values::seconds;

#[derive(Debug, Args)]
pub struct ScanArgs {
    /// The bus; all that are configured without it
    pub bus: Option<u8>,
    /// Scan at these bitrates instead of the configured one, on CAN until motors are found; only a
    /// bus without axes, which is configured as before afterwards
    #[arg(long = "bitrate", value_name = "BIT/S,…", value_delimiter = ',', requires = "bus")]
    pub bitrates: Vec<u32>,
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
