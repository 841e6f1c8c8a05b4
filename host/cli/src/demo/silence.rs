//! The last part: the host says nothing any more.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::{AxisState, Event, Trip};
use mgw_client::Client;
use mgw_sim::{MotorEvent, SimTransport, Station, World};
use serde_json::json;

use super::setup::heading;
use super::trace::{self, Decoded, Trace};
use crate::failure::Failure;
use crate::json;
use crate::output::Output;
use crate::table::Table;
use crate::words::{self, or_nothing};

/// How long the host is silent.
const SILENCE: Duration = Duration::from_secs(3);

/// How an axis stopped.
pub struct Stop {
    pub axis: u8,
    trip: Option<Trip>,
    /// From the trip to the first stop on the bus, and to the confirmation, µs; as the gateway
    /// says.
    confirmed: Option<(u32, u32)>,
    /// State at the end.
    state: AxisState,
    /// When the shaft came to rest, as the motor's own log says, µs.
    at_rest_us: Option<u64>,
}

impl Stop {
    /// Whether the gateway says it is stopped, and the motor too.
    pub fn is_proven(&self) -> bool {
        self.trip.is_some()
            && self.confirmed.is_some()
            && self.state == AxisState::Tripped { confirmed: true }
            && self.at_rest_us.is_some()
    }
}

/// Lets time pass without the host, and shows what became of each axis.
pub fn run(
    client: &mut Client<SimTransport>,
    world: &Rc<RefCell<World>>,
    trace: &mut Trace,
    axes: &[u8],
    out: Output,
) -> Result<Vec<Stop>, Failure> {
    let silent_from_us = world.borrow().now().as_micros();
    heading(out, "5. The host falls silent")?;
    out.text(format!("t={}  last word of the host", words::seconds(silent_from_us)))?;
    world.borrow_mut().run_for(SILENCE);

    let mut stops: Vec<Stop> = axes.iter().map(|axis| Stop::unknown(*axis)).collect();
    while let Some(message) = client.poll_event(Duration::ZERO)? {
        if message.time_us < silent_from_us {
            continue;
        }
        if !matches!(message.event, Event::StateChanged { .. }) {
            out.text(words::event(&message, &out.motors))?;
            out.object(&crate::json::event(&message, &out.motors))?;
        }
        note(&mut stops, &message.event);
    }
    for stop in &mut stops {
        stop.state = client.read_state(stop.axis)?.state;
        stop.at_rest_us = at_rest(&world.borrow(), stop.axis, silent_from_us);
    }

    out.text("")?;
    print(&stops, silent_from_us, out)?;
    out.text("")?;
    out.text("the first stop of each motor on its bus")?;
    trace::print(first_stops(trace.collect(world), silent_from_us).into_iter(), out)?;
    out.text("")?;
    out.text("the motors' own logs until they stand still; the gateway has no hand in them")?;
    print_motor_logs(&world.borrow(), &stops, silent_from_us, out)?;
    Ok(stops)
}

impl Stop {
    fn unknown(axis: u8) -> Self {
        Self { axis, trip: None, confirmed: None, state: AxisState::Unconfigured, at_rest_us: None }
    }
}

fn note(stops: &mut [Stop], event: &Event) {
    match event {
        Event::Tripped { axis, trip } => {
            if let Some(stop) = stops.iter_mut().find(|stop| stop.axis == *axis) {
                stop.trip = Some(*trip);
            }
        }
        Event::StopConfirmed { axis, reaction_us, elapsed_us, .. } => {
            if let Some(stop) = stops.iter_mut().find(|stop| stop.axis == *axis) {
                stop.confirmed.get_or_insert((*reaction_us, *elapsed_us));
            }
        }
        _ => {}
    }
}

/// When the shaft of a motor came to rest and stayed there, by its own log. The motors are wired in
/// the order of the axes.
fn at_rest(world: &World, axis: u8, from_us: u64) -> Option<u64> {
    let last = world.motor(usize::from(axis)).log().entries().rfind(|entry| {
        entry.time_us >= from_us
            && matches!(entry.what, MotorEvent::Moving { .. } | MotorEvent::Stopped { .. })
    })?;
    matches!(last.what, MotorEvent::Stopped { .. }).then_some(last.time_us)
}

fn print(stops: &[Stop], silent_from_us: u64, out: Output) -> Result<(), Failure> {
    let mut table = Table::new(&[
        ">axis",
        "tripped because",
        ">after silence of ms",
        ">trip to first stop on the bus ms",
        ">trip to confirmation ms",
        ">silence to standstill ms",
        "state",
    ]);
    let since = |time_us: u64| milliseconds(time_us.saturating_sub(silent_from_us));
    for stop in stops {
        table.row([
            stop.axis.to_string(),
            or_nothing(
                stop.trip.map(|trip| words::trip_reason(&trip.reason, out.motors.of(stop.axis))),
            ),
            or_nothing(stop.trip.map(|trip| since(trip.time_us))),
            or_nothing(stop.confirmed.map(|(reaction, _)| milliseconds(reaction.into()))),
            or_nothing(stop.confirmed.map(|(_, elapsed)| milliseconds(elapsed.into()))),
            or_nothing(stop.at_rest_us.map(since)),
            words::axis_state(stop.state).to_owned(),
        ]);
        let mut fields = json::axis::in_state(stop.axis, stop.state);
        let trip = stop.trip.as_ref().map(|trip| json::axis::trip(trip, out.motors.of(stop.axis)));
        json::extend(
            &mut fields,
            json!({
                "trip": trip,
                "reaction_us": stop.confirmed.map(|(reaction, _)| reaction),
                "confirmed_us": stop.confirmed.map(|(_, elapsed)| elapsed),
                "motor_at_rest_us": stop.at_rest_us,
            }),
        );
        out.object(&json::line("axis_stopped", fields))?;
    }
    out.table(&table)
}

fn milliseconds(span_us: u64) -> String {
    let span = Duration::from_micros(span_us);
    format!("{:.3}", span.as_secs_f64() * 1e3)
}

fn first_stops(frames: &[Decoded], from_us: u64) -> Vec<&Decoded> {
    let mut seen = Vec::new();
    let is_first = |decoded: &&Decoded| {
        let Some(meaning) = decoded.meaning.as_ref().filter(|meaning| meaning.is_stop) else {
            return false;
        };
        let motor = (decoded.entry.bus, meaning.motor.clone());
        let first = decoded.entry.from == Station::Gateway
            && decoded.entry.time_us >= from_us
            && !seen.contains(&motor);
        if first {
            seen.push(motor);
        }
        first
    };
    frames.iter().filter(is_first).collect()
}

fn print_motor_logs(
    world: &World,
    stops: &[Stop],
    from_us: u64,
    out: Output,
) -> Result<(), Failure> {
    for Stop { axis, at_rest_us, .. } in stops {
        let motor = world.motor(usize::from(*axis));
        let until_us = at_rest_us.unwrap_or(u64::MAX);
        for entry in
            motor.log().entries().filter(|entry| (from_us..=until_us).contains(&entry.time_us))
        {
            out.event(
                "motor_log",
                format!(
                    "t={}  axis {axis}  {motor}  {}",
                    words::seconds(entry.time_us),
                    entry.what
                ),
                json!({
                    "axis": axis, "time_us": entry.time_us, "message": entry.what.to_string()
                }),
            )?;
        }
    }
    Ok(())
}
