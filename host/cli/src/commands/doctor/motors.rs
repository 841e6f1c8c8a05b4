//! Whether the motors answer, stop by themselves, and are what the configuration says.

use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, AxisSummary, MotorTimeout, Protocol, parameters};
use mgw_client::ClientError;

use super::{Findings, Grade, Wrong};
use crate::args::{Bitrates, ScanTarget};
use crate::commands::scan::{bus_notes, name};
use crate::explain::Page;
use crate::failure::Failure;
use crate::faults;
use crate::scan::{Found, Scanned, Wanted, standstill};
use crate::session::Session;
use crate::words;

/// Looks at every axis.
pub fn axes(session: &mut Session, findings: &mut Findings) -> Result<Vec<AxisSummary>, Failure> {
    let axes = session.client.list_axes()?;
    if axes.is_empty() {
        findings.add("axes", Grade::Note, "none is configured: `mgw scan` and `mgw adopt`");
    }
    for summary in &axes {
        let (of, axis) = (format!("axis {}", summary.axis), summary.axis);
        if let Some(missing) = summary.missing {
            let missing = parameters::name(missing).unwrap_or("a parameter");
            let todo = format!("lacks {missing}: `mgw config axis {axis} {missing}=…`");
            findings.wrong(of, Page::NotConfigured, todo);
            continue;
        }
        match session.client.read_state_when_free(axis) {
            Ok(report) => {
                let mut wrong = Vec::new();
                let word = report.faults.map_or(0, |faults| faults.word);
                if let (AxisState::Tripped { confirmed }, Some(trip)) = (report.state, &report.trip)
                {
                    let reason = words::trip_reason(&trip.reason, summary.protocol);
                    let todo = match confirmed {
                        true => format!("`mgw clear {axis}`"),
                        false if word != 0 => format!(
                            "`mgw clear {axis}`. Where its motor goes on refusing its stop for \
                                the fault, see that it stands, then `mgw clear {axis} \
                                --unreachable` and `mgw clear {axis}`"
                        ),
                        false => format!(
                            "`mgw clear {axis}`. Where its motor cannot answer any more, as its id \
                                is another one, see that it stands, then `mgw clear {axis} \
                                --unreachable` and `mgw scan`"
                        ),
                    };
                    let text = format!("tripped ({reason}): remove the cause, {todo}");
                    wrong.push((Page::of_trip(&trip.reason), text));
                }
                wrong.extend(of_velocity(axis, &report));
                if word != 0 {
                    let names = faults::in_words(summary.protocol, word);
                    let text = format!("its motor reports {names}: `mgw state {axis}` says more");
                    wrong.push((Page::MotorFault, text));
                }
                wrong.extend(of_timeout(summary, report.motor_timeout));
                let volts = report.voltage_v.map(|volts| format!(", {:.1} V", volts.value));
                let state = words::axis_state(report.state);
                let timeout = words::motor_timeout(report.motor_timeout);
                let volts = volts.unwrap_or_default();
                let well = format!("its motor answers, {state}{volts}, own timeout {timeout}");
                findings.judge(&of, wrong, well);
                if summary.protocol == Some(Protocol::Thruster)
                    && report.motor_timeout == MotorTimeout::Unknown
                {
                    let text = "it may have lost its own timeout with its power; arming writes it \
                        again, if `mgw config timeout` has written one";
                    findings.add(of, Grade::Note, text);
                }
            }
            Err(ClientError::Gateway(error)) => {
                findings.wrong(of, Page::of_error(&error), error.to_string());
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(axes)
}

/// A motor that turns although nothing commands it.
fn of_velocity(axis: u8, report: &AxisReport) -> Option<Wrong> {
    let at_rest = matches!(report.state, AxisState::Idle | AxisState::Holding);
    let velocity = report.velocity_rad_s.filter(|_| at_rest)?.value;
    (velocity.abs() > standstill()).then(|| {
        let text = format!(
            "its motor turns at {velocity:.2} rad/s, and no setpoint says so: `mgw stop {axis}`"
        );
        (Page::MotorTurns, text)
    })
}

/// What is wrong with the timeout by which the motor stops when the gateway fails.
fn of_timeout(summary: &AxisSummary, timeout: MotorTimeout) -> Option<Wrong> {
    let axis = summary.axis;
    let text = match (timeout, summary.protocol) {
        // Arming reads the switch of the one, and writes the time of the other again.
        (MotorTimeout::Unknown, Some(Protocol::D5 | Protocol::Thruster)) => None,
        (MotorTimeout::Unknown, _) => Some(format!(
            "nothing is known of its motor's own timeout, so it does not arm: `mgw config timeout \
                {axis} 300`"
        )),
        (MotorTimeout::Off, _) => Some(format!(
            "its motor's own timeout is off: nothing stops it when the gateway fails. `mgw config \
                timeout {axis} 300`"
        )),
        (MotorTimeout::Written { .. } | MotorTimeout::Verified, _) => None,
    };
    text.map(|text| (Page::MotorTimeout, text))
}

/// Scans the buses that may be: motors without an axis, two with one id, dialects.
pub fn scan(
    session: &mut Session,
    axes: &[AxisSummary],
    findings: &mut Findings,
) -> Result<(), Failure> {
    let buses = session.client.hello().buses.len();
    for bus in (0u8..).take(buses) {
        if session.client.bus_status(bus)?.config.is_none() {
            continue;
        }
        let of = format!("bus {bus}");
        let wanted = Wanted {
            targets: vec![ScanTarget { bus, bitrates: Bitrates::Configured }],
            listen: Duration::ZERO,
            thrusters: false,
            force: false,
        };
        let result = crate::scan::scan(session, &wanted, |_, scanned| {
            judge(&scanned, axes, findings);
            Ok(())
        });
        match result {
            // Where something may move, the rest is worth knowing all the same.
            Err(Failure::Client(ClientError::Gateway(error))) => {
                findings.add(of, Grade::Note, format!("not scanned: {error}"));
            }
            result => result?,
        }
    }
    Ok(())
}

/// The only axis of this bus and protocol whose motor has not answered.
fn silent_axis(scanned: &Scanned, axes: &[AxisSummary], motor: &Found) -> Option<u8> {
    let has_answered = |axis: &AxisSummary| {
        scanned.motors.iter().any(|other| other.axis == Some(axis.axis) && other.asked)
    };
    let mut silent = axes.iter().filter(|axis| {
        axis.bus == Some(scanned.bus)
            && axis.protocol == Some(motor.protocol)
            && !has_answered(axis)
    });
    // Thrusters are not asked.
    let is_asked = motor.protocol != Protocol::Thruster;
    let only = silent.next().filter(|_| is_asked)?.axis;
    silent.next().is_none().then_some(only)
}

fn judge(scanned: &Scanned, axes: &[AxisSummary], findings: &mut Findings) {
    let bus = format!("bus {}", scanned.bus);
    let has_axes = axes.iter().any(|axis| axis.bus == Some(scanned.bus));
    if scanned.unacknowledged && !has_axes {
        bus_notes(scanned).into_iter().for_each(|note| findings.add(&bus, Grade::Note, note));
    }
    for motor in &scanned.motors {
        let who = name(motor);
        if let Some(velocity) = motor.turns().filter(|_| motor.axis.is_none()) {
            let text = format!("{who} turns at {velocity:.2} rad/s, and is no axis: keep clear");
            findings.wrong(&bus, Page::MotorTurns, text);
        }
        if motor.doubled.is_some() {
            findings.wrong(
                &bus,
                Page::DoubledId,
                format!("two motors seem to be {who}: unplug one, give the other another id"),
            );
        } else if motor.axis.is_none() {
            let mut text = format!("{who} is no axis: `mgw adopt` makes it one");
            if let Some(axis) = silent_axis(scanned, axes, motor) {
                text += &format!(
                    ". If it is the motor of axis {axis}, which does not answer there: `mgw config \
                        axis {axis} node={}`",
                    motor.node
                );
            }
            findings.add(&bus, Grade::Note, text);
        }
        if let (Some(axis), Some(stated)) = (motor.axis, motor.contradicted) {
            findings.wrong(
                format!("axis {axis}"),
                Page::Dialect,
                format!(
                    "its motor's answers contradict rmd_dialect = {}: `mgw scan {}` shows them, \
                        `mgw config axis {axis} rmd_dialect=unknown` is always safe",
                    stated.name(),
                    scanned.bus
                ),
            );
        }
    }
}
