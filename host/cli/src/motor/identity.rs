//! Id and bitrate: what may leave a motor out of reach. Nothing is told as done that the motor has
//! not shown under its new id.

use std::time::Duration;

use ::rmd::{BaudCode, Function, Request};
use codec::EncodeError;
use d5::Register;
use host_protocol::{AxisParameter, BusKind, Protocol, RawFrame, Value};

use super::settings::{Number, Values, has_next_id};
use super::{Motor, Run, failed, lacks, refused};
use crate::config;
use crate::failure::{Failure, list};
use crate::frames;
use crate::scan::Found;

/// So long a motor may take to answer what changes its id, and to come back after a restart.
const ANSWERS_WITHIN: Duration = Duration::from_millis(100);
const RESTARTS_WITHIN: Duration = Duration::from_secs(2);

/// What a look at the bus has shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seen {
    /// The same motor under the new id alone.
    New,
    /// The motor under the old id alone.
    Old,
    /// Something else.
    Neither,
}

fn id_of(node: u8) -> Values {
    Values::from([("id".to_owned(), Number::Integer(node.into()))])
}

/// Shows the id, or gives the motor another one. Returns the id that it has shown in the end.
pub fn id(run: &mut Run<'_>, new: Option<u8>) -> Result<u8, Failure> {
    let old = run.motor.node;
    let Some(new) = new.filter(|new| *new != old) else {
        answers(run)?;
        run.report("id", &id_of(old), None, &[])?;
        return Ok(old);
    };
    check(run, new)?;
    match run.motor.protocol {
        Protocol::Rmd => rmd_id(run, old, new),
        Protocol::Thruster => thruster_id(run, old, new),
        Protocol::D5 => d5_id(run, old, new),
    }
}

/// Refuses an id that is none, or is taken.
pub(super) fn check(run: &Run<'_>, new: u8) -> Result<(), Failure> {
    let (min, max) = match run.motor.protocol {
        Protocol::Rmd => (::rmd::Node::MIN, ::rmd::Node::MAX),
        Protocol::Thruster => (thruster::Node::MIN, thruster::Node::MAX),
        Protocol::D5 => (d5::Node::MIN, d5::Node::MAX),
    };
    if !(min..=max).contains(&new) {
        return Err(Failure::Usage(format!(
            "{}: {new} is no id. It takes {min} to {max}",
            run.motor.name()
        )));
    }
    refuse_taken(run, new, "choose another id")
}

/// Refuses a bitrate at which the motor would be out of reach.
pub(super) fn refuse_not_offered(run: &Run<'_>, bitrate: u32) -> Result<(), Failure> {
    let bus = run.motor.bus;
    let buses = &run.session.client.hello().buses;
    let offered = buses.get(usize::from(bus)).map(|bus| bus.bitrates.to_vec()).unwrap_or_default();
    if offered.contains(&bitrate) {
        return Ok(());
    }
    Err(Failure::Usage(format!(
        "{}: bus {bus} of this board does not run at {bitrate} bit/s, and the motor would be out of \
            reach. It runs at {}",
        run.motor.name(),
        offered.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")
    )))
}

/// Refuses an id that a motor on the bus has, or that an axis is configured for.
pub(super) fn refuse_taken(run: &Run<'_>, new: u8, instead: &str) -> Result<(), Failure> {
    let Motor { bus, protocol, .. } = run.motor;
    let has_it = |other: &&Found| other.protocol == protocol && other.node == new;
    if run.motor.others.iter().any(|other| has_it(&other)) {
        return Err(failed(
            "Taken",
            format!("bus {bus}: {} answers already: {instead}", run.motor.at(new)),
        ));
    }
    match run.after.axis_of(bus, protocol, new) {
        Some(axis) => Err(failed(
            "Taken",
            format!(
                "bus {bus}: axis {axis} is configured for {}, which may be off: {instead}; or, if \
                    this is its motor, `mgw config axis {axis} node={}`",
                run.motor.at(new),
                run.motor.node
            ),
        )),
        None => Ok(()),
    }
}

/// What is said before an id is changed.
fn warning(run: &Run<'_>, new: u8) -> String {
    let row = match run.motor.is_own {
        true => format!("; then the row of axis {} follows: node = {new}", run.motor.axis),
        false => String::new(),
    };
    let back = back(run, new);
    format!("gets id {new} for good{row}. Back with `{back}`")
}

fn back(run: &Run<'_>, new: u8) -> String {
    format!("mgw motor {} id {}", run.motor.target(new), run.motor.node)
}

/// The motor has shown its new id, or has not.
fn conclude(run: &mut Run<'_>, old: u8, new: u8, seen: Seen) -> Result<u8, Failure> {
    let bus = run.motor.bus;
    let text = match seen {
        Seen::New => {
            let mut notes = vec![format!("back with `{}`", back(run, new))];
            notes.extend(run.follow(AxisParameter::Node, Value::Unsigned(new.into())));
            run.report("id", &id_of(old), Some(&id_of(new)), &notes)?;
            return Ok(new);
        }
        Seen::Old => format!(
            "it still answers as {old} (an RMD hears 0x79 only while `function can-id-filter` is \
                off). Switch it off and on, then `mgw scan {bus}`: where it has \
                id {new} then, `{}` leads back",
            back(run, new)
        ),
        Seen::Neither => format!(
            "it has not shown itself as {new} alone. Switch it off and on, then `mgw scan {bus}`; \
                where it has id {new} then, `{}` leads back",
            back(run, new)
        ),
    };
    Err(run.unconfirmed(&text))
}

/// Who answers now.
fn verify(run: &mut Run<'_>, old: u8, new: u8) -> Result<Seen, Failure> {
    let protocol = run.motor.protocol;
    let scanned = run.look(Some(protocol))?;
    let at = |node: u8| {
        scanned.motors.iter().find(|motor| motor.protocol == protocol && motor.node == node)
    };
    let before = run.motor.found.as_ref();
    let is_same = |motor: &Found| {
        motor.asked
            && motor.doubled.is_none()
            && before.is_none_or(|before| {
                (&before.model, &before.firmware) == (&motor.model, &motor.firmware)
            })
    };
    Ok(match (at(old), at(new)) {
        (None, Some(motor)) if is_same(motor) => Seen::New,
        (Some(_), None) => Seen::Old,
        _ => Seen::Neither,
    })
}

/// By 0x79, which reaches every motor of the bus, or 0x20 index 5, whose answer comes from the new
/// id at once while the motor listens on the old one until it restarts. Neither is a native
/// command.
fn rmd_id(run: &mut Run<'_>, old: u8, new: u8) -> Result<u8, Failure> {
    let motor = run.motor.clone();
    let node = |id| ::rmd::Node::new(id).map_err(|error| refused(&error, &motor));
    let others: Vec<u8> = motor
        .others
        .iter()
        .filter(|other| other.protocol == Protocol::Rmd)
        .map(|other| other.node)
        .collect();
    let has_next_id = has_next_id(&motor.dialects).ok_or_else(|| {
        if motor.dialects.len() + 1 == ::rmd::Dialect::ALL.len() {
            let text = format!("{}: it did not tell what it speaks", motor.name());
            return failed(
                "NotRecognised",
                format!("{text}. See that it has power, and try again"),
            );
        }
        let text =
            format!("it may speak {}, and its id is set otherwise in each", motor.dialect_names());
        lacks(&motor, &text, "State rmd_dialect on its axis")
    })?;
    let frames = if has_next_id {
        let function = Function::NextCanId { id: node(new)? };
        let frames = [Request::Shutdown, Request::Function { function }, Request::Reset];
        frames.iter().map(|request| frame(&motor, old, request)).collect()
    } else {
        if !others.is_empty() {
            return Err(failed(
                "NotAlone",
                format!(
                    "{}: 0x79 gives every RMD of the bus that id, and rmd {} is there too. Unplug \
                        all but one",
                    motor.name(),
                    list(&others)
                ),
            ));
        }
        let request = match motor.kind {
            BusKind::Can => Request::SetCanId { id: new },
            BusKind::Rs485 => Request::SetRs485Id { id: new },
        };
        // The first command after the motor's own timeout is not carried out.
        vec![frame(&motor, old, &Request::Shutdown), frame(&motor, old, &request)]
    };
    let frames: Vec<RawFrame> =
        frames.into_iter().collect::<Result<_, EncodeError>>().map_err(|e| refused(&e, &motor))?;
    let rows = run.after.axes_on(motor.bus);
    let mut what = warning(run, new);
    if !rows.is_empty() {
        what += &format!(
            ". For that the axes of the bus, {}, are taken out of the configuration and put back",
            list(&rows)
        );
    }
    run.agree(&what)?;
    let mut alone = run.now.clone();
    alone.axes.retain(|axis, _| !rows.contains(axis) && *axis != motor.axis);
    run.configure(alone)?;
    run.session.client.raw_open_unsafe(motor.bus)?;
    let sent = send(run, &frames);
    let closed = run.session.client.raw_close(motor.bus);
    sent?;
    closed?;
    if has_next_id {
        run.session.client.pause(RESTARTS_WITHIN)?;
    }
    let seen = verify(run, old, new)?;
    let new = conclude(run, old, new, seen)?;
    if !rows.is_empty() {
        run.leave()?;
        // The gateway has forgotten what timeouts they have.
        let known = run.after.clone();
        config::write_timeouts(&mut run.session.client, &known)?;
    }
    Ok(new)
}

/// 0x79 has an id of its own, whatever the node.
fn frame(motor: &Motor, node: u8, request: &Request) -> Result<RawFrame, EncodeError> {
    frames::to_rmd(motor.kind, ::rmd::Node::new(node)?, request)
}

/// Sends these one after the other. What is answered is not listened to: only what the motor does
/// afterwards counts.
fn send(run: &mut Run<'_>, frames: &[RawFrame]) -> Result<(), Failure> {
    for frame in frames {
        run.session.client.raw_send(run.motor.bus, frame.clone())?;
        run.session.client.pause(ANSWERS_WITHIN)?;
    }
    Ok(())
}

fn d5_id(run: &mut Run<'_>, old: u8, new: u8) -> Result<u8, Failure> {
    run.agree(&warning(run, new))?;
    let value = d5::Value::Word(new.into());
    let data = run.motor.d5(&d5::Request::Write { register: Register::ID, value })?;
    // Who answers the next look counts, whatever came of this.
    let answered = run.ask(&data).map(drop);
    let seen = verify(run, old, new)?;
    match (seen, answered) {
        (Seen::Old, Err(failure)) => Err(failure),
        (seen, _) => conclude(run, old, new, seen),
    }
}

fn thruster_id(run: &mut Run<'_>, old: u8, new: u8) -> Result<u8, Failure> {
    run.agree(&format!(
        "gets id {new} when it is switched on again; until then it is {old}. Back with `{}`",
        back(run, new)
    ))?;
    let request = thruster::Request::SetId { id: new.into() };
    let reply = run.ask_thruster(&request)?;
    if reply != (thruster::Reply::Id { id: new.into() }) {
        return Err(run.unconfirmed(&format!("it does not repeat the id {new}")));
    }
    let mut notes = vec![format!(
        "it has taken the id {new}, and has it once it is switched off and on; then `mgw motor {} \
            id` shows it, and `{}` leads back",
        run.motor.target(new),
        back(run, new)
    )];
    if run.motor.is_own {
        notes.push(format!("then `mgw config axis {} node={new}`", run.motor.axis));
    }
    run.report("id", &id_of(old), None, &notes)?;
    Ok(old)
}

/// A thruster was not scanned for.
fn answers(run: &mut Run<'_>) -> Result<(), Failure> {
    if run.motor.protocol == Protocol::Thruster {
        run.ask_thruster(&thruster::Request::ReadFaults)?;
    }
    Ok(())
}

/// Shows the bitrate at which the motor answers, or sets another one, which it has from its next
/// power-on.
pub fn bitrate(run: &mut Run<'_>, new: Option<u32>) -> Result<(), Failure> {
    answers(run)?;
    let Motor { bus, bitrate: old, kind, protocol, .. } = run.motor.clone();
    let before = Values::from([("bitrate_bit_s".to_owned(), Number::Integer(old.into()))]);
    let Some(new) = new.filter(|new| *new != old) else {
        return run.report("bitrate", &before, None, &[]);
    };
    refuse_not_offered(run, new)?;
    let back = format!("mgw motor {}@{new} bitrate {old}", run.motor.target(run.motor.node));
    let question = format!(
        "gets {new} bit/s when it is switched on again; the others of the bus keep {old}. Back \
            with `{back}` on a bus without axes"
    );
    let repeated = match protocol {
        Protocol::Rmd => {
            let code = |dialect: &::rmd::Dialect| match kind {
                BusKind::Can => BaudCode::for_can(*dialect, new),
                BusKind::Rs485 => BaudCode::for_rs485(*dialect, new),
            };
            let codes: Vec<Option<BaudCode>> = run.motor.dialects.iter().map(code).collect();
            let same = codes.first().copied().flatten();
            let code =
                same.filter(|_| codes.iter().all(|code| *code == same)).ok_or_else(|| {
                    let text = format!(
                        "it may speak {}, and no code is known that sets {new} bit/s there",
                        run.motor.dialect_names()
                    );
                    lacks(&run.motor, &text, "")
                })?;
            run.agree(&question)?;
            let data = run.motor.rmd(&Request::SetBaudRate { code })?;
            run.ask(&data)?;
            "no RMD confirms it (0xB4)"
        }
        Protocol::Thruster => {
            let info = thruster::BITRATES.iter().find(|info| info.bits_per_second == new);
            let bitrate = info.map(|info| info.setting).ok_or_else(|| {
                lacks(&run.motor, &format!("it cannot be set to {new} bit/s"), "")
            })?;
            run.agree(&question)?;
            let reply = run.ask_thruster(&thruster::Request::SetBitrate { bitrate })?;
            if reply != (thruster::Reply::Bitrate { bitrate }) {
                return Err(run.unconfirmed("it does not repeat the bitrate"));
            }
            "it has taken it"
        }
        Protocol::D5 => {
            return Err(lacks(&run.motor, "the manual says that its bitrate cannot be set", ""));
        }
    };
    let mut notes = vec![format!(
        "told {new} bit/s; {repeated}. Switch it off and on; at {new} bit/s it is found by `mgw \
            scan {bus}@{new}`, else it is at {old} still. `{back}` leads back"
    )];
    if run.after.axes_on(bus).is_empty() {
        notes.push(format!("where bus {bus} is configured: `mgw config bus {bus} bitrate={new}`"));
    } else {
        notes.push(format!(
            "then `mgw config bus {bus} bitrate={new}`, once every motor of the bus has it"
        ));
    }
    run.report("bitrate", &before, None, &notes)
}
