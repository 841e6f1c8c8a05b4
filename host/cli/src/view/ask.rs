//! What a page asks for.

use host_protocol::Setpoint;
use serde::Deserialize;

/// One message of a page.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(tag = "ask", rename_all = "snake_case", deny_unknown_fields)]
pub enum Ask {
    /// Stop everything. Needs no authority.
    Stop,
    /// Take command.
    Take,
    /// Stop what is armed here and give command back.
    Release,
    /// The page is still there.
    Here,
    /// It has drawn the samples of this number.
    Seen { tick: u64 },
    /// Arm an axis.
    Arm { axis: u8 },
    /// Clear the trip of an axis.
    Clear { axis: u8 },
    /// Keep moving for as long as this is repeated.
    Jog { axis: u8, mode: Mode, value: f32 },
    /// Hold this until something else is asked.
    Set { axis: u8, mode: Mode, value: f32, speed_limit_rad_s: Option<f32> },
    /// Stop an axis, which disarms it.
    Rest { axis: u8 },
    /// What was said cannot be read: stop what is armed here, as that may have been meant.
    #[serde(skip)]
    Unreadable,
}

/// What a value sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// A fraction of the full signal.
    Signal,
    /// A.
    Current,
    /// rad/s.
    Velocity,
    /// rad.
    Position,
}

/// Whether a number can be sent at all.
fn finite(name: &str, value: f32) -> Result<f32, String> {
    if value.is_finite() { Ok(value) } else { Err(format!("{name} is a finite number")) }
}

impl Ask {
    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("not understood: {error}"))
    }

    /// What an axis shall do; nothing of what does not move.
    ///
    /// # Errors
    /// A number that is none, or a position without a speed limit.
    pub fn setpoint(&self) -> Result<Option<(u8, Setpoint)>, String> {
        let (axis, mode, value, limit) = match *self {
            Self::Jog { axis, mode: mode @ (Mode::Velocity | Mode::Signal), value } => {
                (axis, mode, value, None)
            }
            Self::Jog { .. } => return Err("a jog has velocity or signal".to_owned()),
            Self::Set { axis, mode, value, speed_limit_rad_s } => {
                (axis, mode, value, speed_limit_rad_s)
            }
            _ => return Ok(None),
        };
        let value = finite("value", value)?;
        let setpoint = match mode {
            Mode::Signal => Setpoint::Signal { fraction: value },
            Mode::Current => Setpoint::Current { current_a: value },
            Mode::Velocity => Setpoint::Velocity { velocity_rad_s: value },
            Mode::Position => {
                let limit = limit.ok_or("a position has a speed_limit_rad_s")?;
                let speed_limit_rad_s = finite("speed_limit_rad_s", limit)?;
                Setpoint::Position { position_rad: value, speed_limit_rad_s }
            }
        };
        Ok(Some((axis, setpoint)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_is_read() {
        let jog = Ask::read(r#"{"ask":"jog","axis":2,"mode":"velocity","value":-0.5}"#).unwrap();
        let setpoint = Setpoint::Velocity { velocity_rad_s: -0.5 };
        assert_eq!(jog.setpoint(), Ok(Some((2, setpoint))));
        assert_eq!(Ask::read(r#"{"ask":"stop"}"#), Ok(Ask::Stop));
        assert_eq!(Ask::Stop.setpoint(), Ok(None));
        let to = r#"{"ask":"set","axis":0,"mode":"position","value":1,"speed_limit_rad_s":2}"#;
        let setpoint = Setpoint::Position { position_rad: 1.0, speed_limit_rad_s: 2.0 };
        assert_eq!(Ask::read(to).unwrap().setpoint(), Ok(Some((0, setpoint))));
    }

    #[test]
    fn what_makes_no_sense_moves_nothing() {
        for text in [
            "",
            "stop",
            "{}",
            r#"{"ask":"fly"}"#,
            r#"{"ask":"arm","axis":300}"#,
            r#"{"ask":"arm","axis":0,"epoch":1}"#,
            r#"{"ask":"arm"}"#,
            r#"{"ask":"set","axis":0,"mode":"velocity","value":null}"#,
            r#"{"ask":"set","axis":0,"mode":"velocity","value":"1"}"#,
            r#"{"ask":"set","axis":0,"mode":"velocity","value":1e999}"#,
        ] {
            assert!(Ask::read(text).is_err(), "{text}");
        }
        for text in [
            r#"{"ask":"set","axis":0,"mode":"velocity","value":1e300}"#,
            r#"{"ask":"set","axis":0,"mode":"position","value":1}"#,
            r#"{"ask":"jog","axis":0,"mode":"position","value":1}"#,
        ] {
            assert!(Ask::read(text).unwrap().setpoint().is_err(), "{text}");
        }
    }
}
