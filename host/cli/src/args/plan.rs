//! The arguments of `plan`.

use clap::Args;
use host_protocol::StateField;

use super::typed::Typed;
use super::values::state_field;
use crate::config::Source;
use crate::delays::typed_word;

/// What carries the host's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostLine {
    /// A line of so many baud, ten bits a byte.
    Baud(u32),
    /// One whose time counts for nothing.
    Usb,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// The configuration, as `mgw config apply` takes it; `-` is standard input
    #[arg(value_name = "FILE", value_parser = Source::read)]
    pub source: Source,
    /// The rate that must hold, Hz, of `Cycle`, one round after the other; if it does not, the exit code is 1 and the changes that would
    /// make it hold are told
    #[arg(long, value_name = "HZ", value_parser = hertz)]
    pub rate: Option<f64>,
    /// The rate is that of `RunCycle`, whose periods the gateway begins by itself
    #[arg(long, requires = "rate")]
    pub running: bool,
    /// How long motors take to begin their reply, µs: all of them, or one axis; 250 unless given
    #[arg(long = "reply-delay", value_name = "US|AXIS=US", value_parser = reply_delay)]
    pub reply_delays: Vec<(Option<Typed>, u32)>,
    /// Reply delays as `mgw bench --delays` has written them, or the table of `mgw delays`, of
    /// which each axis takes the longest of its protocol, bus and bitrate; --reply-delay goes
    /// before
    #[arg(long, value_name = "FILE", value_parser = Source::read)]
    pub delays: Option<Source>,
    /// The model of an axis's motor, as the table of --delays has it; may be given often
    #[arg(
        long = "motor", value_name = "AXIS=MODEL", value_parser = model, requires = "delays"
    )]
    pub models: Vec<(Typed, String)>,
    /// Frames of others on a CAN bus in a second, each counted as the longest
    #[arg(long, value_name = "BUS=FRAMES_S", value_parser = foreign)]
    pub foreign: Vec<(Typed, u32)>,
    /// The host's line: a baud rate, or `usb`, whose time counts for nothing
    #[arg(long, value_name = "BAUD|usb", default_value = "921600", value_parser = host_line)]
    pub host: HostLine,
    /// What a cycle tells of each axis
    #[arg(
        long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field,
        default_value = "position,velocity,current"
    )]
    pub fields: Vec<StateField>,
    /// An axis that is given impedance setpoints: its state is read beside them; may be given often
    #[arg(long, value_name = "AXIS")]
    pub impedance: Vec<Typed>,
    /// No axis is given position setpoints, which take nine bytes of a `Cycle` where others but
    /// impedance take five
    #[arg(long)]
    pub no_positions: bool,
    /// What the gateway's software takes: host to bus, between two requests, bus to host, µs
    #[arg(
        long, value_name = "US", default_value_t = 100,
        value_parser = clap::value_parser!(u32).range(0..=100_000)
    )]
    pub gateway_us: u32,
    /// Buses that are RS485 although their bitrate could be one of CAN: more than 1 Mbit/s or a
    /// multiple of 9600 is taken for RS485, everything else for CAN
    #[arg(long, value_name = "BUS")]
    pub rs485: Vec<Typed>,
}

/// A name, or a number below `end`.
fn typed(text: &str, end: usize) -> Option<Typed> {
    let is_there = |typed: &Typed| match typed {
        Typed::Number(number) => usize::from(*number) < end,
        Typed::Name(_) => true,
    };
    text.parse().ok().filter(is_there)
}

fn model(text: &str) -> Result<(Typed, String), String> {
    let parts = text.split_once('=');
    let known = parts.and_then(|(axis, model)| Some((typed(axis, gateway::MAX_AXES)?, model)));
    let (axis, model) =
        known.ok_or_else(|| "takes AXIS=MODEL, axis 0 to 31 or its name".to_owned())?;
    typed_word(model).map(|model| (axis, model))
}

fn hertz(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.001..=1_000_000.0).contains(rate));
    rate.ok_or_else(|| "takes Hz, 0.001 to 1000000".to_owned())
}

/// The longest delay that is taken for one, µs.
const LONGEST_DELAY_US: u32 = 1_000_000;

fn reply_delay(text: &str) -> Result<(Option<Typed>, u32), String> {
    let (axis, us) = text.split_once('=').map_or((None, text), |(axis, us)| (Some(axis), us));
    let axis = axis.map_or(Some(None), |axis| typed(axis, gateway::MAX_AXES).map(Some));
    let us = us.parse().ok().filter(|us| *us <= LONGEST_DELAY_US);
    axis.zip(us).ok_or_else(|| {
        format!(
            "takes microseconds, 0 to {LONGEST_DELAY_US}, or AXIS=MICROSECONDS with axes 0 to 31 \
             or their names"
        )
    })
}

fn foreign(text: &str) -> Result<(Typed, u32), String> {
    let parts = text
        .split_once('=')
        .and_then(|(bus, frames)| Some((typed(bus, gateway::MAX_BUSES)?, frames.parse().ok()?)));
    parts.filter(|(_, frames)| *frames <= 100_000).ok_or_else(|| {
        "takes BUS=FRAMES_S, bus 0 to 3 or its name, 0 to 100000 frames a second".to_owned()
    })
}

pub fn host_line(text: &str) -> Result<HostLine, String> {
    if text == "usb" {
        return Ok(HostLine::Usb);
    }
    let baud = text.parse().ok().filter(|baud| (1_200..=20_000_000).contains(baud));
    baud.map(HostLine::Baud).ok_or_else(|| "takes 1200 to 20000000 baud, or usb".to_owned())
}
