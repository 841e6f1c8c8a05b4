//! The arguments of `bench`.

use std::path::PathBuf;

use clap::Args;
use host_protocol::StateField;

use super::plan::{HostLine, host_line};
use super::typed::Typed;
use super::values::state_field;
use crate::delays::typed_word;

#[derive(Debug, Args)]
pub struct BenchArgs {
    /// The axes; all configured ones without any
    #[arg(value_name = "AXIS")]
    pub axes: Vec<Typed>,
    /// Arm without asking
    #[arg(long)]
    pub yes: bool,
    /// Rounds of each measurement
    #[arg(
        long, value_name = "N", default_value_t = 500,
        value_parser = clap::value_parser!(u32).range(10..=1_000_000)
    )]
    pub rounds: u32,
    /// What every axis that takes velocities is given, rad/s; thrusters are given signal 0
    #[arg(long, value_name = "RAD_S", default_value_t = 0.0, allow_negative_numbers = true)]
    pub velocity: f32,
    /// What a cycle tells of each axis
    #[arg(
        long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field,
        default_value = "position,velocity,current"
    )]
    pub fields: Vec<StateField>,
    /// The host's line as the plan beside the measurement takes it: its baud rate, or `usb`, whose
    /// time counts for nothing, as that of TCP
    #[arg(long, value_name = "BAUD|usb", default_value = "usb", value_parser = host_line)]
    pub host: HostLine,
    /// What the gateway's software takes, as the plan takes it, µs
    #[arg(
        long, value_name = "US", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(0..=100_000)
    )]
    pub gateway_us: u32,
    /// Estimate how long each motor takes to begin its reply, and write it into this file, for
    /// `mgw plan --delays`
    #[arg(long, value_name = "FILE")]
    pub delays: Option<PathBuf>,
    /// Estimate it of every round, and write that as a table by motor, for `mgw delays`
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// Who measures, as the table has it; unknown without it, simulator where the gateway is
    /// simulated
    #[arg(
        long = "where", value_name = "NAME", value_parser = typed_word, requires = "table"
    )]
    pub place: Option<String>,
    /// Draw the cycle rates, measured and planned, into this file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
}
