//! What a Python program may ask of a session.

use std::ops::ControlFlow;
use std::process;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use host_protocol::{ClearTarget, MAX_CYCLE_AXES, StateFields};
use mgw_cli::programs::{self, Motors, Native};
use mgw_client::{AxisSetpoint, Client, ClientError, Hold};
use parking_lot::Mutex;
use pyo3::prelude::*;
use serde_json::{Value, json};

use super::{
    ASKED_E_STOP, ASKED_STOP, AxisStop, Inner, NO_TURN, Session, is_main_thread, seconds,
    this_thread,
};
use crate::json::to_python;
use crate::problem::{Failed, found, of_stop, usage};
use crate::values::{AxisNumber, Fields, Period, Setpoint, State};

/// Of a native command that moves nothing.
const NO_EPOCH: u32 = 0;
/// How long the end of a session waits for a call of another thread, which it has interrupted.
const PATIENCE: Duration = Duration::from_secs(5);

#[pymethods]
impl Session {
    /// Whether it has been closed.
    #[getter]
    fn closed(&self) -> bool {
        self.closed.load(Ordering::Acquire)
    }

    /// The process that opened it.
    #[getter]
    fn process(&self) -> u32 {
        self.process
    }

    /// The transport's time, s.
    fn now(&self, py: Python<'_>) -> PyResult<f64> {
        self.run(py, |client| Ok(client.now().as_secs_f64()))
    }

    /// The best guess of the gateway's time, µs.
    fn gateway_now_us(&self, py: Python<'_>) -> PyResult<u64> {
        self.run(py, |client| Ok(client.gateway_now_us()))
    }

    /// Lets time pass; sends nothing.
    fn pause(&self, py: Python<'_>, duration_s: f64) -> PyResult<()> {
        self.await_one(py, duration_s, |client, left| client.pause(left).map(|()| None::<()>))?;
        Ok(())
    }

    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, _| {
            let (status, stored) = (client.gateway_status()?, client.read_stored()?);
            let image = client.image()?;
            Ok(programs::info(client.hello(), &status, &stored, &image))
        })
    }

    fn bus<'py>(&self, py: Python<'py>, bus: u8) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, _| Ok(programs::bus(bus, &client.bus_status(bus)?)))
    }

    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, _| Ok(client.list_axes()?.iter().map(programs::axis).collect()))
    }

    fn incidents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, motors| {
            let incidents = client.incidents()?;
            Ok(incidents.iter().map(|incident| programs::incident(incident, motors)).collect())
        })
    }

    fn losses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, _| {
            let losses = client.losses();
            Ok(json!({
                "damaged": losses.damaged, "late": losses.late,
                "events_lost": losses.events_lost, "events_dropped": losses.events_dropped,
                "unreadable": losses.unreadable,
            }))
        })
    }

    fn read_state<'py>(&self, py: Python<'py>, axis: AxisNumber) -> PyResult<Bound<'py, PyAny>> {
        self.json(py, |client, motors| {
            Ok(programs::state(&client.read_state_when_free(axis.0)?, motors))
        })
    }

    /// Arms one axis, or several together. The epoch, and how long a setpoint may be valid, s.
    fn arm(&self, py: Python<'_>, axes: Vec<AxisNumber>) -> PyResult<(u32, f64)> {
        check_count("arm", MAX_CYCLE_AXES, "axes", axes.len())?;
        let axes = numbers(&axes);
        self.run(py, |client| {
            let mut ttl = Duration::MAX;
            for axis in &axes {
                ttl = ttl.min(client.axis_ttl(*axis)?);
            }
            let epoch = match axes.as_slice() {
                [axis] => client.arm(*axis)?.epoch,
                axes => client.arm_together(axes)?,
            };
            Ok((epoch, ttl.as_secs_f64()))
        })
    }

    fn set(&self, py: Python<'_>, epoch: u32, setpoint: &Setpoint, ttl_s: f64) -> PyResult<()> {
        let (AxisSetpoint { axis, setpoint }, ttl) = (setpoint.0, ttl(ttl_s)?);
        self.run(py, |client| Ok(client.set(axis, epoch, setpoint, ttl)?))
    }

    fn cycle(
        &self,
        py: Python<'_>,
        epoch: u32,
        setpoints: Vec<PyRef<'_, Setpoint>>,
        fields: Fields,
        ttl_s: f64,
    ) -> PyResult<Vec<State>> {
        check_count("cycle", MAX_CYCLE_AXES, "setpoints", setpoints.len())?;
        let ttl = ttl(ttl_s)?;
        let setpoints: Vec<AxisSetpoint> = setpoints.iter().map(|of| of.0).collect();
        let states = self.run(py, |client| Ok(client.cycle(epoch, &setpoints, fields.0, ttl)?))?;
        Ok(states.into_iter().map(State::new).collect())
    }

    /// Keeps setpoints in force for as long as this call takes.
    fn hold(
        &self,
        py: Python<'_>,
        epoch: u32,
        setpoints: Vec<PyRef<'_, Setpoint>>,
        ttl_s: f64,
        duration_s: f64,
    ) -> PyResult<()> {
        check_count("hold", AxisNumber::COUNT, "setpoints", setpoints.len())?;
        let (ttl, duration) = (ttl(ttl_s)?, seconds(duration_s)?);
        let hold = |of: &PyRef<'_, Setpoint>| {
            let AxisSetpoint { axis, setpoint } = of.0;
            Hold { axis, epoch, setpoint, ttl }
        };
        let holds: Vec<Hold> = setpoints.iter().map(hold).collect();
        let twice = |held: &&Hold| holds.iter().filter(|of| of.axis == held.axis).count() > 1;
        if let Some(Hold { axis, .. }) = holds.iter().find(twice) {
            return Err(Failed::from(ClientError::NamedTwice { axis: *axis }).into());
        }
        self.run(py, |client| {
            let each_round = |client: &mut Inner| {
                self.send_waiting(client);
                Ok(ControlFlow::Continue(()))
            };
            // Said before it is looked whether it may: who ends it does so the other way round.
            self.holds.store(true, Ordering::SeqCst);
            let held = if self.may_hold() {
                client.hold_setpoints(&holds, duration, each_round).map_err(Failed::from)
            } else {
                client.stop_armed().map_err(of_stop).and(Err(Failed::Interrupted))
            };
            self.holds.store(false, Ordering::SeqCst);
            held
        })
    }

    /// What is asked for from now on is a turn of that number, 0 for none.
    fn begin_turn(&self, turn: u64) {
        self.turn.store(turn, Ordering::SeqCst);
    }

    /// Ends the hold that a turn has under way, with a stop of what is armed here, and every one
    /// that it comes to; its other calls go on.
    fn end_holds(&self, py: Python<'_>, turn: u64) -> PyResult<()> {
        self.ended_turn.store(turn, Ordering::SeqCst);
        if self.may_hold() || !self.holds.load(Ordering::SeqCst) {
            return Ok(());
        }
        self.run_when(py, true, |client| {
            // It may have ended by itself meanwhile.
            client.stop_armed().and_then(|()| client.resume()).map_err(of_stop)
        })
    }

    fn move_relative(
        &self,
        py: Python<'_>,
        epoch: u32,
        axis: AxisNumber,
        distance_rad: f32,
        speed_limit_rad_s: f32,
        ttl_s: f64,
    ) -> PyResult<(f32, f32)> {
        let ttl = ttl(ttl_s)?;
        self.run(py, |client| {
            let target =
                client.move_relative(axis.0, epoch, distance_rad, speed_limit_rad_s, ttl)?;
            Ok((target.start_rad, target.target_rad))
        })
    }

    fn run_cycle(
        &self,
        py: Python<'_>,
        axes: Vec<AxisNumber>,
        fields: Fields,
        period_s: f64,
    ) -> PyResult<()> {
        check_count("run_cycle", MAX_CYCLE_AXES, "axes", axes.len())?;
        let period = seconds(period_s)?;
        self.run(py, |client| Ok(client.run_cycle(&numbers(&axes), fields.0, period)?))
    }

    fn end_cycle(&self, py: Python<'_>) -> PyResult<()> {
        // Of no axis; a period has to be one all the same.
        const PERIOD: Duration = Duration::from_millis(1);
        self.run(py, |client| Ok(client.run_cycle(&[], StateFields::NONE, PERIOD)?))
    }

    fn poll_cycle(&self, py: Python<'_>, timeout_s: f64) -> PyResult<Option<Period>> {
        let message = self.await_one(py, timeout_s, Client::poll_cycle)?;
        message.map(|message| Period::new(py, &message)).transpose()
    }

    fn subscribe(
        &self,
        py: Python<'_>,
        axes: Vec<AxisNumber>,
        fields: Fields,
        period_s: f64,
    ) -> PyResult<()> {
        check_count("subscribe", AxisNumber::COUNT, "axes", axes.len())?;
        let period = seconds(period_s)?;
        self.run(py, |client| Ok(client.subscribe(&numbers(&axes), fields.0, period)?))
    }

    fn poll_event<'py>(
        &self,
        py: Python<'py>,
        timeout_s: f64,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let message = self.await_one(py, timeout_s, Client::poll_event)?;
        let motors = self.motors.lock();
        message.map(|message| to_python(py, &programs::event(&message, &motors))).transpose()
    }

    /// Stops every axis; it ends the call that another thread has under way.
    fn stop_all(&self, py: Python<'_>) -> PyResult<()> {
        self.stop_now(py, ASKED_STOP)
    }

    /// The emergency stop, likewise.
    fn estop(&self, py: Python<'_>) -> PyResult<()> {
        self.stop_now(py, ASKED_E_STOP)
    }

    /// Makes a configuration, the text of a file, that of the gateway: how many changes, and how
    /// many motor timeouts were written.
    fn configure(
        &self,
        py: Python<'_>,
        path: Option<&str>,
        text: &str,
        merge: bool,
    ) -> PyResult<(usize, usize)> {
        let (done, motors) = self.run(py, |client| {
            let done = programs::configure(client, path, text, merge)?;
            Ok((done, Motors::new(&client.list_axes()?)))
        })?;
        *self.motors.lock() = motors;
        Ok((done.changes, done.motor_timeouts_written))
    }

    fn configuration<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = self.run(py, |client| Ok(programs::configuration(client)?))?;
        let value: Value = toml::from_str(&text).map_err(|error| unreadable(&error))?;
        to_python(py, &value)
    }

    /// A command of the motor's manual by name; what moves takes an epoch, and is valid for
    /// `ttl_s`.
    fn native<'py>(
        &self,
        py: Python<'py>,
        axis: AxisNumber,
        command: &str,
        fields: Vec<(String, String)>,
        epoch: u32,
        ttl_s: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let ttl = if epoch == NO_EPOCH { Duration::ZERO } else { ttl(ttl_s)? };
        self.json(py, |client, _| {
            let native = Native::new(client, axis.0, command, fields)?;
            Ok(native.send(client, epoch, ttl)?)
        })
    }

    /// Ends an axis's permission to move, and the call of another thread that keeps it moving.
    fn disarm(&self, py: Python<'_>, axis: AxisNumber) -> PyResult<()> {
        self.run_when(py, true, |client| {
            client.resume()?;
            Ok(client.disarm(axis.0)?)
        })
    }

    /// Stops one axis; the hold that another thread has under way sends it, and goes on with its
    /// others.
    fn stop_axis(&self, py: Python<'_>, axis: AxisNumber) -> PyResult<()> {
        self.check_process()?;
        let looks = is_main_thread(py)?;
        let stop = Arc::new(AxisStop { axis: axis.0, outcome: Mutex::default() });
        self.stops.lock().push(stop.clone());
        let sent = py.detach(|| self.send(&stop, looks));
        self.stops.lock().retain(|of| !Arc::ptr_eq(of, &stop));
        Ok(sent?)
    }

    fn clear(&self, py: Python<'_>, axis: Option<AxisNumber>) -> PyResult<()> {
        self.run(py, |client| Ok(client.clear(clear_target(axis))?))
    }

    fn clear_unreachable(&self, py: Python<'_>, axis: AxisNumber) -> PyResult<()> {
        self.run(py, |client| Ok(client.clear_unreachable(axis.0)?))
    }

    fn clear_by_restart(&self, py: Python<'_>, axis: AxisNumber) -> PyResult<()> {
        self.run(py, |client| Ok(client.clear_by_restart(axis.0)?))
    }

    fn output_off(&self, py: Python<'_>, axis: AxisNumber) -> PyResult<()> {
        self.run(py, |client| Ok(client.output_off(axis.0)?))
    }

    fn take_authority(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.take_authority()?))
    }

    fn release_authority(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.release_authority()?))
    }

    fn save_configuration(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.save_configuration()?))
    }

    fn forget_stored(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.forget_stored()?))
    }

    fn keep_subscription(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.keep_subscription()?))
    }

    fn unsubscribe(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.unsubscribe()?))
    }

    fn ping(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.ping()?))
    }

    fn reconnect(&self, py: Python<'_>) -> PyResult<()> {
        self.run(py, |client| Ok(client.reconnect()?))
    }

    /// Stops what was armed here, lets others command, and ends the connection. The call that
    /// another thread has under way ends.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        if self.process != process::id() {
            return Ok(());
        }
        self.closed.store(true, Ordering::Release);
        self.signals.interrupt.raise();
        if self.owner.load(Ordering::Acquire) == this_thread() {
            // In a signal handler: the call under way stops what is armed when this returns.
            return Ok(());
        }
        let ended = py.detach(|| {
            let Some(mut client) = self.client.try_lock_for(PATIENCE) else {
                let text = "another thread is in the middle of a call, and did not end it; what it \
                    does not say again the gateway stops";
                return Err(found("Busy", text));
            };
            let Some(mut inner) = client.take() else { return Ok(()) };
            inner.transport_mut().begin(false);
            // Whoever was stopped in mid-call has been; this stops each axis that still is armed.
            let stopped = inner.stop_armed().and_then(|()| inner.resume());
            if stopped.is_ok() {
                // Refused where another host is in command, and that is well.
                let _ = inner.release_authority();
            }
            stopped.map_err(of_stop)
        });
        Ok(ended?)
    }
}

impl Session {
    fn may_hold(&self) -> bool {
        let turn = self.turn.load(Ordering::SeqCst);
        turn == NO_TURN || turn != self.ended_turn.load(Ordering::SeqCst)
    }
}

fn unreadable(error: &toml::de::Error) -> Failed {
    found("Configuration", &error.to_string())
}

/// How long a setpoint is valid, from a program, s.
fn ttl(value: f64) -> PyResult<Duration> {
    const SHORTEST: Duration = Duration::from_micros(1);
    let ttl = seconds(value)?;
    if ttl < SHORTEST {
        return Err(usage(&format!("a ttl is 0.000001 s or more, not {value}")));
    }
    Ok(ttl)
}

/// As many as a request takes.
fn check_count(call: &str, most: usize, what: &str, count: usize) -> PyResult<()> {
    if (1..=most).contains(&count) {
        return Ok(());
    }
    Err(usage(&format!("{call} takes 1 to {most} {what}, not {count}")))
}

fn numbers(axes: &[AxisNumber]) -> Vec<u8> {
    axes.iter().map(|axis| axis.0).collect()
}

fn clear_target(axis: Option<AxisNumber>) -> ClearTarget {
    axis.map_or(ClearTarget::Gateway, |axis| ClearTarget::Axis(axis.0))
}
