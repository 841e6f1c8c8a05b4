//! What went wrong, as exceptions of `motor_gateway.errors`.

use mgw_cli::programs::Problem;
use mgw_client::ClientError;
use pyo3::prelude::*;

use crate::json::to_python;

/// Why a call has no result.
pub enum Failed {
    /// The gateway, or the way to it.
    Problem(Problem),
    /// The client has heeded an interrupt: what was armed is stopped.
    Interrupted,
    /// An exception of Python's own.
    Raised(PyErr),
}

impl From<ClientError> for Failed {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::Interrupted { .. } => Self::Interrupted,
            error => Self::Problem(error.into()),
        }
    }
}

impl From<Problem> for Failed {
    fn from(problem: Problem) -> Self {
        // A command of several requests that was interrupted between two of them.
        if problem.name == "Interrupted" { Self::Interrupted } else { Self::Problem(problem) }
    }
}

impl From<PyErr> for Failed {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

/// Why a stop was not taken. Over a connection that is lost it was not even sent: to a program that
/// is a stop that nothing answers.
pub fn of_stop(error: ClientError) -> Failed {
    match error {
        ClientError::Transport(_) | ClientError::LinksTaken => {
            let text = format!(
                "the stop could not be sent: {error}. The gateway stops the motors when it no \
                    longer hears this program. Cut their power if they turn"
            );
            found("StopUnanswered", &text)
        }
        error => error.into(),
    }
}

/// A failure found by the binding itself.
pub fn found(name: &'static str, message: &str) -> Failed {
    let (message, fields) = (message.to_owned(), serde_json::Value::Null);
    Failed::Problem(Problem { name, message, number: None, fields })
}

/// What was asked for makes no sense.
pub fn usage(message: &str) -> PyErr {
    found("Usage", message).into()
}

impl From<Failed> for PyErr {
    fn from(failed: Failed) -> Self {
        let problem = match failed {
            Failed::Raised(error) => return error,
            Failed::Problem(problem) => problem,
            Failed::Interrupted => Problem {
                name: "Interrupted",
                message: "a stop or the end of the session ended this call; what was armed here \
                    has been stopped"
                    .to_owned(),
                number: None,
                fields: serde_json::Value::Null,
            },
        };
        Python::attach(|py| exception(py, &problem).unwrap_or_else(|error| error))
    }
}

fn exception(py: Python<'_>, problem: &Problem) -> PyResult<PyErr> {
    let make = py.import("motor_gateway.errors")?.getattr("make")?;
    let fields = to_python(py, &problem.fields)?;
    let made = make.call1((problem.name, &problem.message, problem.number, fields))?;
    Ok(PyErr::from_value(made))
}
