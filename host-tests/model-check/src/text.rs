//! A run as a text file: when its clock starts, and for each step a line with its time and what
//! happens in RON. `#` begins a comment.
//!
//! ```text
//! start 4293967296
//! 240 Ask(link:0,ask:Bus(bus:1,window_us:2000,protocols:4,exclusive:false))
//! 74928 Ask(link:0,ask:Setpoint(permit:(axis:6,epoch:0,lead_us:48000),goal:Velocity(0.5)))
//! 94138 Motor(motor:3,does:Mute(for_us:5000))
//! ```

use crate::action::{Action, Ask, Step};
use host_protocol::parameters;
use std::fmt::Write;

/// The text of a run.
///
/// # Panics
/// Never: every action can be written.
#[must_use]
pub fn write(start_us: u64, steps: &[Step]) -> String {
    let mut text = format!("start {start_us}\n");
    for Step { at_us, action } in steps {
        let written = ron::to_string(action).expect("what derives Serialize can be written");
        // Writing to a string does not fail.
        let _ = write!(text, "{at_us} {written}");
        if let Action::Ask { ask, .. } | Action::Watch { ask, .. } = action
            && let Ask::Set { parameter, .. } | Ask::Change { parameter, .. } = ask
        {
            text += &format!(" # {}", parameters::name(*parameter).unwrap_or("?"));
        }
        text.push('\n');
    }
    text
}

/// Reads the text of a run: when the clock starts, and the steps.
///
/// # Errors
/// The line that is none.
pub fn read(text: &str) -> Result<(u64, Vec<Step>), String> {
    let (mut start_us, mut steps) = (1_000, Vec::new());
    for line in text.lines() {
        let content = line.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        let step = content.split_once(' ').and_then(|(first, rest)| match first {
            "start" => rest.parse().ok().map(|number| start_us = number),
            _ => {
                let (at_us, action) = (first.parse().ok()?, ron::from_str(rest).ok()?);
                steps.push(Step { at_us, action });
                Some(())
            }
        });
        step.ok_or_else(|| format!("not understood: {line}"))?;
    }
    Ok((start_us, steps))
}

/// Bytes as a string of hexadecimal digits.
pub(crate) mod hex {
    use serde::de::{Deserialize, Deserializer, Error};
    use serde::ser::Serializer;

    pub fn serialize<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>())
    }

    pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Vec<u8>, D::Error> {
        let text = String::deserialize(from)?;
        let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
        let bytes: Option<_> = text.as_bytes().chunks(2).map(byte).collect();
        bytes.ok_or_else(|| D::Error::custom("no hexadecimal digits"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Step, World, generate::Generator};

    #[test]
    fn what_is_written_is_read_again() {
        let (mut world, mut generator) = (World::new(1_000), Generator::new(7));
        let steps: Vec<Step> = (0..3_000)
            .map(|_| {
                let step = generator.next(&world);
                world.step(&step);
                step
            })
            .collect();
        let text = write(1_000, &steps);
        let (start_us, read) = read(&text).unwrap();
        assert_eq!(start_us, 1_000);
        // NaN is not equal to itself; as text it is.
        assert_eq!(write(1_000, &read), text);
    }

    #[test]
    fn a_line_that_is_none_is_told() {
        for line in
            ["5 Dance", "Reset", "5 Reset Reset", "5 Cut(bus:0)", "5 Noise(bus:2,bytes:\"X\")"]
        {
            assert_eq!(read(line).unwrap_err(), format!("not understood: {line}"));
        }
    }
}
