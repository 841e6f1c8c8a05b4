//! The arguments of `record`, `play` and `plot`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use host_protocol::StateField;

use super::typed::Typed;
use super::values::{some_seconds, state_field};
use crate::record::Place;

const BYTES_PER_MEBIBYTE: u64 = 1024 * 1024;

/// How long a file gets, and whether one may go.
#[derive(Debug, Args)]
pub struct FileArgs {
    /// A file ends when it has so many MiB, and another begins: FILE.2.mcap, FILE.3.mcap, …
    #[arg(
        long, default_value_t = 1024, value_name = "MIB",
        value_parser = clap::value_parser!(u64).range(1..=1_048_576)
    )]
    pub max_size: u64,
    /// Write over a file that is there already
    #[arg(long)]
    pub force: bool,
}

impl FileArgs {
    /// Where a recording into this file goes.
    pub fn place(&self, path: PathBuf) -> Place {
        Place { path, longest: self.max_size * BYTES_PER_MEBIBYTE, force: self.force }
    }
}

#[derive(Debug, Args)]
pub struct RecordArgs {
    /// The file, an MCAP file
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// The axes whose samples are recorded; all configured ones without any
    #[arg(value_name = "AXIS")]
    pub axes: Vec<Typed>,
    /// What to record of them: position, velocity, current, voltage, motor_temperature,
    /// driver_temperature, faults; all without it
    #[arg(long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field)]
    pub fields: Vec<StateField>,
    /// Milliseconds between two samples of an axis
    #[arg(
        long, default_value_t = 10, value_name = "MS",
        value_parser = clap::value_parser!(u64).range(1..=10_000)
    )]
    pub period: u64,
    /// Seconds to record; without it until Ctrl-C
    #[arg(
        long = "for", value_name = "SECONDS", value_parser = some_seconds,
        allow_negative_numbers = true
    )]
    pub seconds: Option<Duration>,
    /// Open this bus for raw frames, whose axes have to be idle and cannot be armed meanwhile, and
    /// record what arrives there; takes authority
    #[arg(long, value_name = "BUS")]
    pub frames: Option<Typed>,
    #[command(flatten)]
    pub written: FileArgs,
}

fn recorded_axis(text: &str) -> Result<u8, String> {
    text.parse().map_err(|_| "takes the number of an axis: a recording has no names".to_owned())
}

/// A part of a recording.
#[derive(Debug, Args)]
pub struct Part {
    /// The recordings: MCAP files, in their order
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Only of this axis; may be given often
    #[arg(long = "axis", value_name = "AXIS", value_parser = recorded_axis)]
    pub axes: Vec<u8>,
    /// From this time of the gateway on, seconds
    #[arg(long, value_name = "SECONDS")]
    pub from: Option<f64>,
    /// Until this time of the gateway, seconds
    #[arg(long, value_name = "SECONDS")]
    pub to: Option<f64>,
}

#[derive(Debug, Args)]
pub struct PlayArgs {
    #[command(flatten)]
    pub part: Part,
    /// Only topics that begin so: /axis/0/sample, /event, /cycle, /request, /reply, /frame,
    /// /recording; may be given often
    #[arg(long = "topic", value_name = "TOPIC")]
    pub topics: Vec<String>,
    /// Print CSV: a line for each message, a column for each field
    #[arg(long)]
    pub csv: bool,
    /// Print the raw frames as `candump -L` does: `mgw decode` reads them
    #[arg(long, conflicts_with = "csv")]
    pub candump: bool,
}

#[derive(Debug, Args)]
pub struct PlotArgs {
    #[command(flatten)]
    pub part: Part,
    /// What to draw, a chart for each: position, velocity, current, voltage, motor_temperature,
    /// driver_temperature
    #[arg(
        long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field,
        default_value = "position,velocity,current"
    )]
    pub fields: Vec<StateField>,
    /// The picture, by its end an SVG or a PNG file; without it the name of the recording with .svg
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write over a picture that is there already
    #[arg(long)]
    pub force: bool,
}
