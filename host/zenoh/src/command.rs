//! What a peer asks for: a word of the key and a JSON object. Pure.

use std::collections::BTreeSet;

use host_protocol::{ClearTarget, Setpoint, StopTarget};
use mgw_client::StopRequest;
use serde_json::{Map, Value, json};

use crate::keys::check_name;
use crate::refusal::Refusal;

/// Longest object, bytes.
const LONGEST: usize = 4_096;
/// What setpoints are called here, and where the host protocol is read by names.
const SETPOINTS: [&str; 5] = ["signal", "current", "velocity", "position", "impedance"];

/// Which command, as the key says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    Take,
    KeepAlive,
    Arm,
    Setpoint,
    Clear,
    Release,
    Stop,
    Estop,
}

impl Word {
    /// All there are.
    pub const ALL: [Self; 8] = [
        Self::Take,
        Self::KeepAlive,
        Self::Arm,
        Self::Setpoint,
        Self::Clear,
        Self::Release,
        Self::Stop,
        Self::Estop,
    ];

    /// As it stands in a key.
    pub fn text(self) -> &'static str {
        match self {
            Self::Take => "take",
            Self::KeepAlive => "keep_alive",
            Self::Arm => "arm",
            Self::Setpoint => "setpoint",
            Self::Clear => "clear",
            Self::Release => "release",
            Self::Stop => "stop",
            Self::Estop => "estop",
        }
    }

    /// The word of a key.
    pub fn read(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|word| word.text() == text)
    }

    /// Whether it is for everybody, and may be asked of many gateways at once.
    pub fn stops(self) -> bool {
        matches!(self, Self::Stop | Self::Estop)
    }
}

/// By which a peer in command is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lease(pub u64);

impl Lease {
    /// As text: JSON's numbers are too short.
    pub fn text(self) -> String {
        format!("{:016x}", self.0)
    }

    fn read(text: &str) -> Option<Self> {
        let is_whole = text.len() == 16 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let number = u64::from_str_radix(text, 16).ok()?;
        is_whole.then_some(Self(number))
    }
}

/// A command with all that belongs to it.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Take command.
    Take { peer: String },
    /// The peer is still there.
    KeepAlive { lease: Lease },
    /// Something that only the peer in command may ask.
    Do { lease: Lease, deed: Deed },
    /// Stop.
    Stop(StopRequest),
}

/// What only the peer in command may ask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Deed {
    /// Arm an axis.
    Arm { axis: u8 },
    /// What an armed axis shall do until the gateway's time has come so far.
    Set { axis: u8, epoch: u32, expires_at_us: u64, setpoint: Setpoint },
    /// Clear a trip or the e-stop.
    Clear(ClearTarget),
    /// Stop what is armed here, and give command back.
    Release,
}

impl Command {
    /// Reads what stands behind a word.
    ///
    /// # Errors
    /// What is wrong with it, and what is allowed.
    pub fn read(word: Word, payload: &[u8]) -> Result<Self, Refusal> {
        let mut fields = Fields::read(word, payload)?;
        let command = match word {
            Word::Take => Self::Take { peer: fields.peer()? },
            Word::KeepAlive => Self::KeepAlive { lease: fields.lease()? },
            Word::Arm => Self::Do {
                lease: fields.lease()?,
                deed: Deed::Arm { axis: fields.number("axis", u8::MAX.into())? },
            },
            Word::Setpoint => {
                let lease = fields.lease()?;
                let axis = fields.number("axis", u8::MAX.into())?;
                let epoch = fields.number("epoch", u32::MAX.into())?;
                let expires_at_us = fields.number("expires_at_us", u64::MAX)?;
                let setpoint = fields.setpoint()?;
                Self::Do { lease, deed: Deed::Set { axis, epoch, expires_at_us, setpoint } }
            }
            Word::Clear => {
                let lease = fields.lease()?;
                let target = match fields.optional_axis()? {
                    Some(axis) => ClearTarget::Axis(axis),
                    None => ClearTarget::Gateway,
                };
                Self::Do { lease, deed: Deed::Clear(target) }
            }
            Word::Release => Self::Do { lease: fields.lease()?, deed: Deed::Release },
            Word::Stop => {
                let axis = fields.optional_axis()?;
                Self::Stop(StopRequest::Stop(axis.map_or(StopTarget::All, StopTarget::Axis)))
            }
            Word::Estop => Self::Stop(StopRequest::EStop),
        };
        fields.end()?;
        Ok(command)
    }
}

/// The fields of an object, each taken once.
struct Fields {
    word: Word,
    left: Map<String, Value>,
    taken: BTreeSet<&'static str>,
}

impl Fields {
    fn read(word: Word, payload: &[u8]) -> Result<Self, Refusal> {
        let wrong = |why: String| Refusal::Unreadable(format!("`{}`: {why}", word.text()));
        if payload.len() > LONGEST {
            return Err(wrong(format!("{} bytes; {LONGEST} are allowed", payload.len())));
        }
        let left = match payload {
            [] => Map::new(),
            payload => match serde_json::from_slice(payload) {
                Ok(Value::Object(fields)) => fields,
                Ok(_) => return Err(wrong("no JSON object, such as {\"axis\":0}".to_owned())),
                Err(error) => return Err(wrong(format!("not JSON: {error}"))),
            },
        };
        Ok(Self { word, left, taken: BTreeSet::new() })
    }

    fn wrong(&self, why: impl AsRef<str>) -> Refusal {
        Refusal::Unreadable(format!("`{}`: {}", self.word.text(), why.as_ref()))
    }

    fn take(&mut self, name: &'static str) -> Option<Value> {
        self.taken.insert(name);
        self.left.remove(name)
    }

    fn text(&mut self, name: &'static str, what: &str) -> Result<String, Refusal> {
        match self.take(name) {
            Some(Value::String(text)) => Ok(text),
            Some(other) => Err(self.wrong(format!("`{name}` is {what}, not {other}"))),
            None => Err(self.wrong(format!("`{name}` is missing: {what}"))),
        }
    }

    fn peer(&mut self) -> Result<String, Refusal> {
        let peer = self.text("peer", "the name of the peer that asks")?;
        check_name(&peer).map_err(|why| self.wrong(why))
    }

    fn lease(&mut self) -> Result<Lease, Refusal> {
        const WHAT: &str = "the 16 digits that `take` has answered";
        let text = self.text("lease", WHAT)?;
        Lease::read(&text).ok_or_else(|| self.wrong(format!("`lease` is {WHAT}")))
    }

    fn number<T: TryFrom<u64>>(&mut self, name: &'static str, max: u64) -> Result<T, Refusal> {
        let what = format!("a whole number from 0 to {max}");
        let value = self.take(name);
        let Some(value) = value else {
            return Err(self.wrong(format!("`{name}` is missing: {what}")));
        };
        let number = value.as_u64().and_then(|number| T::try_from(number).ok());
        number.ok_or_else(|| self.wrong(format!("`{name}` is {what}, not {value}")))
    }

    fn optional_axis(&mut self) -> Result<Option<u8>, Refusal> {
        match self.left.contains_key("axis") {
            true => self.number("axis", u8::MAX.into()).map(Some),
            false => {
                self.taken.insert("axis");
                Ok(None)
            }
        }
    }

    /// The setpoint of this name, and all fields that are left: what it has is said in one place,
    /// the host protocol.
    fn setpoint(&mut self) -> Result<Setpoint, Refusal> {
        let names = SETPOINTS.join(", ");
        let name = self.text("setpoint", &format!("one of {names}"))?;
        if !SETPOINTS.contains(&name.as_str()) {
            return Err(self.wrong(format!("`setpoint` is one of {names}, not `{name}`")));
        }
        let given = std::mem::take(&mut self.left);
        for (name, value) in &given {
            // What is too large for a number of the gateway would be infinite there.
            #[allow(clippy::cast_possible_truncation)]
            let is_finite = value.as_f64().is_some_and(|value| (value as f32).is_finite());
            if !is_finite {
                let why = format!("`{name}` is a finite number of single precision, not {value}");
                return Err(self.wrong(why));
            }
        }
        let read = serde_json::from_value(json!({ &name: given }));
        let setpoint: Setpoint =
            read.map_err(|error| self.wrong(format!("setpoint `{name}`: {error}")))?;
        let whole = serde_json::to_value(setpoint).unwrap_or_default();
        if let Some(fields) = whole[&name].as_object()
            && let Some(unknown) = given.keys().find(|name| !fields.contains_key(*name))
        {
            let known: Vec<&str> = fields.keys().map(String::as_str).collect();
            let known = known.join(", ");
            let why = format!("setpoint `{name}` has no `{unknown}`; there are: {known}");
            return Err(self.wrong(why));
        }
        Ok(setpoint)
    }

    /// Nothing may be left: a word that is spelled wrong is better refused.
    fn end(self) -> Result<(), Refusal> {
        let Some(unknown) = self.left.keys().next() else { return Ok(()) };
        let known: Vec<&str> = self.taken.iter().copied().collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Err(self.wrong(format!("there is no `{unknown}`; there are: {known}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEASE: &str = "00000000000000ab";

    fn read(word: Word, text: &str) -> Result<Command, Refusal> {
        Command::read(word, text.replace("LEASE", LEASE).as_bytes())
    }

    #[test]
    fn what_is_asked_is_read() {
        let lease = Lease(0xAB);
        assert_eq!(lease.text(), LEASE);
        assert_eq!(
            read(Word::Take, r#"{"peer":"op"}"#),
            Ok(Command::Take { peer: "op".to_owned() })
        );
        assert_eq!(read(Word::KeepAlive, r#"{"lease":"LEASE"}"#), Ok(Command::KeepAlive { lease }));
        assert_eq!(
            read(Word::Arm, r#"{"lease":"LEASE","axis":2}"#),
            Ok(Command::Do { lease, deed: Deed::Arm { axis: 2 } })
        );
        let text = r#"{"lease":"LEASE","axis":1,"epoch":7,"expires_at_us":5000000000,
            "setpoint":"position","position_rad":1,"speed_limit_rad_s":2.5}"#;
        let setpoint = Setpoint::Position { position_rad: 1.0, speed_limit_rad_s: 2.5 };
        let deed = Deed::Set { axis: 1, epoch: 7, expires_at_us: 5_000_000_000, setpoint };
        assert_eq!(read(Word::Setpoint, text), Ok(Command::Do { lease, deed }));
        let clear = |target| Ok(Command::Do { lease, deed: Deed::Clear(target) });
        assert_eq!(read(Word::Clear, r#"{"lease":"LEASE"}"#), clear(ClearTarget::Gateway));
        let text = r#"{"lease":"LEASE","axis":3}"#;
        assert_eq!(read(Word::Clear, text), clear(ClearTarget::Axis(3)));
    }

    #[test]
    fn a_stop_needs_nothing() {
        let stop = |target| Ok(Command::Stop(StopRequest::Stop(target)));
        assert_eq!(read(Word::Stop, ""), stop(StopTarget::All));
        assert_eq!(read(Word::Stop, "{}"), stop(StopTarget::All));
        assert_eq!(read(Word::Stop, r#"{"axis":0}"#), stop(StopTarget::Axis(0)));
        assert_eq!(read(Word::Estop, ""), Ok(Command::Stop(StopRequest::EStop)));
    }

    #[test]
    fn every_setpoint_of_the_protocol_can_be_said() {
        let zero = 0.0;
        for setpoint in [
            Setpoint::Signal { fraction: zero },
            Setpoint::Current { current_a: zero },
            Setpoint::Velocity { velocity_rad_s: zero },
            Setpoint::Position { position_rad: zero, speed_limit_rad_s: zero },
            Setpoint::Impedance {
                position_rad: zero,
                velocity_rad_s: zero,
                stiffness_nm_per_rad: zero,
                damping_nm_s_per_rad: zero,
                torque_nm: zero,
            },
        ] {
            let wire = serde_json::to_value(setpoint).unwrap();
            let (name, fields) = wire.as_object().unwrap().iter().next().unwrap();
            assert!(SETPOINTS.contains(&name.as_str()), "{name}");
            let mut asked = json!({ "lease": LEASE, "axis": 0, "epoch": 1, "expires_at_us": 1 });
            asked["setpoint"] = json!(name);
            asked.as_object_mut().unwrap().extend(fields.as_object().unwrap().clone());
            let read = Command::read(Word::Setpoint, asked.to_string().as_bytes()).unwrap();
            assert!(
                matches!(read, Command::Do { deed: Deed::Set { setpoint: it, .. }, .. } if it == setpoint),
                "{name}"
            );
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused_with_what_is_allowed() {
        let velocity = |value: &str| {
            format!(
                r#"{{"lease":"LEASE","axis":0,"epoch":1,"expires_at_us":9,"setpoint":"velocity",{value}}}"#
            )
        };
        for (word, text, said) in [
            (Word::Arm, "", "`lease` is missing"),
            (Word::Arm, "arm", "not JSON"),
            (Word::Arm, "[]", "no JSON object"),
            (Word::Arm, "{\"lease\"", "not JSON"),
            (Word::Arm, "\u{0}\u{1}", "not JSON"),
            (Word::Arm, r#"{"lease":7,"axis":0}"#, "16 digits"),
            (Word::Arm, r#"{"lease":"+0000000000000ab","axis":0}"#, "16 digits"),
            (Word::Arm, r#"{"lease":"LEASE"}"#, "`axis` is missing"),
            (Word::Arm, r#"{"lease":"LEASE","axis":300}"#, "from 0 to 255, not 300"),
            (Word::Arm, r#"{"lease":"LEASE","axis":-1}"#, "from 0 to 255, not -1"),
            (Word::Arm, r#"{"lease":"LEASE","axis":"0"}"#, "from 0 to 255, not \"0\""),
            (Word::Arm, r#"{"lease":"LEASE","axis":0.5}"#, "from 0 to 255, not 0.5"),
            (Word::Arm, r#"{"lease":"LEASE","axis":0,"axes":[1]}"#, "there is no `axes`"),
            (Word::Take, r#"{"peer":"a b"}"#, "1 to 16 letters"),
            (Word::Take, r#"{"peer":null}"#, "name of the peer"),
            (Word::Stop, r#"{"axes":0}"#, "there is no `axes`; there are: axis"),
            (Word::Stop, r#"{"axis":null}"#, "from 0 to 255"),
            (Word::Estop, r#"{"axis":0}"#, "there are: none"),
            (Word::Setpoint, &velocity(r#""velocity_rad_s":NaN"#), "not JSON"),
            (Word::Setpoint, &velocity(r#""velocity_rad_s":1e999"#), "not JSON"),
            (Word::Setpoint, &velocity(r#""velocity_rad_s":1e300"#), "finite number"),
            (Word::Setpoint, &velocity(r#""velocity_rad_s":null"#), "finite number"),
            (Word::Setpoint, &velocity(r#""velocity_rad_s":"1""#), "finite number"),
            (Word::Setpoint, &velocity(r#""speed":1"#), "missing field `velocity_rad_s`"),
            (
                Word::Setpoint,
                &velocity(r#""velocity_rad_s":1,"speed_limit_rad_s":1"#),
                "has no `speed_limit_rad_s`; there are: velocity_rad_s",
            ),
            (
                Word::Setpoint,
                r#"{"lease":"LEASE","axis":0,"epoch":1,"expires_at_us":9,"setpoint":"Velocity"}"#,
                "one of signal, current, velocity, position, impedance",
            ),
            (
                Word::Setpoint,
                r#"{"lease":"LEASE","axis":0,"epoch":4294967296,"expires_at_us":9}"#,
                "from 0 to 4294967295",
            ),
        ] {
            let refused = read(word, text);
            let text = refused.clone().map_err(|refusal| refusal.to_string());
            assert!(text.clone().is_err_and(|text| text.contains(said)), "{said}: {text:?}");
        }
        let long = format!("{{\"peer\":\"{}\"}}", "a".repeat(LONGEST));
        assert!(read(Word::Take, &long).is_err());
    }
}
