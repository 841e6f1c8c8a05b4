//! What a stop came to, axis by axis.

use host_protocol::replies::AxisReport;
use host_protocol::{Error, Protocol, parameters};
use mgw_client::ClientError;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::json;
use crate::session::Session;
use crate::states;

/// What a stop came to for one axis.
enum Outcome {
    /// The motor has confirmed it.
    Confirmed(AxisReport),
    /// The motor has not; the gateway goes on.
    NotConfirmed(Option<AxisReport>),
    /// A required parameter was never set, so the axis was never armed.
    NotConfigured { missing: &'static str },
    /// Its bus was never configured, so the axis was never armed.
    BusNotConfigured { bus: u8 },
}

/// Waits for the stops of these axes and prints what each came to. A stop that is not confirmed is
/// a failure; an axis that could never be armed has nothing to stop.
pub fn report(session: &mut Session, axes: &[u8]) -> Result<(), Failure> {
    let mut result = Ok(());
    let mut outcomes = Vec::new();
    for axis in axes.iter().copied() {
        // Every axis is waited for; the first failure is told.
        match outcome(session, axis) {
            Ok(outcome) => {
                if let Outcome::NotConfirmed(_) = outcome {
                    result = result.and(Err(Failure::StopNotConfirmed { axis }));
                }
                outcomes.push((axis, outcome));
            }
            Err(failure) => result = result.and(Err(failure)),
        }
    }
    let reports: Vec<AxisReport> =
        outcomes.iter().filter_map(|(_, outcome)| outcome.report()).collect();
    if !reports.is_empty() {
        session.out.table(&states::table(&reports, &session.out.motors, &session.known_names()))?;
    }
    for (axis, outcome) in &outcomes {
        if let Some(reason) = outcome.nothing_to_stop() {
            session
                .out
                .text(format!("axis {axis}: nothing to stop, it was never armed: {reason}"))?;
        }
    }
    let objects: Vec<Value> = outcomes
        .iter()
        .map(|(axis, outcome)| outcome.to_json(*axis, session.out.motors.of(*axis)))
        .collect();
    session.out.object(&json!({ "axes": objects }))?;
    result
}

fn outcome(session: &mut Session, axis: u8) -> Result<Outcome, Failure> {
    match session.await_stop(axis) {
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
