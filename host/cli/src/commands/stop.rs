//! `mgw stop`, `mgw estop`, `mgw clear`, `mgw output-off`

use std::time::Duration;

use host_protocol::{AxisState, ClearTarget, Error, StopTarget};
use mgw_client::{ClientError, StopRequest, Transport, names_before_hello, stop_before_hello};
use serde_json::json;

use crate::args::{Command, Typed, TypedClear, TypedStop};
use crate::commands::stop_report;
use crate::failure::Failure;
use crate::faults;
use crate::names::Names;
use crate::output::Output;
use crate::session::Session;

/// A gateway that has not told its names within this time is not asked any longer: all is stopped.
const NAMES_PATIENCE: Duration = Duration::from_millis(200);

/// Whether a command asks for a stop.
pub fn is_stop(command: &Command) -> bool {
    matches!(command, Command::Stop { .. } | Command::Estop)
}

/// The stop that a command asks for. Where an axis is named and the gateway does not tell which one
/// that is, all are stopped; a name that none has stops nothing.
pub fn asked_for(
    transport: &mut Box<dyn Transport>,
    command: &Command,
    out: Output,
) -> Result<Option<StopRequest>, Failure> {
    let target = match command {
        Command::Stop { target: TypedStop::All } => StopTarget::All,
        Command::Stop { target: TypedStop::Axis(Typed::Number(axis)) } => StopTarget::Axis(*axis),
        Command::Stop { target: TypedStop::Axis(typed) } => {
            match names_before_hello(transport, NAMES_PATIENCE) {
                Ok(names) => StopTarget::Axis(
                    Names::from(names)
                        .find_axis(typed)
                        .map_err(|why| Failure::Usage(format!("nothing was stopped: {why}")))?,
                ),
                Err(error) => {
                    out.aside(format!(
                        "which axis {typed} is is not told ({error}): all are stopped"
                    ));
                    StopTarget::All
                }
            }
        }
        Command::Estop => return Ok(Some(StopRequest::EStop)),
        _ => return Ok(None),
    };
    Ok(Some(StopRequest::Stop(target)))
}

/// Writes a stop before anything else, and then opens the session that waits for its confirmation.
pub fn send_first(
    mut transport: Box<dyn Transport>,
    request: StopRequest,
    connect: impl FnOnce(Box<dyn Transport>) -> Result<Session, Failure>,
) -> Result<Session, Failure> {
    match (stop_before_hello(&mut transport, request), request) {
        (Ok(()), _) => {
            connect(transport).map_err(|failure| Failure::StopTaken { cause: failure.to_string() })
        }
        // An axis that is configured in part, or whose bus is not, was never armed: its report
        // tells that there is nothing to stop.
        (
            Err(
                error @ ClientError::Gateway(
                    Error::NotConfigured { .. } | Error::BusNotConfigured { .. },
                ),
            ),
            StopRequest::Stop(StopTarget::Axis(axis)),
        ) => {
            let mut session = connect(transport)?;
            let is_known = session.client.list_axes()?.iter().any(|known| known.axis == axis);
            if is_known { Ok(session) } else { Err(error.into()) }
        }
        (Err(error), _) => Err(error.into()),
    }
}

/// Waits for the confirmations of a stop that the gateway has taken.
pub fn report(session: &mut Session, request: StopRequest) -> Result<(), Failure> {
    let mut printed = Ok(());
    if request == StopRequest::EStop {
        let text = "e-stop is latched; `mgw clear gateway` and `mgw clear AXIS` release it";
        printed = session.out.text(text);
    }
    let axes = match request {
        StopRequest::Stop(StopTarget::Axis(axis)) => vec![axis],
        StopRequest::Stop(StopTarget::All) | StopRequest::EStop => session
            .axes_or_all(&[])
            .map_err(|failure| Failure::StopTaken { cause: failure.to_string() })?,
    };
    Failure::first([printed, stop_report::report(session, &axes)])
}

/// Clears a trip or the e-stop; a trip whose stop is not confirmed only if that is asked for.
pub fn clear(
    session: &mut Session,
    target: &TypedClear,
    unreachable: bool,
    restart: bool,
) -> Result<(), Failure> {
    let target = match target {
        TypedClear::Gateway => ClearTarget::Gateway,
        TypedClear::Axis(axis) => ClearTarget::Axis(session.axis(axis)?),
    };
    match target {
        ClearTarget::Axis(axis) if restart => session.client.clear_by_restart(axis)?,
        ClearTarget::Gateway if restart => {
            return Err(Failure::Usage("--restart goes with an axis".to_owned()));
        }
        ClearTarget::Axis(axis) if unreachable => session.client.clear_unreachable(axis)?,
        ClearTarget::Gateway if unreachable => {
            return Err(Failure::Usage("--unreachable goes with an axis".to_owned()));
        }
        ClearTarget::Axis(axis) => {
            let line = clear_axis(session, axis)?;
            return session.out.either(line, &json!({ "done": true }));
        }
        ClearTarget::Gateway => session.client.clear(target).map_err(not_cleared)?,
    }
    let line = match target {
        ClearTarget::Axis(axis) => cleared(axis),
        ClearTarget::Gateway => {
            "the e-stop is cleared; tripped axes are cleared one by one".to_owned()
        }
    };
    session.out.either(line, &json!({ "done": true }))
}

/// Clears the trip of an axis whose stop is confirmed; what then holds.
pub fn clear_axis(session: &mut Session, axis: u8) -> Result<String, Failure> {
    let before = session.client.read_state(axis).ok();
    let word = before.as_ref().and_then(|report| report.faults).map_or(0, |faults| faults.word);
    match session.client.clear(ClearTarget::Axis(axis)) {
        Err(ClientError::Gateway(error @ Error::StopNotConfirmed { .. })) if word != 0 => {
            let axes = session.client.list_axes()?;
            let protocol = axes.iter().find(|known| known.axis == axis).and_then(|a| a.protocol);
            let fault = faults::in_words(protocol, word);
            return Err(not_confirmed(error, axis, &format!(" ({fault})")));
        }
        cleared => cleared.map_err(not_cleared)?,
    }
    Ok(match before.map(|report| report.state) {
        Some(AxisState::Tripped { .. }) | None => cleared(axis),
        Some(_) if word != 0 => {
            format!("axis {axis} was not tripped; its motor was told to clear its faults")
        }
        Some(_) => format!("axis {axis} was not tripped: there was nothing to clear"),
    })
}

fn cleared(axis: u8) -> String {
    format!("axis {axis} is cleared; it moves only when it is armed again")
}

/// Has a holding motor let go.
pub fn output_off(session: &mut Session, axis: u8) -> Result<(), Failure> {
    session.client.output_off(axis)?;
    session
        .out
        .either(format!("axis {axis} is idle, its motor's output is off"), &json!({ "done": true }))
}

/// With the way out where the motor will not confirm its stop.
fn not_cleared(error: ClientError) -> Failure {
    match error {
        ClientError::Gateway(error @ Error::StopNotConfirmed { axis }) => {
            not_confirmed(error, axis, "")
        }
        other => other.into(),
    }
}

/// A motor that refuses its stop for a fault that it keeps confirms none, nor does one that has
/// another id by now.
fn not_confirmed(error: Error, axis: u8, fault: &str) -> Failure {
    let text = format!(
        "{error}. If it refuses its stop for a fault that it keeps{fault}, or cannot answer any \
            more, as its id or bitrate is another one, see yourself that it stands; then `mgw \
            clear {axis} --unreachable`, after which `mgw clear {axis}` clears the fault"
    );
    Failure::Explained { error, text }
}
