//! What goes into a cycle and what comes out of it: objects without a dictionary, made often.

use host_protocol::{AxisState, CycleMessage, CycleResult, CycleState, StateField, StateFields};
use mgw_cli::programs;
use mgw_client::{AxisSetpoint, LAST_AXIS};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict};

use crate::json::to_python;
use crate::problem::usage;

/// The names of the states of an axis, in the order of their numbers in records.
pub const STATES: [&str; 8] =
    ["unconfigured", "idle", "arming", "armed", "active", "stopping", "tripped", "holding"];

fn state_number(state: AxisState) -> u8 {
    match state {
        AxisState::Unconfigured => 0,
        AxisState::Idle => 1,
        AxisState::Arming => 2,
        AxisState::Armed => 3,
        AxisState::Active => 4,
        AxisState::Stopping => 5,
        AxisState::Tripped { .. } => 6,
        AxisState::Holding => 7,
    }
}

/// The number of an axis.
#[derive(Clone, Copy)]
pub struct AxisNumber(pub u8);

impl AxisNumber {
    /// So many axes can one request name.
    pub const COUNT: usize = LAST_AXIS as usize + 1;
}

impl FromPyObject<'_, '_> for AxisNumber {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        // To Python, True is a 1.
        let number = if object.is_instance_of::<PyBool>() { None } else { object.extract().ok() };
        number.filter(|number| *number <= LAST_AXIS).map(Self).ok_or_else(|| {
            let given = shown(object);
            usage(&format!("an axis is a number from 0 to {LAST_AXIS}, not {given}"))
        })
    }
}

/// As Python writes it.
fn shown(object: Borrowed<'_, '_, PyAny>) -> String {
    object.repr().map_or_else(|error| error.to_string(), |text| text.to_string())
}

/// A set of fields by their names.
pub struct Fields(pub StateFields);

impl FromPyObject<'_, '_> for Fields {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, '_, PyAny>) -> PyResult<Self> {
        let names: Vec<String> = object.extract().map_err(|_| {
            let given = shown(object);
            usage(&format!("fields is a list of names such as ['position'], not {given}"))
        })?;
        let all = names.iter().try_fold(StateFields::NONE, |set, name| {
            StateField::from_name(name).map(|field| set.with(field)).ok_or_else(|| {
                let known: Vec<&str> = StateField::ALL.iter().map(|field| field.name()).collect();
                usage(&format!("`{name}` is no field; there are {}", known.join(", ")))
            })
        });
        all.map(Self)
    }
}

/// What one axis shall do.
#[pyclass(frozen, eq, module = "motor_gateway", name = "AxisSetpoint")]
#[derive(Clone, Copy, PartialEq)]
pub struct Setpoint(pub AxisSetpoint);

#[pymethods]
impl Setpoint {
    /// Number of the axis.
    #[getter]
    fn axis(&self) -> u8 {
        self.0.axis
    }

    fn __repr__(&self) -> String {
        format!("AxisSetpoint(axis={}, {:?})", self.0.axis, self.0.setpoint)
    }
}

/// The state of an axis at the end of a cycle or of one of its periods.
#[pyclass(frozen, module = "motor_gateway", name = "CycleState")]
pub struct State(CycleState);

impl State {
    pub fn new(state: CycleState) -> Self {
        Self(state)
    }

    /// As the bytes of a record; what is missing is NaN, or −1 of the faults.
    fn put(&self, out: &mut Vec<u8>) {
        let Self(state) = self;
        out.push(state.axis);
        out.push(state_number(state.state));
        out.push(u8::from(state.result.is_answered()));
        out.push(0);
        out.extend(state.age_us.to_le_bytes());
        for reading in [
            state.position_rad,
            state.velocity_rad_s,
            state.current_a,
            state.voltage_v,
            state.motor_temperature_c,
            state.driver_temperature_c,
        ] {
            out.extend(reading.unwrap_or(f32::NAN).to_le_bytes());
        }
        out.extend(state.faults.map_or(-1, i32::from).to_le_bytes());
    }
}

#[pymethods]
impl State {
    #[getter]
    fn axis(&self) -> u8 {
        self.0.axis
    }

    #[getter]
    fn state(&self) -> &'static str {
        STATES[usize::from(state_number(self.0.state))]
    }

    #[getter]
    fn stop_confirmed(&self) -> Option<bool> {
        match self.0.state {
            AxisState::Tripped { confirmed } => Some(confirmed),
            _ => None,
        }
    }

    #[getter]
    fn result(&self) -> String {
        programs::result(self.0.result)
    }

    #[getter]
    fn answered(&self) -> bool {
        self.0.result.is_answered()
    }

    #[getter]
    fn error_number(&self) -> Option<u16> {
        match self.0.result {
            CycleResult::Refused { error } => Some(error),
            _ => None,
        }
    }

    #[getter]
    fn age_us(&self) -> u32 {
        self.0.age_us
    }

    #[getter]
    fn position_rad(&self) -> Option<f32> {
        self.0.position_rad
    }

    #[getter]
    fn velocity_rad_s(&self) -> Option<f32> {
        self.0.velocity_rad_s
    }

    #[getter]
    fn current_a(&self) -> Option<f32> {
        self.0.current_a
    }

    #[getter]
    fn voltage_v(&self) -> Option<f32> {
        self.0.voltage_v
    }

    #[getter]
    fn motor_temperature_c(&self) -> Option<f32> {
        self.0.motor_temperature_c
    }

    #[getter]
    fn driver_temperature_c(&self) -> Option<f32> {
        self.0.driver_temperature_c
    }

    #[getter]
    fn faults_raw(&self) -> Option<u16> {
        self.0.faults
    }

    fn __repr__(&self) -> String {
        let Self(state) = self;
        let reading = |name: &str, value: Option<f32>| {
            value.map(|value| format!(", {name}={value}")).unwrap_or_default()
        };
        format!(
            "CycleState(axis={}, state='{}', result='{}'{}{}{})",
            state.axis,
            self.state(),
            self.result(),
            reading("position_rad", state.position_rad),
            reading("velocity_rad_s", state.velocity_rad_s),
            reading("current_a", state.current_a),
        )
    }
}

/// One period of a free-running cycle.
#[pyclass(frozen, get_all, module = "motor_gateway", name = "CyclePeriod")]
pub struct Period {
    period: u32,
    time_us: u64,
    due_us: u32,
    late_us: u32,
    jitter_us: u32,
    took_us: u32,
    dropped: u32,
    overruns: Py<PyDict>,
    states: Vec<Py<State>>,
    slow: Option<Py<PyAny>>,
}

impl Period {
    pub fn new(py: Python<'_>, message: &CycleMessage) -> PyResult<Self> {
        let event = &message.event;
        let overruns = PyDict::new(py);
        overruns.set_item("bus", event.overruns.bus)?;
        overruns.set_item("motor", event.overruns.motor)?;
        overruns.set_item("host", event.overruns.host)?;
        overruns.set_item("gateway", event.overruns.gateway)?;
        let slow = event.slow.as_ref().map(programs::slow_state);
        Ok(Self {
            period: event.period,
            time_us: message.time_us,
            due_us: event.due_us.0,
            late_us: event.late_us,
            jitter_us: event.jitter_us,
            took_us: event.took_us,
            dropped: message.dropped,
            overruns: overruns.unbind(),
            states: event
                .states()
                .map(|state| Py::new(py, State(state)))
                .collect::<PyResult<_>>()?,
            slow: slow.map(|slow| to_python(py, &slow).map(Bound::unbind)).transpose()?,
        })
    }
}

#[pymethods]
impl Period {
    fn __repr__(&self) -> String {
        format!("CyclePeriod(period={}, {} axes)", self.period, self.states.len())
    }
}

/// The states as records of 36 bytes, one behind the other: `arrays.py` knows their layout.
#[pyfunction]
pub fn state_records<'py>(py: Python<'py>, states: Vec<PyRef<'py, State>>) -> Bound<'py, PyBytes> {
    let mut out = Vec::new();
    states.iter().for_each(|state| state.put(&mut out));
    PyBytes::new(py, &out)
}

/// The states of periods, likewise, each behind 24 bytes of its period.
#[pyfunction]
pub fn period_records<'py>(
    py: Python<'py>,
    periods: Vec<PyRef<'py, Period>>,
) -> Bound<'py, PyBytes> {
    let mut out = Vec::new();
    for period in &periods {
        for state in &period.states {
            out.extend(period.time_us.to_le_bytes());
            for number in [period.period, period.late_us, period.jitter_us, period.took_us] {
                out.extend(number.to_le_bytes());
            }
            state.get().put(&mut out);
        }
    }
    PyBytes::new(py, &out)
}

fn check_finite(name: &str, value: f32) -> PyResult<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(usage(&format!("{name} is a finite number, not {value}")))
}

/// The functions that make setpoints, named as in the client library.
macro_rules! setpoints {
    ($($(#[$doc:meta])+ $name:ident($($argument:ident),+);)+) => {
        $(
            $(#[$doc])+
            #[pyfunction]
            pub fn $name(axis: AxisNumber, $($argument: f32),+) -> PyResult<Setpoint> {
                $(check_finite(stringify!($argument), $argument)?;)+
                Ok(Setpoint(mgw_client::$name(axis.0, $($argument),+)))
            }
        )+
    };
}

setpoints! {
    /// A fraction of the full signal, −1 to 1: thrusters.
    make_signal(fraction);
    /// A current, A.
    make_current(current_a);
    /// A velocity, rad/s.
    make_velocity(velocity_rad_s);
    /// A position, rad, and the speed limit on the way, rad/s.
    make_position(position_rad, speed_limit_rad_s);
    /// A spring and a damper: RMD on CAN.
    make_impedance(
        position_rad, velocity_rad_s, stiffness_nm_per_rad, damping_nm_s_per_rad, torque_nm
    );
}
