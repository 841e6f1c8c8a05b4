//! What a stop came to, axis by axis.

use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, Error, Protocol, parameters};
use mgw_client::ClientError;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::json;
use crate::session::Session;
use crate::states;
use crate::words;

/// What a stop came to for one axis.
pub enum Outcome {
    /// The motor has confirmed it.
    Confirmed(AxisReport),
    /// The motor has not; the gateway goes on.
    NotConfirmed(Option<AxisReport>),
    /// A required parameter was never set, so the axis was never armed.
    NotConfigured { missing: &'static str },
    /// Its bus was never configured, so the axis was never armed.
    BusNotConfigured { bus: u8 },
}

/// Waits for the stops of these axes: what each came to, and the first failure. A stop that is not
/// confirmed is one; an axis that could never be armed has nothing to stop.
pub fn await_all(session: &mut Session, axes: &[u8]) -> (Vec<(u8, Outcome)>, Result<(), Failure>) {
    let mut result = Ok(());
    let mut outcomes = Vec::new();
    let end = session.stops_until();
    for axis in axes.iter().copied() {
        // Every axis is waited for; the first failure is told.
        match outcome(session, axis, end) {
            Ok(outcome) => {
                if let Outcome::NotConfirmed(_) = outcome {
                    result = result.and(Err(Failure::StopNotConfirmed { axis }));
                }
                outcomes.push((axis, outcome));
            }
            Err(failure) => result = result.and(Err(failure)),
        }
    }
    (outcomes, result)
}

/// What each came to, for programs.
pub fn objects(outcomes: &[(u8, Outcome)], motors: &Protocols) -> Vec<Value> {
    outcomes.iter().map(|(axis, outcome)| outcome.to_json(*axis, motors.of(*axis))).collect()
}

/// Waits for the stops of these axes and prints what each came to.
pub fn report(session: &mut Session, axes: &[u8]) -> Result<(), Failure> {
    let (outcomes, result) = await_all(session, axes);
    let nothing = if axes.is_empty() {
        session.out.text("no axis is configured: there is nothing to stop")
    } else {
        Ok(())
    };
    Failure::first([result, nothing, print(session, &outcomes)])
}

fn print(session: &Session, outcomes: &[(u8, Outcome)]) -> Result<(), Failure> {
    let reports: Vec<AxisReport> =
        outcomes.iter().filter_map(|(_, outcome)| outcome.report()).collect();
    if !reports.is_empty() {
        session.out.table(&states::table(&reports, &session.out.motors, &session.known_names()))?;
    }
    for (axis, outcome) in outcomes {
        if let Some(reason) = outcome.nothing_to_stop() {
            session.out.text(nothing_to_stop(*axis, &reason))?;
        }
    }
    let objects = objects(outcomes, &session.out.motors);
    session.out.object(&json!({ "axes": objects }))
}

fn nothing_to_stop(axis: u8, reason: &str) -> String {
    format!("axis {axis}: nothing to stop, it was never armed: {reason}")
}

/// What the stop of an axis came to, in a line. One that is not confirmed is a failure.
pub fn outcome_line(session: &mut Session, axis: u8) -> Result<String, Failure> {
    let end = session.stops_until();
    match outcome(session, axis, end)? {
        Outcome::NotConfirmed(_) => Err(Failure::StopNotConfirmed { axis }),
        outcome => Ok(outcome.line(axis)),
    }
}

fn outcome(session: &mut Session, axis: u8, end: Duration) -> Result<Outcome, Failure> {
    match session.await_stop(axis, end) {
        Ok(report) => Ok(Outcome::Confirmed(report)),
        Err(Failure::StopNotConfirmed { .. }) => {
            Ok(Outcome::NotConfirmed(session.client.read_state(axis).ok()))
        }
        Err(Failure::Client(ClientError::Gateway(Error::NotConfigured { parameter, .. }))) => {
            Ok(Outcome::NotConfigured {
                missing: parameters::name(parameter).unwrap_or("a parameter"),
            })
        }
        Err(Failure::Client(ClientError::Gateway(Error::BusNotConfigured { bus }))) => {
            Ok(Outcome::BusNotConfigured { bus })
        }
        Err(failure) => Err(failure),
    }
}

impl Outcome {
    fn report(&self) -> Option<AxisReport> {
        match self {
            Self::Confirmed(report) => Some(*report),
            Self::NotConfirmed(report) => *report,
            Self::NotConfigured { .. } | Self::BusNotConfigured { .. } => None,
        }
    }

    /// The outcome in words, where there is nothing to add.
    fn line(&self, axis: u8) -> String {
        match (self.nothing_to_stop(), self.report()) {
            (Some(reason), _) => nothing_to_stop(axis, &reason),
            (None, Some(report)) => {
                let state = match report.state {
                    AxisState::Tripped { .. } => "tripped",
                    state => words::axis_state(state),
                };
                format!("axis {axis}: stop confirmed, {state}")
            }
            (None, None) => format!("axis {axis}: stop not confirmed"),
        }
    }

    /// Why there was nothing to stop.
    fn nothing_to_stop(&self) -> Option<String> {
        match self {
            Self::NotConfigured { missing } => Some(format!("{missing} is not set")),
            Self::BusNotConfigured { bus } => Some(format!("bus {bus} is not configured")),
            Self::Confirmed(_) | Self::NotConfirmed(_) => None,
        }
    }

    /// The name of the outcome, beside what is known of the axis.
    fn to_json(&self, axis: u8, protocol: Option<Protocol>) -> Value {
        let mut value = match self.report() {
            Some(report) => json::axis::report(&report, protocol),
            None => json!({ "axis": axis }),
        };
        value["stop"] = json!(match self {
            Self::Confirmed(_) => "confirmed",
            Self::NotConfirmed(_) => "not_confirmed",
            Self::NotConfigured { .. } => "not_configured",
            Self::BusNotConfigured { .. } => "bus_not_configured",
        });
        match self {
            Self::NotConfigured { missing } => value["missing"] = json!(missing),
            Self::BusNotConfigured { bus } => value["bus"] = json!(bus),
            Self::Confirmed(_) | Self::NotConfirmed(_) => {}
        }
        value
    }
}
