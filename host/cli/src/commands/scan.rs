//! `mgw scan`

use ::rmd::{Dialect, Recognised};
use host_protocol::{BusKind, Protocol};
use serde_json::{Value, json};

use crate::args::{ScanArgs, ScanCommand};
use crate::explain::Page;
use crate::failure::Failure;
use crate::faults;
use crate::json;
use crate::output::number;
use crate::scan::{Doubled, Evidence, Found, NotAsked, Scanned, Wanted, scan};
use crate::session::Session;
use crate::table::Table;
use crate::words::{self, or_nothing};

/// Shows which motors are on the buses.
pub fn run(session: &mut Session, arguments: &ScanCommand) -> Result<(), Failure> {
    let mut all = Vec::new();
    let wanted = wanted(session, &arguments.scan, arguments.force)?;
    scan(session, &wanted, |_, scanned| {
        all.push(scanned);
        Ok(())
    })?;
    let out = session.out;
    out.object(&json!({ "scan": all.iter().map(bus).collect::<Vec<_>>() }))?;
    let mut table = Table::new(&[
        ">bus", ">bit/s", "motor", ">axis", "model", "firmware", "dialect", ">V", ">°C", "faults",
    ]);
    for scanned in &all {
        scanned.motors.iter().for_each(|motor| table.row(row(scanned, motor)));
    }
    if all.iter().any(|scanned| !scanned.motors.is_empty()) {
        out.table(&table)?;
    }
    for scanned in &all {
        for line in bus_notes(scanned)
            .into_iter()
            .chain(scanned.motors.iter().flat_map(|motor| notes(scanned, motor)))
        {
            out.text(line)?;
        }
    }
    Ok(())
}

/// What these arguments want scanned, and a warning where that may end the timeout of a motor.
pub fn wanted(session: &mut Session, arguments: &ScanArgs, force: bool) -> Result<Wanted, Failure> {
    if arguments.thrusters {
        session.out.aside(
            "thrusters are asked too: any command may end the timeout that keeps one at rest",
        );
    }
    let ScanArgs { targets, listen, thrusters } = arguments;
    let targets = session.scan_targets(targets)?;
    Ok(Wanted { targets, listen: *listen, thrusters: *thrusters, force })
}

fn row(scanned: &Scanned, motor: &Found) -> [String; 10] {
    [
        scanned.bus.to_string(),
        or_nothing(scanned.bitrate),
        name(motor),
        or_nothing(motor.axis.map(|axis| axis.to_string())),
        or_nothing(motor.model.clone()),
        or_nothing(motor.firmware.clone()),
        or_nothing(motor.recognised.map(dialect)),
        or_nothing(motor.voltage_v.map(|volts| format!("{volts:.1}"))),
        or_nothing(motor.temperature_c.map(|celsius| celsius.to_string())),
        or_nothing(motor.faults.map(|word| match word {
            0 => "none".to_owned(),
            word => faults::in_words(Some(motor.protocol), word),
        })),
    ]
}

/// Protocol and node, as in `rmd 1` or `thruster 0x0B`.
pub fn name(motor: &Found) -> String {
    motor_name(motor.protocol, motor.node)
}

/// The same of a motor that is not found yet.
pub fn motor_name(protocol: Protocol, node: u8) -> String {
    match protocol {
        Protocol::Rmd => format!("{protocol} {node}"),
        Protocol::Thruster | Protocol::D5 => format!("{protocol} 0x{node:02X}"),
    }
}

fn dialect(recognised: Recognised) -> String {
    match recognised {
        Recognised::As(dialect) => dialect.name().to_owned(),
        Recognised::OneOf(some) => {
            let names: Vec<&str> = known(some.iter()).map(Dialect::name).collect();
            match names.len() {
                // Nothing was told, or all is possible.
                6.. => "unknown".to_owned(),
                _ => format!("unknown: {}", names.join(" or ")),
            }
        }
        Recognised::Contradicted => "unknown: contradictory".to_owned(),
    }
}

fn known(dialects: impl Iterator<Item = Dialect>) -> impl Iterator<Item = Dialect> {
    dialects.filter(|dialect| *dialect != Dialect::Unknown)
}

/// What is to be said of a bus.
pub fn bus_notes(scanned: &Scanned) -> Vec<String> {
    let bus = scanned.bus;
    if let Some(why) = scanned.not_asked {
        let why = match why {
            NotAsked::Busy => "something sends there, at none of these bitrates: name another, or",
            NotAsked::NotListened => {
                "whether it is silent is not known: leave out `--listen 0`, or"
            }
        };
        return vec![format!("bus {bus} is not asked: {why} add --force, which may disturb it")];
    }
    let Some(bitrate) = scanned.bitrate else {
        let rates = match scanned.kind {
            BusKind::Can => "1000000,210526",
            BusKind::Rs485 => "all",
        };
        return vec![format!("bus {bus} is not configured: `mgw scan {bus}@{rates}` looks there")];
    };
    let mut notes = Vec::new();
    if scanned.unacknowledged {
        notes.push(format!(
            "bus {bus} at {bitrate} bit/s: nobody acknowledges. Look at power, termination, wiring, \
                and the bitrate of the motors {}",
            Page::NotAcknowledged
        ));
    } else if scanned.motors.is_empty() {
        let names: Vec<&str> = scanned.protocols.iter().map(Protocol::name).collect();
        let page = Page::ScanFindsNothing;
        let names = names.join(", ");
        notes.push(format!("bus {bus} at {bitrate} bit/s: no motor found ({names}) {page}"));
    }
    if !scanned.left_out.is_empty() {
        let rates: Vec<String> = scanned.left_out.iter().map(u32::to_string).collect();
        notes.push(format!(
            "bus {bus}: not tried at {} bit/s, as motors were found at {bitrate}",
            rates.join(", ")
        ));
    }
    if scanned.unreadable > 0 {
        notes.push(format!(
            "bus {bus} at {bitrate} bit/s: something was heard that could not be read: noise, \
                another bitrate, or two motors with one id {}",
            Page::BusErrors
        ));
    }
    if scanned.lost > 0 {
        notes.push(format!("bus {bus}: {} frames were lost, as it is busy", scanned.lost));
    }
    notes
}

/// What is to be said of a motor.
pub fn notes(scanned: &Scanned, motor: &Found) -> Vec<String> {
    let who = format!("bus {}, {}", scanned.bus, name(motor));
    let mut notes = Vec::new();
    if let Some(doubled) = motor.doubled {
        let why = match doubled {
            Doubled::TwoReplies => "two replies to one read",
            Doubled::DifferentAnswers => "its constants were answered in two ways",
        };
        notes.push(format!(
            "{who}: two motors seem to have this id ({why}). Unplug one, and give the other \
                another id {}",
            Page::DoubledId
        ));
    }
    if let Some(stated) = motor.contradicted {
        let axis = motor.axis.unwrap_or_default();
        notes.push(format!(
            "{who}: its answers contradict rmd_dialect = {} of axis {axis} {}",
            stated.name(),
            Page::Dialect
        ));
    }
    if let Some(velocity) = motor.turns() {
        notes.push(format!(
            "{who}: it turns, at {velocity:.2} rad/s. Keep clear; an axis that is configured for it \
                stops it: `mgw stop AXIS` {}",
            Page::MotorTurns
        ));
    }
    if motor.timed_out {
        notes.push(format!("{who}: its own timeout has struck; its next command is swallowed"));
    }
    if !motor.unasked.is_empty() && !motor.timed_out {
        let commands = motor.unasked.join(", ");
        notes.push(format!("{who}: sends by itself, unasked: {commands}"));
    }
    let tells_nothing = motor.model.is_none() && motor.firmware.is_none();
    if motor.asked && motor.protocol == Protocol::Rmd && tells_nothing {
        notes.push(format!(
            "{who}: it does not tell what it is. If its id was being changed, switch it off and on"
        ));
    }
    if !motor.asked && motor.protocol == Protocol::Thruster {
        notes.push(format!("{who}: heard only; --thrusters asks it"));
    }
    if motor.ack_level.is_some_and(|level| level != 2) {
        let level = motor.ack_level.unwrap_or_default();
        notes.push(format!("{who}: its acknowledge level is {level}: set d5_ack_level = {level}"));
    }
    if motor.timeout_on == Some(false) {
        notes.push(format!(
            "{who}: its own timeout is off: nothing stops it when the gateway fails"
        ));
    }
    for Evidence { request, answer, dialects } in &motor.evidence {
        let names: Vec<&str> = known(dialects.iter().copied()).map(Dialect::name).collect();
        notes.push(format!(
            "{who}: {} is answered {}: {}",
            words::hex(request),
            words::hex(answer),
            names.join(", ")
        ));
    }
    notes
}

fn bus(scanned: &Scanned) -> Value {
    json!({
        "bus": scanned.bus, "kind": json::name(&scanned.kind),
        "bitrate_bit_s": scanned.bitrate, "protocols": json::protocols(scanned.protocols),
        "unacknowledged": scanned.unacknowledged, "lost": scanned.lost,
        "unreadable": scanned.unreadable,
        "not_asked": scanned.not_asked.map(|why| match why {
            NotAsked::Busy => "busy",
            NotAsked::NotListened => "not_listened",
        }),
        "left_out_bit_s": scanned.left_out,
        "motors": scanned.motors.iter().map(motor).collect::<Vec<_>>(),
    })
}

fn motor(motor: &Found) -> Value {
    let possible = match motor.recognised {
        Some(Recognised::As(dialect)) => vec![dialect.name()],
        Some(Recognised::OneOf(some)) => known(some.iter()).map(Dialect::name).collect(),
        Some(Recognised::Contradicted) | None => Vec::new(),
    };
    let evidence = motor.evidence.iter().map(|one| {
        let names = known(one.dialects.iter().copied()).map(Dialect::name);
        json!({
            "request": words::hex(&one.request), "answer": words::hex(&one.answer),
            "dialects": names.collect::<Vec<_>>(),
        })
    });
    json!({
        "protocol": motor.protocol.name(), "node": motor.node, "axis": motor.axis,
        "asked": motor.asked, "model": motor.model, "firmware": motor.firmware,
        "voltage_v": motor.voltage_v.map(number), "temperature_c": motor.temperature_c,
        "faults": motor.faults.map(|word| faults::names(Some(motor.protocol), word)),
        "faults_raw": motor.faults, "velocity_rad_s": motor.velocity_rad_s.map(number),
        "rmd_dialect": motor.recognised.map(|recognised| recognised.dialect().name()),
        "possible_dialects": possible, "evidence": evidence.collect::<Vec<_>>(),
        "contradicted_dialect": motor.contradicted.map(Dialect::name),
        "timeout_on": motor.timeout_on, "ack_level": motor.ack_level,
        "timed_out": motor.timed_out, "unasked": motor.unasked,
        "doubled": motor.doubled.map(|doubled| match doubled {
            Doubled::TwoReplies => "two_replies",
            Doubled::DifferentAnswers => "different_answers",
        }),
    })
}
