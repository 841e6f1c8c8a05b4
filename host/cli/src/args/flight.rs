//! The arguments of `trips show`, and what it has in common with `replay`.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};

use super::values::some_seconds;

#[derive(Debug, Args)]
pub struct Around {
    /// Seconds before and after the trip of which every frame is shown
    #[arg(
        long, value_name = "SECONDS", default_value = "0.02", value_parser = some_seconds,
        allow_negative_numbers = true
    )]
    pub around: Duration,
}

#[derive(Debug, Subcommand)]
pub enum TripsAction {
    /// Show what led to a trip: what the flight recorder has kept, played again on the core of
    /// this program
    ///
    /// The flight recorder keeps one trip, until an axis is armed again; it is read while none is.
    /// It prints what `mgw replay` prints, and ends with exit code 1 where this program is of
    /// another build than the gateway.
    #[command(after_help = "Examples:\n  mgw trips show                        \
            the trip that the flight recorder has kept\n  \
            mgw trips show 0                      the same, if that is the latest trip\n  \
            mgw trips show --around 2 --save trip.mgfr\n  \
            mgw replay trip.mgfr                  play it later, without the gateway")]
    Show(ShowTripArgs),
}

#[derive(Debug, Args)]
pub struct ShowTripArgs {
    /// Which trip of `mgw trips`, starts not counted: 0 is the latest; without it the one that is
    /// kept
    #[arg(value_name = "N")]
    pub trip: Option<usize>,
    #[command(flatten)]
    pub around: Around,
    /// Keep it in this file, for `mgw replay`; also where this program cannot play it
    #[arg(long, value_name = "FILE")]
    pub save: Option<PathBuf>,
}
