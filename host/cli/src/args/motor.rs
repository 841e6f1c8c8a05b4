//! The arguments of `motor`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};
use host_protocol::Protocol;

use super::typed::Typed;
use crate::parameters;

/// Whose settings they are; axis and bus by number, or as they were typed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotorTarget<A = u8> {
    /// The motor of an axis.
    Axis(A),
    /// A motor that need not be configured.
    Place {
        bus: A,
        /// Where it is named: a node may be that of an RMD and of a thruster.
        protocol: Option<Protocol>,
        node: u8,
        /// Where the bus is not configured, or for another bitrate, bit/s.
        bitrate: Option<u32>,
    },
}

#[derive(Debug, Args)]
pub struct MotorArgs {
    /// An axis, or a motor by its place: 0:1, 0:thruster:11, 1:d5:0x0B@210526
    #[arg(value_name = "AXIS|BUS:[PROTOCOL:]NODE[@BIT/S]", value_parser = motor_target)]
    pub target: MotorTarget<Typed>,
    /// Do it without asking
    #[arg(long, global = true)]
    pub yes: bool,
    #[command(subcommand)]
    pub setting: MotorSetting,
}

#[derive(Debug, Subcommand)]
pub enum MotorSetting {
    /// The id on the bus; the new one must be free
    Id { id: Option<u8> },
    /// The bitrate, from the next power-on
    Bitrate {
        #[arg(value_name = "BIT/S")]
        bitrate: Option<u32>,
    },
    /// The zero point: where the shaft stands (`here`), or encoder pulses (RMD)
    Zero {
        #[arg(value_name = "here|PULSES", value_parser = zero, allow_negative_numbers = true)]
        at: Option<Zero>,
    },
    /// Gains (RMD)
    Pid {
        #[arg(value_name = "NAME=VALUE")]
        values: Vec<String>,
        /// Not to the motor's ROM: they are lost with its power
        #[arg(long)]
        ram: bool,
    },
    /// Ramps
    Acceleration {
        #[arg(value_name = "NAME=VALUE")]
        values: Vec<String>,
    },
    /// The time without a command after which it stops by itself; 0 switches that off
    Timeout {
        #[arg(value_name = "MS")]
        timeout_ms: Option<u32>,
    },
    /// The end positions that a thruster's rudder keeps by itself
    Limits {
        #[arg(value_name = "NAME=VALUE")]
        values: Vec<String>,
    },
    /// The holding brake (RMD)
    Brake { action: Option<BrakeAction> },
    /// Restart an RMD; a D5 forgets everything and gets id 0x0B
    Reset,
    /// Clear latched faults
    ClearFaults,
    /// Which requests a D5 answers: 2 all, 1 reads only
    AckLevel {
        #[arg(value_parser = clap::value_parser!(u8).range(1..=2))]
        level: Option<u8>,
    },
    /// How long a D5 waits before it answers, in its own unit
    ReplyDelay { raw: Option<u8> },
    /// Switch a function of an RMD; no motor tells how it is switched
    Function { function: FunctionName, state: OnOff },
    /// What a thruster returns to signal and speed, by the bits of the manual
    Returns { flags: u8, frames: u8 },
    /// What a thruster sends by itself from power-on, by the bits of the manual
    Stream {
        frames: u8,
        #[arg(value_name = "MS")]
        interval_ms: u16,
    },
    /// How often a thruster tells current and speed by itself, until its power is off
    Reports { mode: Reports },
    /// Write all settings that can be read as a TOML file
    Dump {
        /// The file to write; standard output without it
        #[arg(long, short, value_name = "FILE")]
        output: Option<PathBuf>,
        /// Write over a file that is there
        #[arg(long, requires = "output")]
        force: bool,
    },
    /// Give the motor the settings of such a file, but for id and bitrate
    Restore {
        file: String,
        /// The id too
        #[arg(long)]
        with_id: bool,
        /// The bitrate too
        #[arg(long)]
        with_bitrate: bool,
    },
    /// Show what such a file has otherwise than the motor; exit code 1 if anything
    Diff { file: String },
}

/// A zero point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// Where the shaft stands.
    Here,
    /// Encoder pulses.
    Pulses(i32),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum BrakeAction {
    Release,
    Lock,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OnOff {
    On,
    Off,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FunctionName {
    /// Hear only frames with its own CAN id
    CanIdFilter,
    /// Send 0x9A every 100 ms while a fault stands
    ErrorReporting,
    /// Keep the multi-turn value without power
    MultiTurnSaving,
    /// Recover from faults of voltage and speed by itself (V4.4)
    FaultRecovery,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Reports {
    /// Not at all
    Off,
    /// Every second
    Low,
    /// Every 100 ms
    Medium,
}

/// `0`, `0:1`, `0:thruster:11`, `1:d5:0x0B@210526`
fn motor_target(text: &str) -> Result<MotorTarget<Typed>, String> {
    let wrong = || {
        "takes an axis, or BUS:NODE, BUS:PROTOCOL:NODE, each with @BIT/S where the bus runs \
            otherwise, axis and bus by number or by name: 0, left, 0:1, arm_bus:1, 0:thruster:11, \
            1:d5:0x0B@210526"
            .to_owned()
    };
    let byte = |text: &str| parameters::unsigned(text).and_then(|number| u8::try_from(number).ok());
    let (motor, bitrate) = match text.split_once('@') {
        Some((motor, rate)) => (motor, Some(parameters::unsigned(rate).ok_or_else(wrong)?)),
        None => (text, None),
    };
    let words: Vec<&str> = motor.split(':').collect();
    let (bus, protocol, node) = match words.as_slice() {
        [axis] if bitrate.is_none() => {
            return axis.parse().map(MotorTarget::Axis).map_err(|_| wrong());
        }
        [bus, node] => (bus, None, node),
        [bus, protocol, node] => {
            (bus, Some(Protocol::from_name(protocol).ok_or_else(wrong)?), node)
        }
        _ => return Err(wrong()),
    };
    let bus = bus.parse().map_err(|_| wrong())?;
    let node = byte(node).ok_or_else(wrong)?;
    Ok(MotorTarget::Place { bus, protocol, node, bitrate })
}

fn zero(text: &str) -> Result<Zero, String> {
    match text {
        "here" => Ok(Zero::Here),
        pulses => pulses
            .parse()
            .map(Zero::Pulses)
            .map_err(|_| "takes `here`, or a whole number of encoder pulses".to_owned()),
    }
}
