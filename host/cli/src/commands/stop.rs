//! `mgw stop`, `mgw estop`, `mgw clear`, `mgw output-off`

use host_protocol::{ClearTarget, Error, StopTarget};
use mgw_client::{ClientError, StopRequest, Transport, stop_before_hello};
use serde_json::json;

use crate::args::Command;
use crate::commands::stop_report;
use crate::failure::Failure;
use crate::session::Session;

/// The stop that a command asks for.
pub fn asked_for(command: &Command) -> Option<StopRequest> {
    match command {
        Command::Stop { target } => Some(StopRequest::Stop(*target)),
        Command::Estop => Some(StopRequest::EStop),
        _ => None,
    }
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
pub fn stop(session: &mut Session, target: StopTarget) -> Result<(), Failure> {
    let axes = match target {
        StopTarget::Axis(axis) => vec![axis],
        StopTarget::All => session.axes_or_all(&[])?,
    };
    stop_report::report(session, &axes)
}

/// Waits for the confirmations of an e-stop that the gateway has taken.
pub fn estop(session: &mut Session) -> Result<(), Failure> {
    session.out.text("e-stop is latched; `mgw clear gateway` and `mgw clear AXIS` release it")?;
    let axes = session.axes_or_all(&[])?;
    stop_report::report(session, &axes)
}

/// Clears a trip or the e-stop; a trip whose stop is not confirmed only if that is asked for.
pub fn clear(
    session: &mut Session,
    target: ClearTarget,
    unreachable: bool,
    restart: bool,
) -> Result<(), Failure> {
    match target {
        ClearTarget::Axis(axis) if restart => session.client.clear_by_restart(axis)?,
        ClearTarget::Gateway if restart => {
            return Err(Failure::Usage("--restart goes with an axis".to_owned()));
        }
        ClearTarget::Axis(axis) if unreachable => session.client.clear_unreachable(axis)?,
        ClearTarget::Gateway if unreachable => {
            return Err(Failure::Usage("--unreachable goes with an axis".to_owned()));
        }
        target => session.client.clear(target)?,
    }
    let line = match target {
        ClearTarget::Axis(axis) => {
            format!("axis {axis} is cleared; it moves only when it is armed again")
        }
        ClearTarget::Gateway => {
            "the e-stop is cleared; tripped axes are cleared one by one".to_owned()
        }
    };
    session.out.either(line, &json!({ "done": true }))
}

/// Has a holding motor let go.
pub fn output_off(session: &mut Session, axis: u8) -> Result<(), Failure> {
    session.client.output_off(axis)?;
    session
        .out
        .either(format!("axis {axis} is idle, its motor's output is off"), &json!({ "done": true }))
}
