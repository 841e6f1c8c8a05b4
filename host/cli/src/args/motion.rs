//! The arguments of what moves motors: `jog`, `native`, `move`, `together`, `cycle`, `set`.

use std::time::Duration;

use clap::{Args, ValueEnum};
use host_protocol::{Setpoint, StateField};

use super::typed::Typed;
use super::values::{some_seconds, state_field};
use crate::failure::Failure;

#[derive(Debug, Args)]
pub struct NativeArgs {
    /// The axis
    pub axis: Typed,
    /// The data field that the manual prints, in hexadecimal
    #[arg(value_name = "DATA", required_unless_present = "command")]
    pub data: Vec<String>,
    /// A command by its name instead
    #[arg(long, value_name = "NAME", conflicts_with = "data")]
    pub command: Option<String>,
    /// A field of that command
    #[arg(
        long = "field",
        value_name = "NAME=VALUE",
        requires = "command",
        allow_hyphen_values = true
    )]
    pub fields: Vec<String>,
    /// Move: seconds to keep the command up
    #[arg(long = "for", value_parser = some_seconds, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

#[derive(Debug, Args)]
pub struct JogArgs {
    /// The axis
    pub axis: Typed,
    /// How fast, rad/s; 0.3 without it
    #[arg(long, value_name = "RAD_S", conflicts_with = "signal")]
    pub velocity: Option<f32>,
    /// Fraction of the full signal instead, 0 to 1; of a thruster 0.05 without it
    #[arg(long, value_name = "FRACTION")]
    pub signal: Option<f32>,
}

#[derive(Debug, Args)]
pub struct MoveArgs {
    /// The axis
    pub axis: Typed,
    /// How far, rad; positive is counter-clockwise
    #[arg(allow_negative_numbers = true)]
    pub distance: f32,
    /// Speed on the way, rad/s
    #[arg(long, value_name = "RAD_S", allow_negative_numbers = true)]
    pub speed_limit: f32,
    /// How near to the target it has arrived, rad
    #[arg(long, default_value_t = 0.02, value_name = "RAD")]
    pub tolerance: f32,
    /// Seconds to try at most, exit code 1 if it has not arrived then; without it until it has
    #[arg(long = "for", value_parser = some_seconds, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

#[derive(Debug, Args)]
pub struct TogetherArgs {
    /// An axis and its velocity, rad/s; two axes or more
    #[arg(required = true, value_name = "AXIS velocity RAD_S", allow_negative_numbers = true)]
    pub words: Vec<String>,
    /// Seconds to keep them turning; without it until Ctrl-C
    #[arg(long = "for", value_parser = some_seconds, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

/// One of several axes that start together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// The axis.
    pub axis: u8,
    /// rad/s
    pub velocity: f32,
}

impl Target {
    /// Reads `AXIS velocity RAD_S` two times or more; otherwise what is wrong. `find` says which
    /// axis was typed.
    pub fn all(
        words: &[String],
        mut find: impl FnMut(&Typed) -> Result<u8, Failure>,
    ) -> Result<Vec<Self>, Failure> {
        let wanted = "write AXIS velocity RAD_S for each, for example `3 velocity 2 4 velocity -2`";
        let targets = words.chunks(3).map(|words| match words {
            [axis, mode, velocity] if mode == "velocity" => {
                let axis = find(&axis_of(axis, wanted)?)?;
                let wrong = |_| Failure::Usage(format!("`{velocity}` is not a velocity: {wanted}"));
                let velocity = velocity.parse().map_err(wrong)?;
                Ok(Self { axis, velocity })
            }
            [_, mode, ..] if mode != "velocity" => {
                let text = format!("`{mode}`: motors start together by their velocity: {wanted}");
                Err(Failure::Usage(text))
            }
            _ => Err(incomplete(words, wanted)),
        });
        let targets: Vec<Self> = targets.collect::<Result<_, _>>()?;
        if targets.len() < 2 {
            let text = format!("one motor does not start together with others: {wanted}");
            return Err(Failure::Usage(text));
        }
        Ok(targets)
    }
}

#[derive(Debug, Args)]
pub struct CycleArgs {
    /// An axis, `signal`, `current` or `velocity`, and its value: fraction -1 to 1, A, rad/s; as
    /// many as wanted
    #[arg(required = true, value_name = "AXIS MODE VALUE", allow_negative_numbers = true)]
    pub words: Vec<String>,
    /// How often each setpoint is sent, Hz
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    pub rate: f64,
    /// What is told of every axis
    #[arg(
        long, value_name = "FIELD,…", value_delimiter = ',', value_parser = state_field,
        default_value = "position,velocity,current"
    )]
    pub fields: Vec<StateField>,
    /// Seconds to go on; without it until Ctrl-C
    #[arg(long = "for", value_parser = some_seconds, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

/// One of the axes of a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleTarget {
    /// The axis.
    pub axis: u8,
    /// What it does.
    pub setpoint: Setpoint,
}

impl CycleTarget {
    /// Reads `AXIS MODE VALUE` once or more; otherwise what is wrong. `find` says which axis was
    /// typed.
    pub fn all(
        words: &[String],
        mut find: impl FnMut(&Typed) -> Result<u8, Failure>,
    ) -> Result<Vec<Self>, Failure> {
        let wanted = "write AXIS MODE VALUE for each, for example `0 velocity 2 1 signal 0.1`";
        let mut target = |words: &[String]| {
            let [axis, mode, value] = words else {
                return Err(incomplete(words, wanted));
            };
            let axis = find(&axis_of(axis, wanted)?)?;
            let wrong = |_| Failure::Usage(format!("`{value}` is not a number: {wanted}"));
            let value = value.parse().map_err(wrong)?;
            let setpoint = match mode.as_str() {
                "signal" => Setpoint::Signal { fraction: value },
                "current" => Setpoint::Current { current_a: value },
                "velocity" => Setpoint::Velocity { velocity_rad_s: value },
                _ => {
                    return Err(Failure::Usage(format!(
                        "`{mode}` is none of signal, current and velocity: {wanted}"
                    )));
                }
            };
            Ok(Self { axis, setpoint })
        };
        words.chunks(3).map(&mut target).collect()
    }
}

/// An axis among other words.
fn axis_of(text: &str, wanted: &str) -> Result<Typed, Failure> {
    let wrong = |_| format!("`{text}` is neither the number nor the name of an axis: {wanted}");
    text.parse().map_err(wrong).map_err(Failure::Usage)
}

fn incomplete(words: &[String], wanted: &str) -> Failure {
    Failure::Usage(format!("`{}` is not complete: {wanted}", words.join(" ")))
}

#[derive(Debug, Args)]
pub struct SetArgs {
    /// The axis
    pub axis: Typed,
    /// What is set
    pub mode: Mode,
    /// fraction -1 to 1, A, rad/s or rad
    #[arg(allow_negative_numbers = true)]
    pub value: f32,
    /// Speed limit of a position, rad/s
    #[arg(long, value_name = "RAD_S", allow_negative_numbers = true)]
    pub speed_limit: Option<f32>,
    /// Stiffness of an impedance, N·m/rad
    #[arg(long, value_name = "NM_PER_RAD", allow_negative_numbers = true)]
    pub stiffness: Option<f32>,
    /// Damping of an impedance, N·m·s/rad
    #[arg(long, value_name = "NM_S_PER_RAD", allow_negative_numbers = true)]
    pub damping: Option<f32>,
    /// Velocity at which the damper of an impedance is at rest, rad/s; 0 without it
    #[arg(long, value_name = "RAD_S", allow_negative_numbers = true)]
    pub velocity: Option<f32>,
    /// Torque of an impedance in addition, N·m; 0 without it
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    pub torque: Option<f32>,
    /// Most torque with which an impedance may begin, N·m; nothing is armed for more
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    pub torque_limit: Option<f32>,
    /// Seconds to hold it; without it until Ctrl-C
    #[arg(long = "for", value_parser = some_seconds, allow_negative_numbers = true)]
    pub seconds: Option<Duration>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Mode {
    /// Fraction of full signal, -1 to 1
    Signal,
    /// Torque current, A
    Current,
    /// Shaft velocity, rad/s
    Velocity,
    /// Shaft angle, rad; needs --speed-limit
    Position,
    /// A spring and a damper about a shaft angle, rad; needs --stiffness, --damping and
    /// --torque-limit
    Impedance,
}
