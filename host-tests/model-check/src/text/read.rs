//! Lines as steps.

use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};

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
                length: self.after("length")?,
                pause_us: self.after("pause")?,
                for_us: self.after("for")?,
            },
            "stray" => Action::Stray { bus: self.number()?, id: self.number()?, data: self.hex()? },
            "noise" => Action::Noise { bus: self.number()?, bytes: self.hex()? },
            "stubborn" => Action::Stubborn { bus: self.number()?, for_us: self.number()? },
            "stray-slot" => Action::StraySlot { bus: self.number()?, slot: self.number()? },
            "clock-back" => Action::ClockBack { by_us: self.number()? },
            "errors" => Action::Errors {
                bus: self.number()?,
                transmit: self.number()?,
                receive: self.number()?,
            },
            "overflow" => Action::Overflow { bus: self.number()? },
            "reset" => Action::Reset,
            "damaging-reset" => Action::DamagingReset { words: self.number()? },
            "reset-while-saving" => Action::ResetWhileSaving {
                words: self.number()?,
                garbles: self.0.next()? == "garbled",
            },
            "reset-after" => Action::ResetAfter { steps: self.number()? },
            "power-loss" => Action::PowerLoss,
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
            "off" => Does::Off { for_us: self.number()? },
            "disobeys" => Does::Disobeys { for_us: self.number()? },
            "answers-others" => Does::AnswersOthers { on: self.number()? },
            "waits" => Does::Waits { speed: self.number()? },
            "returns" => Does::Returns { mode: self.number()? },
            "turns" => Does::Turns { speed: self.number()?, for_us: self.number()? },
            _ => return None,
        })
    }

    fn permit(&mut self) -> Option<Permit> {
        Some(Permit {
            axis: self.number()?,
            epoch: self.after("epoch")?,
            lead_us: self.after("lead")?,
        })
    }

    fn ask(&mut self) -> Option<Ask> {
        Some(match self.0.next()? {
            "hello" => Ask::Hello,
            "ping" => Ask::Ping,
            "take" => Ask::Take,
            "release" => Ask::Release,
            "silence" => Ask::Silence { us: self.number()? },
            "bus" => Ask::Bus {
                bus: self.number()?,
                window_us: self.after("window")?,
                protocols: self.after("protocols")?,
                exclusive: self.0.next() == Some("exclusive"),
            },
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
            "clear-by-restart" => Ask::ClearByRestart { axis: self.number()? },
            "clear-unreachable" => Ask::ClearUnreachable { axis: self.number()? },
            "output-off" => Ask::OutputOff { axis: self.number()? },
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
            "move" => Ask::Move {
                permit: self.permit()?,
                distance: self.number()?,
                speed: self.number()?,
            },
            "native" => Ask::Native { permit: self.permit()?, data: self.hex()? },
            "together" => {
                let (lead_us, mut members) = (self.number()?, Vec::new());
                while let Some(axis) = self.0.next() {
                    members.push((axis.parse().ok()?, self.number()?, self.number()?));
                }
                Ask::Together { lead_us, members }
            }
            "read" => Ask::Read { axis: self.number()? },
            "subscribe" => Ask::Subscribe { axes: self.number()?, period_us: self.number()? },
            "status" => Ask::Status,
            "list" => Ask::List,
            "bus-status" => Ask::BusStatus { bus: self.number()? },
            "incidents" => Ask::Incidents { first: self.number()? },
            "raw-open" => {
                let (bus, access) = (self.number()?, self.0.next());
                Ask::RawOpen { bus, unsafe_access: access == Some("unsafe") }
            }
            "raw-send" => {
                Ask::RawSend { bus: self.number()?, id: self.number()?, data: self.hex()? }
            }
            "raw-receive" => Ask::RawReceive { bus: self.number()? },
            "raw-close" => Ask::RawClose { bus: self.number()? },
            _ => return None,
        })
    }
}
