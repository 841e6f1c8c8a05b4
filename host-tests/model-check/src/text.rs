//! A run as a text file: a line for each step, `#` begins a comment.
//!
//! ```text
//! start 4293967296
//! 240 host 0 bus 1 window 2000
//! 3180 host 0 configure 6 bus = 1
//! 74928 host 0 setpoint 6 epoch 0 lead 48000 velocity 0.5
//! 94138 motor 3 mute 5000
//! ```

use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};
use host_protocol::parameters;
use std::fmt::Write;

/// The text of a run.
#[must_use]
pub fn write(start_us: u64, steps: &[Step]) -> String {
    let mut text = format!("start {start_us}\n");
    for step in steps {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{} {}", step.at_us, action(&step.action));
    }
    text
}

fn hex(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "none".into();
    }
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn action(action: &Action) -> String {
    match action {
        Action::Ask { link, ask } => format!("host {link} {}", asks(ask)),
        Action::Again { link, back } => format!("again {link} {back}"),
        Action::Bytes { link, bytes } => format!("bytes {link} {}", hex(bytes)),
        Action::Unread { link, for_us } => format!("unread {link} {for_us}"),
        Action::EStopInput { open } => format!("e-stop-input {}", if *open { "open" } else { "closed" }),
        Action::Motor { motor, does } => format!("motor {motor} {}", deed(does)),
        Action::Cut { bus, for_us } => format!("cut {bus} {for_us}"),
        Action::Short { bus, for_us } => format!("short {bus} {for_us}"),
        Action::Foreign { bus, id, pause_us, for_us } => format!("foreign {bus} {id} {pause_us} {for_us}"),
        Action::Stray { bus, id, data } => format!("stray {bus} {id} {}", hex(data)),
        Action::Noise { bus, bytes } => format!("noise {bus} {}", hex(bytes)),
        Action::Stubborn { bus, for_us } => format!("stubborn {bus} {for_us}"),
        Action::Overflow { bus } => format!("overflow {bus}"),
    }
}

fn deed(does: &Does) -> String {
    match does {
        Does::Mute { for_us } => format!("mute {for_us}"),
        Does::Deaf { for_us } => format!("deaf {for_us}"),
        Does::Late { by_us } => format!("late {by_us}"),
        Does::Twice => "twice".into(),
        Does::Lies { data } => format!("lies {}", hex(data)),
        Does::Refuses => "refuses".into(),
        Does::Faults { word } => format!("faults {word}"),
        Does::Restarts => "restarts".into(),
        Does::Disobeys { for_us } => format!("disobeys {for_us}"),
        Does::Turns { speed } => format!("turns {speed:?}"),
    }
}

fn permits(Permit { axis, epoch, lead_us }: &Permit) -> String {
    format!("{axis} epoch {epoch} lead {lead_us}")
}

fn asks(ask: &Ask) -> String {
    match ask {
        Ask::Hello => "hello".into(),
        Ask::Ping => "ping".into(),
        Ask::Take => "take".into(),
        Ask::Release => "release".into(),
        Ask::Silence { us } => format!("silence {us}"),
        Ask::Bus { bus, window_us } => format!("bus {bus} window {window_us}"),
        Ask::Set { axis, parameter, value } => {
            let value = match value {
                Number::Bool(value) => format!("bool {value}"),
                Number::Unsigned(value) => format!("unsigned {value}"),
                Number::Signed(value) => format!("signed {value}"),
                Number::Float(value) => format!("float {value:?}"),
            };
            let name = parameters::name(*parameter).unwrap_or("?");
            format!("configure {axis} {parameter} {value} # {name}")
        }
        Ask::Remove { axis } => format!("remove {axis}"),
        Ask::Provision { axis, timeout_ms } => format!("provision {axis} {timeout_ms}"),
        Ask::Arm { axis } => format!("arm {axis}"),
        Ask::Disarm { axis } => format!("disarm {axis}"),
        Ask::Stop { axis } => format!("stop {axis}"),
        Ask::StopAll => "stop-all".into(),
        Ask::EStop => "e-stop".into(),
        Ask::ClearGateway => "clear-gateway".into(),
        Ask::Clear { axis } => format!("clear {axis}"),
        Ask::ClearUnreachable { axis } => format!("clear-unreachable {axis}"),
        Ask::Setpoint { permit, goal } => {
            let goal = match goal {
                Goal::Signal(value) => format!("signal {value:?}"),
                Goal::Current(value) => format!("current {value:?}"),
                Goal::Velocity(value) => format!("velocity {value:?}"),
                Goal::Position(value, speed) => format!("position {value:?} {speed:?}"),
                Goal::Impedance(value) => format!("impedance {value:?}"),
            };
            format!("setpoint {} {goal}", permits(permit))
        }
        Ask::Move { permit, distance, speed } => format!("move {} {distance:?} {speed:?}", permits(permit)),
        Ask::Native { permit, data } => format!("native {} {}", permits(permit), hex(data)),
        Ask::Read { axis } => format!("read {axis}"),
        Ask::Subscribe { axes, period_us } => format!("subscribe {axes} {period_us}"),
        Ask::Status => "status".into(),
        Ask::RawOpen { bus } => format!("raw-open {bus}"),
        Ask::RawSend { bus, id, data } => format!("raw-send {bus} {id} {}", hex(data)),
        Ask::RawReceive { bus } => format!("raw-receive {bus}"),
        Ask::RawClose { bus } => format!("raw-close {bus}"),
    }
}

/// Reads the text of a run: when the clock starts, and the steps.
///
/// # Errors
/// The line that is none.
pub fn read(text: &str) -> Result<(u64, Vec<Step>), String> {
    let (mut start_us, mut steps) = (1_000, Vec::new());
    for line in text.lines() {
        let content = line.split('#').next().unwrap_or_default();
        let mut words = Words(content.split_whitespace());
        let Some(first) = words.0.next() else { continue };
        let read = if first == "start" {
            words.number().map(|number| start_us = number)
        } else {
            first.parse().ok().and_then(|at_us| {
                steps.push(Step { at_us, action: words.action()? });
                Some(())
            })
        };
        if read.is_none() || words.0.next().is_some() {
            return Err(format!("not understood: {line}"));
        }
    }
    Ok((start_us, steps))
}

/// The words of a line that are left.
struct Words<'a>(std::str::SplitWhitespace<'a>);

impl Words<'_> {
    fn number<T: std::str::FromStr>(&mut self) -> Option<T> {
        self.0.next()?.parse().ok()
    }

    fn after<T: std::str::FromStr>(&mut self, word: &str) -> Option<T> {
        (self.0.next()? == word).then(|| self.number())?
    }

    fn hex(&mut self) -> Option<Vec<u8>> {
        let word = self.0.next()?;
        if word == "none" {
            return Some(Vec::new());
        }
        let pairs = word.as_bytes().chunks(2);
        pairs.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()).collect()
    }

    fn action(&mut self) -> Option<Action> {
        Some(match self.0.next()? {
            "host" => Action::Ask { link: self.number()?, ask: self.ask()? },
            "again" => Action::Again { link: self.number()?, back: self.number()? },
            "bytes" => Action::Bytes { link: self.number()?, bytes: self.hex()? },
            "unread" => Action::Unread { link: self.number()?, for_us: self.number()? },
            "e-stop-input" => Action::EStopInput { open: self.0.next()? == "open" },
            "motor" => Action::Motor { motor: self.number()?, does: self.deed()? },
            "cut" => Action::Cut { bus: self.number()?, for_us: self.number()? },
            "short" => Action::Short { bus: self.number()?, for_us: self.number()? },
            "foreign" => Action::Foreign {
                bus: self.number()?,
                id: self.number()?,
                pause_us: self.number()?,
                for_us: self.number()?,
            },
            "stray" => Action::Stray { bus: self.number()?, id: self.number()?, data: self.hex()? },
            "noise" => Action::Noise { bus: self.number()?, bytes: self.hex()? },
            "stubborn" => Action::Stubborn { bus: self.number()?, for_us: self.number()? },
            "overflow" => Action::Overflow { bus: self.number()? },
            _ => return None,
        })
    }

    fn deed(&mut self) -> Option<Does> {
        Some(match self.0.next()? {
            "mute" => Does::Mute { for_us: self.number()? },
            "deaf" => Does::Deaf { for_us: self.number()? },
            "late" => Does::Late { by_us: self.number()? },
            "twice" => Does::Twice,
            "lies" => Does::Lies { data: self.hex()? },
            "refuses" => Does::Refuses,
            "faults" => Does::Faults { word: self.number()? },
            "restarts" => Does::Restarts,
            "disobeys" => Does::Disobeys { for_us: self.number()? },
            "turns" => Does::Turns { speed: self.number()? },
            _ => return None,
        })
    }

    fn permit(&mut self) -> Option<Permit> {
        Some(Permit { axis: self.number()?, epoch: self.after("epoch")?, lead_us: self.after("lead")? })
    }

    fn ask(&mut self) -> Option<Ask> {
        Some(match self.0.next()? {
            "hello" => Ask::Hello,
            "ping" => Ask::Ping,
            "take" => Ask::Take,
            "release" => Ask::Release,
            "silence" => Ask::Silence { us: self.number()? },
            "bus" => Ask::Bus { bus: self.number()?, window_us: self.after("window")? },
            "configure" => {
                let (axis, parameter) = (self.number()?, self.number()?);
                let value = match self.0.next()? {
                    "bool" => Number::Bool(self.number()?),
                    "unsigned" => Number::Unsigned(self.number()?),
                    "signed" => Number::Signed(self.number()?),
                    "float" => Number::Float(self.number()?),
                    _ => return None,
                };
                Ask::Set { axis, parameter, value }
            }
            "remove" => Ask::Remove { axis: self.number()? },
            "provision" => Ask::Provision { axis: self.number()?, timeout_ms: self.number()? },
            "arm" => Ask::Arm { axis: self.number()? },
            "disarm" => Ask::Disarm { axis: self.number()? },
            "stop" => Ask::Stop { axis: self.number()? },
            "stop-all" => Ask::StopAll,
            "e-stop" => Ask::EStop,
            "clear-gateway" => Ask::ClearGateway,
            "clear" => Ask::Clear { axis: self.number()? },
            "clear-unreachable" => Ask::ClearUnreachable { axis: self.number()? },
            "setpoint" => {
                let permit = self.permit()?;
                let goal = match self.0.next()? {
                    "signal" => Goal::Signal(self.number()?),
                    "current" => Goal::Current(self.number()?),
                    "velocity" => Goal::Velocity(self.number()?),
                    "position" => Goal::Position(self.number()?, self.number()?),
                    "impedance" => Goal::Impedance(self.number()?),
                    _ => return None,
                };
                Ask::Setpoint { permit, goal }
            }
            "move" => Ask::Move { permit: self.permit()?, distance: self.number()?, speed: self.number()? },
            "native" => Ask::Native { permit: self.permit()?, data: self.hex()? },
            "read" => Ask::Read { axis: self.number()? },
            "subscribe" => Ask::Subscribe { axes: self.number()?, period_us: self.number()? },
            "status" => Ask::Status,
            "raw-open" => Ask::RawOpen { bus: self.number()? },
            "raw-send" => Ask::RawSend { bus: self.number()?, id: self.number()?, data: self.hex()? },
            "raw-receive" => Ask::RawReceive { bus: self.number()? },
            "raw-close" => Ask::RawClose { bus: self.number()? },
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{World, generate::Generator};

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
        assert_eq!(read("5 host 0 dance").unwrap_err(), "not understood: 5 host 0 dance");
        assert_eq!(read("5 cut 0 10 20").unwrap_err(), "not understood: 5 cut 0 10 20");
    }
}
