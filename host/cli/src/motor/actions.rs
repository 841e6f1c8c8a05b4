//! What a motor does, and settings that it does not tell.

use ::rmd::{Function, Reply, Request};
use d5::{Register, Width};
use host_protocol::{AxisParameter, MotorTimeout, Protocol, Value};
use thruster::{Milliseconds, ReturnFlags, ReturnFrames};

use super::change::change_to;
use super::identity::refuse_taken;
use super::settings::{self, Group, Number, Values};
use super::{Run, lacks};
use crate::args::{BrakeAction, FunctionName, OnOff, Reports};
use crate::failure::Failure;
use crate::words;

fn one(name: &str, value: Number) -> Values {
    Values::from([(name.to_owned(), value)])
}

/// Takes the place where the shaft stands for zero.
pub fn zero_here(run: &mut Run<'_>) -> Result<(), Failure> {
    match run.motor.protocol {
        Protocol::Rmd => {
            let keys = settings::keys_of(&run.motor, Group::Zero)?;
            let before = settings::read(run, &keys)?;
            run.agree(
                "takes the place where its shaft stands for zero, in its ROM, and restarts; \
                    positions and their limits count from there",
            )?;
            let written = match run.ask_rmd(&Request::WritePositionAsZero)? {
                Reply::PositionWrittenAsZero { offset } => offset.0,
                _ => return Err(run.unconfirmed("it does not tell the zero point")),
            };
            let is_back = run.restart()?;
            let after = settings::read(run, &keys)?;
            run.report("zero", &before, Some(&after), &[])?;
            let has = after.get("encoder_offset_pulses");
            if is_back && has == Some(&Number::Integer(written.into())) {
                return Ok(());
            }
            Err(run.unconfirmed(&format!(
                "it told {written} pulses, which do not act yet: switch it off and on"
            )))
        }
        Protocol::Thruster => {
            let before = position(run)?;
            run.agree("takes the place where it stands for the zero of its absolute position")?;
            if run.ask_thruster(&thruster::Request::SetAbsoluteZero)?
                != thruster::Reply::AbsoluteZeroSet
            {
                return Err(run.unconfirmed("it refuses"));
            }
            let after = position(run)?;
            run.report("zero", &before, Some(&after), &[])
        }
        Protocol::D5 => Err(lacks(&run.motor, "its manual has no zero point to set", "")),
    }
}

/// Shows the zero point of an RMD, or where a thruster's rudder stands from its own.
pub fn zero(run: &mut Run<'_>) -> Result<(), Failure> {
    if run.motor.protocol != Protocol::Thruster {
        return change_to(run, "zero", Group::Zero, None);
    }
    let position = position(run)?;
    run.report("zero", &position, None, &[])
}

fn position(run: &mut Run<'_>) -> Result<Values, Failure> {
    match run.ask_thruster(&thruster::Request::ReadAbsolutePosition)? {
        thruster::Reply::MeasuredPosition { position } => {
            #[allow(clippy::cast_precision_loss, reason = "a turn has 3600 of them")]
            let degrees = position.0 as f32 / 10.0;
            Ok(one("angle_deg", Number::Real(degrees)))
        }
        _ => Err(run.unconfirmed("it tells no position: it may have no encoder")),
    }
}

/// The motor's own timeout, which no RMD and no thruster tells.
pub fn timeout(run: &mut Run<'_>, timeout_ms: Option<u32>) -> Result<(), Failure> {
    let axis = run.motor.axis;
    let (before, known) = if run.motor.protocol == Protocol::D5 {
        let switch = register(run, Register::TIMEOUT_SWITCH)?;
        (one("timeout_switch", switch), None)
    } else {
        (Values::new(), Some(run.session.client.axis_settings(axis)?.1))
    };
    let told = |timeout: MotorTimeout| {
        format!(
            "no command reads its timeout; to the gateway it is {}",
            words::motor_timeout(timeout)
        )
    };
    let Some(timeout_ms) = timeout_ms else {
        let notes: Vec<String> = known.into_iter().map(told).collect();
        return run.report("timeout", &before, None, &notes);
    };
    let without = if timeout_ms == 0 { ": nothing stops it when the gateway fails" } else { "" };
    run.agree(&format!("gets a timeout of {timeout_ms} ms{without}"))?;
    let has = run.session.client.provision_motor_timeout(axis, timeout_ms)?;
    let after = match run.motor.protocol {
        Protocol::D5 => one("timeout_switch", register(run, Register::TIMEOUT_SWITCH)?),
        Protocol::Rmd | Protocol::Thruster => one("timeout_ms", Number::Integer(timeout_ms.into())),
    };
    if run.motor.is_own && run.motor.protocol != Protocol::D5 {
        run.after.motor_timeouts.insert(axis, timeout_ms);
    }
    let note = format!("its own timeout is {}", words::motor_timeout(has));
    run.report("timeout", &before, Some(&after), &[note])
}

fn register(run: &mut Run<'_>, register: Register) -> Result<Number, Failure> {
    match run.ask_d5(&d5::Request::Read { register, width: Width::Byte })? {
        d5::Reply::Read { value: d5::Value::Byte(byte), .. } => Ok(Number::Integer(byte.into())),
        _ => Err(run.unconfirmed("it does not tell the register")),
    }
}

/// The holding brake.
pub fn brake(run: &mut Run<'_>, action: Option<BrakeAction>) -> Result<(), Failure> {
    match run.motor.protocol {
        Protocol::Rmd => {}
        Protocol::Thruster => return Err(lacks(&run.motor, "its manual has no brake", "")),
        Protocol::D5 if action.is_some() => {
            let text = "its manual gives no access to the brake";
            return Err(lacks(&run.motor, text, "It can only be read"));
        }
        Protocol::D5 => {
            let on = register(run, Register::BRAKE)?;
            return run.report("brake", &one("brake", on), None, &[]);
        }
    }
    let before = brake_released(run)?;
    let Some(action) = action else { return run.report("brake", &before, None, &[]) };
    let request = match action {
        BrakeAction::Release => {
            run.agree("releases its brake: a load that hangs on it falls")?;
            Request::ReleaseBrake
        }
        BrakeAction::Lock => Request::LockBrake,
    };
    run.ask_rmd(&request)?;
    let after = brake_released(run)?;
    run.report("brake", &before, Some(&after), &[])?;
    let wanted = Number::Integer((action == BrakeAction::Release).into());
    if after.get("brake_released") == Some(&wanted) {
        return Ok(());
    }
    let why = "it has echoed the command, and its status does not say so: it may have no brake, or \
        show it only while it turns";
    Err(run.unconfirmed(why))
}

fn brake_released(run: &mut Run<'_>) -> Result<Values, Failure> {
    match run.ask_rmd(&Request::ReadStatus1)? {
        Reply::Status1 { brake_released, .. } => {
            Ok(one("brake_released", Number::Integer(brake_released.into())))
        }
        _ => Err(run.unconfirmed("it does not tell its status")),
    }
}

/// Restarts an RMD; has a D5 forget everything, its id too.
pub fn reset(run: &mut Run<'_>) -> Result<(), Failure> {
    match run.motor.protocol {
        Protocol::Rmd => {
            run.agree(
                "restarts: what it holds may drop, its brake locks, and turns that it does not \
                    keep are lost",
            )?;
            let time = |run: &mut Run<'_>| -> Result<Values, Failure> {
                let ms = i64::try_from(run.run_time()?.as_millis()).unwrap_or(i64::MAX);
                Ok(one("run_time_ms", Number::Integer(ms)))
            };
            let before = time(run)?;
            if !run.restart()? {
                return Err(run.unconfirmed("it is not back after its restart"));
            }
            let after = time(run)?;
            run.report("reset", &before, Some(&after), &[])
        }
        Protocol::Thruster => Err(lacks(
            &run.motor,
            "its manual has no command to restart it",
            "Switch it off and on",
        )),
        Protocol::D5 => d5_reset(run),
    }
}

fn d5_reset(run: &mut Run<'_>) -> Result<(), Failure> {
    let (old, factory) = (run.motor.node, d5::Node::FACTORY.get());
    if old != factory {
        refuse_taken(run, factory, "it would get that id too. Give the other one another id")?;
    }
    let row = if run.motor.is_own { ", and so does the row of its axis" } else { "" };
    run.agree(&format!(
        "forgets all its settings and gets id {factory}{row}. Back with `mgw motor {} id {old}`",
        run.motor.target(factory)
    ))?;
    let keys: Vec<_> = settings::keys(&run.motor);
    let before = settings::read(run, &keys)?;
    let data = run.motor.d5(&d5::Request::Reset)?;
    let answered = run.ask(&data).map(drop);
    let scanned = run.look(Some(Protocol::D5))?;
    let is_there = |node: u8| scanned.motors.iter().any(|motor| motor.node == node);
    if !is_there(factory) || old != factory && is_there(old) {
        answered?;
        return Err(run.unconfirmed("it does not show itself under the factory id"));
    }
    let mut notes = vec![format!("its id is {factory}")];
    notes.extend(run.follow(AxisParameter::Node, Value::Unsigned(factory.into())));
    notes.extend(run.follow(AxisParameter::D5AckLevel, Value::Unsigned(2)));
    // It is asked under its new id.
    run.motor.node = factory;
    let mut wanted = run.now.clone();
    if let Some(values) = wanted.axes.get_mut(&run.motor.axis) {
        values.insert(AxisParameter::Node, Value::Unsigned(factory.into()));
        values.insert(AxisParameter::D5AckLevel, Value::Unsigned(2));
    }
    run.configure(wanted)?;
    let after = settings::read(run, &keys)?;
    run.report("reset", &before, Some(&after), &notes)
}

/// Clears what a motor clears by a command.
pub fn clear_faults(run: &mut Run<'_>) -> Result<(), Failure> {
    if run.motor.protocol == Protocol::Rmd {
        return Err(lacks(
            &run.motor,
            "no version of its manual has a command for that",
            "`mgw motor … reset` restarts it, which clears latched faults",
        ));
    }
    let before = faults(run)?;
    if run.motor.protocol == Protocol::Thruster {
        run.ask_thruster(&thruster::Request::ClearFaults)?;
    } else {
        let (register, value) = (Register::CLEAR_PROTECTION, d5::Value::Byte(1));
        let data = run.motor.d5(&d5::Request::Write { register, value })?;
        run.ask(&data)?;
    }
    let after = faults(run)?;
    run.report("clear_faults", &before, Some(&after), &[])?;
    match after.get("faults") {
        Some(Number::Integer(0)) => Ok(()),
        _ => Err(run.unconfirmed("faults are left: their cause remains, or they are not latched")),
    }
}

fn faults(run: &mut Run<'_>) -> Result<Values, Failure> {
    let word = if run.motor.protocol == Protocol::D5 {
        register(run, Register::STATUS)?
    } else {
        match run.ask_thruster(&thruster::Request::ReadFaults)? {
            thruster::Reply::Faults { faults } => Number::Integer(faults.bits().into()),
            _ => return Err(run.unconfirmed("it does not tell its faults")),
        }
    };
    Ok(one("faults", word))
}

/// Switches a function of an RMD.
pub fn function(run: &mut Run<'_>, name: FunctionName, state: OnOff) -> Result<(), Failure> {
    if run.motor.protocol != Protocol::Rmd {
        return Err(lacks(&run.motor, "only an RMD has these functions", ""));
    }
    let enabled = state == OnOff::On;
    let function: Function = settings::function(name, enabled);
    let filter = matches!(function, Function::CanIdFilter { .. });
    let more = if filter && enabled { "; it hears nothing that is meant for all then" } else { "" };
    // What it lacks is refused before anything is asked.
    run.motor.rmd(&Request::Function { function })?;
    run.agree(&format!("switches the function {} in its memory{more}", on_off(enabled)))?;
    if run.ask_rmd(&Request::Function { function })? != (Reply::Function { function }) {
        return Err(run.unconfirmed("it does not echo the function"));
    }
    echoed(run, "function", &[])
}

fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

/// What can be confirmed by nothing but the motor's echo.
fn echoed(run: &Run<'_>, what: &str, notes: &[String]) -> Result<(), Failure> {
    let echo = "the motor has repeated the command; nothing reads it back".to_owned();
    run.report(what, &Values::new(), None, &[&[echo], notes].concat())
}

/// What a thruster returns to TC and VC.
pub fn returns(run: &mut Run<'_>, flags: u8, frames: u8) -> Result<(), Failure> {
    let (flags, frames) =
        (ReturnFlags::from_bits_retain(flags), ReturnFrames::from_bits_retain(frames));
    let request = thruster::Request::ConfigureReturn { flags, frames };
    let reply = thruster::Reply::ReturnConfigured { flags, frames };
    let word = u32::from(flags.bits()) << 8 | u32::from(frames.bits());
    let parameter = AxisParameter::ReturnMode;
    // No row says it of a motor without an axis.
    let lent = (!run.motor.is_own)
        .then(|| format!("an axis for this motor needs `{}={word}`", parameter.text().name));
    thruster_setting(run, "returns", request, reply, lent.as_slice())?;
    row_follows(run, parameter, word);
    Ok(())
}

/// What a thruster sends by itself.
pub fn stream(run: &mut Run<'_>, frames: u8, interval_ms: u16) -> Result<(), Failure> {
    let (frames, interval) = (ReturnFrames::from_bits_retain(frames), Milliseconds(interval_ms));
    let request = thruster::Request::ConfigureStream { frames, interval };
    let reply = thruster::Reply::StreamConfigured { frames, interval };
    let word = u32::from(frames.bits()) << 16 | u32::from(interval_ms);
    thruster_setting(run, "stream", request, reply, &[])?;
    row_follows(run, AxisParameter::Stream, word);
    Ok(())
}

/// The gateway has written into the row what it told the motor; a row that was lent is taken back
/// with it.
fn row_follows(run: &mut Run<'_>, parameter: AxisParameter, word: u32) {
    let (axis, value) = (run.motor.axis, Value::Unsigned(word));
    run.now.axes.entry(axis).or_default().insert(parameter, value);
    if run.motor.is_own {
        run.after.axes.entry(axis).or_default().insert(parameter, value);
    }
}

/// How often a thruster tells current and speed.
pub fn reports(run: &mut Run<'_>, mode: Reports) -> Result<(), Failure> {
    let (request, reply) = match mode {
        Reports::Off => (thruster::Request::RequestMode, thruster::Reply::RequestMode),
        Reports::Low => (thruster::Request::LowSpeedMode, thruster::Reply::LowSpeedMode),
        Reports::Medium => (thruster::Request::MediumSpeedMode, thruster::Reply::MediumSpeedMode),
    };
    thruster_setting(run, "reports", request, reply, &[])
}

fn thruster_setting(
    run: &mut Run<'_>,
    what: &str,
    request: thruster::Request,
    wanted: thruster::Reply,
    notes: &[String],
) -> Result<(), Failure> {
    if run.motor.protocol != Protocol::Thruster {
        return Err(lacks(&run.motor, "only a thruster has that", ""));
    }
    run.motor.thruster(&request)?;
    if what != "reports" {
        run.agree(&format!("changes its {what}, which it keeps"))?;
    }
    if run.ask_thruster(&request)? != wanted {
        return Err(run.unconfirmed("it does not repeat the command"));
    }
    echoed(run, what, notes)
}
