//! Settings that are written: all that is wrong with them at once, and read back afterwards.

use ::rmd::{DegreesPerSecondSquared, EncoderPulses, GainValue, PidGains, Ramp, Request};
use d5::Register;
use host_protocol::{AxisParameter, Value};
use thruster::LimitDecidegrees;

use super::settings::{DECI, Group, Key, Kind, Number, OLD_GAINS, Values, keys_of, read};
use super::{Motor, Run, failed, motor_error};
use crate::failure::Failure;
use crate::parameters;

/// The levels at which a D5 answers reads: at any other no scan would find it.
const ACK_LEVELS: [i64; 2] = [1, 2];

/// What is to be written, each a command of the manual.
struct Writes {
    commands: Vec<Vec<u8>>,
    /// They act after a restart.
    restarts: bool,
    /// What is wrong with what was asked for.
    wrong: Vec<String>,
}

/// The commands that give the motor these values; all that is wrong with them at once.
fn writes(motor: &Motor, before: &Values, wanted: &[(Key, Number)], to_rom: bool) -> Writes {
    let mut writes = Writes { commands: Vec::new(), restarts: false, wrong: Vec::new() };
    let after = |name: &str| {
        let new = wanted.iter().find(|(key, _)| key.name == name).map(|(_, value)| *value);
        new.or_else(|| before.get(name).copied())
    };
    let (mut gains_done, mut limits_done) = (false, false);
    for (key, value) in wanted {
        let command = match key.kind {
            Kind::OldGain(_) if gains_done => continue,
            Kind::OldGain(_) => {
                gains_done = true;
                old_gains(motor, &after, to_rom)
            }
            Kind::Gain(gain) => {
                let gain = GainValue::new(gain, value.real());
                motor.rmd(&match to_rom {
                    true => Request::WriteGainRom { gain },
                    false => Request::WriteGainRam { gain },
                })
            }
            Kind::OldRamp => ramp(motor, Ramp::POSITION_ACCELERATION, *value),
            Kind::Ramp(index) | Kind::BlindRamp(index) => ramp(motor, index, *value),
            Kind::Offset => {
                writes.restarts = true;
                let offset = whole(*value, i32::MIN.into(), i32::MAX.into());
                offset.and_then(|offset| {
                    let offset = EncoderPulses(i32::try_from(offset).unwrap_or(i32::MAX));
                    motor.rmd(&Request::WriteEncoderOffset { offset })
                })
            }
            Kind::Reverse | Kind::Forward if limits_done => continue,
            Kind::Reverse | Kind::Forward => {
                limits_done = true;
                limits(motor, &after)
            }
            Kind::Register(info)
                if info.register == Register::ACK_LEVEL
                    && !ACK_LEVELS.iter().any(|level| *value == Number::Integer(*level)) =>
            {
                Err(Failure::Usage(
                    "takes 1 or 2: at any other no scan would find the motor".to_owned(),
                ))
            }
            Kind::Register(info) => whole(*value, i64::MIN, i64::MAX).and_then(|value| {
                let value = info.encode(value).map_err(motor_error)?;
                motor.d5(&d5::Request::Write { register: info.register, value })
            }),
        };
        match command {
            Ok(command) => writes.commands.push(command),
            Err(error) => writes.wrong.push(format!("{} = {value}: {error}", key.name)),
        }
    }
    writes
}

/// What is wrong with values, before the motor is asked what else it has.
pub fn check(motor: &Motor, wanted: &[(Key, Number)]) -> Vec<String> {
    let zeros = OLD_GAINS.map(|name| (name.to_owned(), Number::Integer(0)));
    writes(motor, &Values::from(zeros), wanted, true).wrong
}

fn whole(value: Number, min: i64, max: i64) -> Result<i64, Failure> {
    match value {
        Number::Integer(number) if (min..=max).contains(&number) => Ok(number),
        _ if min == i64::MIN => Err(Failure::Usage("takes a whole number".to_owned())),
        _ => Err(Failure::Usage(format!("takes a whole number, {min} to {max}"))),
    }
}

fn ramp(motor: &Motor, ramp: Ramp, value: Number) -> Result<Vec<u8>, Failure> {
    let dps2 = whole(value, 0, u32::MAX.into())?;
    let acceleration = DegreesPerSecondSquared(u32::try_from(dps2).unwrap_or(u32::MAX));
    motor.rmd(&Request::WriteAcceleration { ramp, acceleration })
}

fn old_gains(
    motor: &Motor,
    after: &impl Fn(&str) -> Option<Number>,
    to_rom: bool,
) -> Result<Vec<u8>, Failure> {
    let mut all = [0; 6];
    for (place, name) in all.iter_mut().zip(OLD_GAINS) {
        let value = after(name).ok_or_else(|| {
            failed("NotConfirmed", format!("the motor did not tell {name}, which goes along"))
        })?;
        let gain = whole(value, 0, u8::MAX.into());
        let gain = gain.map_err(|error| Failure::Usage(format!("{name} {error}")))?;
        *place = u8::try_from(gain).unwrap_or(u8::MAX);
    }
    let [current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki] = all;
    let gains = PidGains { current_kp, current_ki, speed_kp, speed_ki, position_kp, position_ki };
    motor.rmd(&match to_rom {
        true => Request::WritePidRom { gains },
        false => Request::WritePidRam { gains },
    })
}

fn limits(motor: &Motor, after: &impl Fn(&str) -> Option<Number>) -> Result<Vec<u8>, Failure> {
    let limit = |name: &str| -> Result<LimitDecidegrees, Failure> {
        let degrees = after(name).map(Number::real).unwrap_or_default();
        let deci = (degrees * DECI).round();
        if !(f32::from(i16::MIN)..=f32::from(i16::MAX)).contains(&deci) {
            return Err(Failure::Usage("takes -3276.8 to 3276.7".to_owned()));
        }
        #[allow(clippy::cast_possible_truncation, reason = "checked above")]
        Ok(LimitDecidegrees(deci as i16))
    };
    let (reverse, forward) = (limit("reverse_limit_deg")?, limit("forward_limit_deg")?);
    motor.thruster(&thruster::Request::SetPositionLimits { reverse, forward })
}

/// Reads `NAME=VALUE`, all that is wrong with them at once.
pub fn parse(motor: &Motor, keys: &[Key], texts: &[String]) -> Result<Vec<(Key, Number)>, Failure> {
    let (mut wanted, mut wrong) = (Vec::new(), Vec::new());
    for text in texts {
        let (name, value) = parameters::split(text)?;
        let key = keys.iter().find(|key| key.name == name);
        let number =
            value.parse().map(Number::Integer).or_else(|_| value.parse().map(Number::Real)).ok();
        match (key, number) {
            (Some(key), _) if wanted.iter().any(|(other, _): &(Key, _)| other.name == key.name) => {
                wrong.push(format!("{name} is given twice"));
            }
            (Some(key), Some(number)) => wanted.push((*key, number)),
            (None, _) => wrong.push(unknown(name, keys)),
            (_, None) => wrong.push(format!("{name}: `{value}` is no number")),
        }
    }
    if wrong.is_empty() { Ok(wanted) } else { Err(all_wrong(motor, &wrong)) }
}

pub fn unknown(name: &str, keys: &[Key]) -> String {
    let names: Vec<&str> = keys.iter().map(|key| key.name).collect();
    format!("`{name}` is not among its settings: {}", names.join(", "))
}

pub fn all_wrong(motor: &Motor, wrong: &[String]) -> Failure {
    Failure::Usage(format!("{}: {}", motor.name(), wrong.join("\n")))
}

/// Changes settings of a group as `NAME=VALUE` has them; without any it only reads.
pub fn change_by_text(
    run: &mut Run<'_>,
    what: &str,
    group: Group,
    texts: &[String],
    to_rom: bool,
) -> Result<(), Failure> {
    let keys = keys_of(&run.motor, group)?;
    let wanted = parse(&run.motor, &keys, texts)?;
    change(run, what, &keys, wanted, to_rom)
}

/// The same of the only setting of a group.
pub fn change_to(
    run: &mut Run<'_>,
    what: &str,
    group: Group,
    value: Option<i64>,
) -> Result<(), Failure> {
    let keys = keys_of(&run.motor, group)?;
    let wanted = keys.iter().zip(value).map(|(key, value)| (*key, Number::Integer(value)));
    let wanted = wanted.collect();
    change(run, what, &keys, wanted, true)
}

/// Writes, reads back, and fails where the motor does not have afterwards what was written.
pub fn change(
    run: &mut Run<'_>,
    what: &str,
    keys: &[Key],
    wanted: Vec<(Key, Number)>,
    to_rom: bool,
) -> Result<(), Failure> {
    let before = read(run, keys)?;
    let is_new = |(key, value): &(Key, Number)| before.get(key.name) != Some(value);
    let wanted: Vec<(Key, Number)> = wanted.into_iter().filter(is_new).collect();
    let mut notes = Vec::new();
    let blind: Vec<&str> = keys
        .iter()
        .filter(|key| matches!(key.kind, Kind::BlindRamp(_)))
        .map(|key| key.name)
        .collect();
    if wanted.is_empty() {
        if !blind.is_empty() {
            notes.push(format!("no command of its dialect reads {}", blind.join(", ")));
        }
        return run.report(what, &before, None, &notes);
    }
    let writes = writes(&run.motor, &before, &wanted, to_rom);
    if !writes.wrong.is_empty() {
        return Err(all_wrong(&run.motor, &writes.wrong));
    }
    if to_rom {
        let list: Vec<String> = wanted
            .iter()
            .map(|(key, value)| match before.get(key.name) {
                Some(old) => format!("{} {old} -> {value}", key.name),
                None => format!("{} {value}", key.name),
            })
            .collect();
        let restart = if writes.restarts { ", then restarts it" } else { "" };
        run.agree(&format!("writes {} into its memory{restart}", list.join(", ")))?;
    }
    for command in &writes.commands {
        run.ask(command)?;
    }
    if writes.restarts && !run.restart()? {
        notes.push("it is not back after its restart: switch it off and on".to_owned());
    }
    let after = read(run, keys)?;
    let mut missed = Vec::new();
    for (key, value) in &wanted {
        match after.get(key.name) {
            Some(has) if has == value => {}
            Some(has) => missed.push(format!("{} is {has} and not {value}", key.name)),
            None if key.kind.read(&run.motor).is_none() => {
                notes.push(format!("{} = {value}: echoed, and nothing reads it back", key.name));
            }
            None => missed.push(format!("{} is not told", key.name)),
        }
    }
    if let Some((_, Number::Integer(level))) =
        wanted.iter().find(|(key, _)| key.group == Group::AckLevel)
        && missed.is_empty()
    {
        let level = Value::Unsigned(u32::try_from(*level).unwrap_or_default());
        notes.extend(run.follow(AxisParameter::D5AckLevel, level));
    }
    run.report(what, &before, Some(&after), &notes)?;
    if missed.is_empty() {
        return Ok(());
    }
    let missed = missed.join(", ");
    Err(run.unconfirmed(&format!("written, and the motor does not say so: {missed}")))
}
