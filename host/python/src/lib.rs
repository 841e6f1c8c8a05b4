//! The client library and the simulator of the motor gateway for Python: `motor_gateway._native`.
//! What a program sees of it is in `python/motor_gateway`.

mod carrier;
mod json;
mod problem;
mod session;
mod simulator;
mod values;

use mgw_cli::programs;
use pyo3::prelude::*;

use problem::Failed;
use session::Session;
use values::STATES;

/// Opens a session: with the port of that name, or a running server, or the only gateway there is.
#[pyfunction]
fn open(py: Python<'_>, port: Option<String>) -> PyResult<Session> {
    let transport = py.detach(|| programs::open(port.as_deref())).map_err(Failed::from)?;
    Session::open(py, transport)
}

/// A frame from the words of `mgw encode`.
#[pyfunction]
fn encode(protocol: &str, words: Vec<String>) -> PyResult<String> {
    Ok(programs::encode(protocol, words).map_err(Failed::from)?)
}

/// Captured frames in words.
#[pyfunction]
fn decode<'py>(
    py: Python<'py>,
    text: &str,
    protocol: &str,
    bus: Option<&str>,
    direction: Option<&str>,
    dialect: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let lines = programs::decode(text, protocol, bus, direction, dialect).map_err(Failed::from)?;
    json::to_python(py, &lines.into())
}

/// The JSON schema of a configuration.
#[pyfunction]
fn configuration_schema(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    json::to_python(py, &programs::configuration_schema())
}

/// A configuration of which the text is JSON, as the text of a file.
#[pyfunction]
fn toml_of(text: &str) -> PyResult<String> {
    let wrong = |error: &dyn std::fmt::Display| {
        PyErr::from(problem::found("Configuration", &format!("no configuration: {error}")))
    };
    let value: serde_json::Value = serde_json::from_str(text).map_err(|error| wrong(&error))?;
    toml::to_string(&value).map_err(|error| wrong(&error))
}

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::session::Session;
    #[pymodule_export]
    use super::simulator::Simulation;
    #[pymodule_export]
    use super::values::{
        Period, Setpoint, State, make_current, make_impedance, make_position, make_signal,
        make_velocity, period_records, state_records,
    };
    use super::*;
    #[pymodule_export]
    use super::{configuration_schema, decode, encode, open, toml_of};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("STATES", STATES)?;
        module.add("VERSION", env!("CARGO_PKG_VERSION"))
    }
}
