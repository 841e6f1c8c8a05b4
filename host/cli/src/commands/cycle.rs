//! `mgw cycle`

use std::collections::BTreeMap;
use std::time::Duration;

use gateway::PERIOD_US;
use host_protocol::{
    AxisState, CycleMessage, CycleState, FaultReading, MAX_CYCLE_AXES, Overruns, Quantity, Reading,
    SlowState, StateField, StateFields,
};
use mgw_client::{Client, Hold, Round, Transport};
use serde_json::json;

use super::arm::while_armed;
use super::drive::{ArmedAxis, end_of_hold, no_longer_armed, refuse_twice, round};
use super::limits;
use crate::args::{CycleArgs, CycleTarget};
use crate::explain::Page;
use crate::failure::Failure;
use crate::json;
use crate::output::Output;
use crate::session::{EVENTS_AT_ONCE, Session, print_events};
use crate::states;
use crate::table::Table;
use crate::words::{self, or_nothing};

/// Between two printed periods.
const PRINT_EVERY: Duration = Duration::from_millis(200);
const HEADINGS: [&str; 4] = [">period", ">axis", "state", "setpoint"];

/// Arms axes, has the gateway drive them in a period of its own, prints how they are, and stops
/// them.
pub fn run(session: &mut Session, arguments: &CycleArgs) -> Result<(), Failure> {
    let targets = CycleTarget::all(&arguments.words, |axis| session.axis(axis))?;
    let axes: Vec<u8> = targets.iter().map(|target| target.axis).collect();
    refuse_twice(&axes)?;
    if axes.len() > MAX_CYCLE_AXES {
        let text =
            format!("one cycle has at most {MAX_CYCLE_AXES} axes, and these are {}", axes.len());
        return Err(Failure::Usage(text));
    }
    if !(arguments.rate.is_finite() && arguments.rate > 0.0) {
        return Err(Failure::Usage("--rate takes a number of Hz above 0".to_owned()));
    }
    for CycleTarget { axis, setpoint } in &targets {
        limits::check_setpoint(session, *axis, *setpoint)?;
    }
    // What is too long for a `Duration` is too long for the gateway. Nothing is armed for a period
    // that it would refuse.
    let period = Duration::try_from_secs_f64(1.0 / arguments.rate).unwrap_or(Duration::MAX);
    let period_us = u32::try_from(period.as_micros()).unwrap_or(u32::MAX);
    Quantity::Period.check(period_us, PERIOD_US).map_err(limits::refusal)?;
    let fields = StateFields::of(&arguments.fields);
    let mut periods = Periods::new(session, fields);
    let ended = while_armed(session, &axes, |session, armed| {
        session.client.run_cycle(&axes, fields, period)?;
        let holds = armed.iter().zip(&targets).map(|(armed, target)| armed.hold(target.setpoint));
        let holds: Vec<Hold> = holds.collect();
        let duration = arguments.seconds.unwrap_or(Duration::MAX);
        let held =
            session.client.hold_setpoints(&holds, duration, |client| periods.turn(client, armed));
        periods.failure.take().map_or_else(|| end_of_hold(held), Err)
    });
    ended.and(periods.tell_end(session))
}

/// What was told of the periods so far.
struct Periods {
    out: Output,
    fields: StateFields,
    /// When one is printed next.
    next: Duration,
    widths: Vec<usize>,
    /// How many were told of, and the last of them.
    told: u64,
    last: Option<CycleMessage>,
    /// What was told last of each axis in turns, and when, µs.
    slow: BTreeMap<u8, (SlowState, u64)>,
    latest_us: u32,
    failure: Option<Failure>,
}

impl Periods {
    fn new(session: &Session, fields: StateFields) -> Self {
        Self {
            out: session.out,
            fields,
            next: session.client.now(),
            widths: Vec::new(),
            told: 0,
            last: None,
            slow: BTreeMap::new(),
            latest_us: 0,
            failure: None,
        }
    }

    /// One round of the hold.
    fn turn<T: Transport>(&mut self, client: &mut Client<T>, armed: &[ArmedAxis]) -> Round {
        let looked = self.look(client, armed);
        round(looked, &mut self.failure)
    }

    /// Takes what was told, prints one of it from time to time; why it cannot go on.
    fn look<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        armed: &[ArmedAxis],
    ) -> Result<Option<Failure>, Failure> {
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = client.poll_cycle(Duration::ZERO)? else { break };
            self.told += 1;
            self.latest_us = self.latest_us.max(message.event.late_us);
            self.slow.extend(message.event.slow.map(|slow| (slow.axis, (slow, message.time_us))));
            self.last = Some(message);
        }
        let axes: Vec<u8> = armed.iter().map(|armed| armed.axis).collect();
        if let Some(tripped) = print_events(client, &axes, self.out)? {
            return Ok(Some(tripped));
        }
        let Some(message) = self.last.clone().filter(|_| client.now() >= self.next) else {
            return Ok(None);
        };
        self.next = client.now() + PRINT_EVERY;
        self.print(&message)?;
        let is_armed = |state| matches!(state, AxisState::Armed | AxisState::Active);
        let lost =
            message.event.states().find(|state| !is_armed(state.state)).map(|state| state.axis);
        let Some(lost) = armed.iter().find(|armed| Some(armed.axis) == lost) else {
            return Ok(None);
        };
        let report = client.read_state_when_free(lost.axis)?;
        Ok(no_longer_armed(&report, lost.epoch, self.out.motors))
    }

    fn print(&mut self, message: &CycleMessage) -> Result<(), Failure> {
        let slow: BTreeMap<u8, SlowState> = self
            .slow
            .iter()
            .map(|(axis, (slow, told_us))| {
                (*axis, aged(slow, message.time_us.saturating_sub(*told_us)))
            })
            .collect();
        let headings = self.fields.iter().map(states::heading);
        let headings: Vec<&str> = HEADINGS.into_iter().chain(headings).collect();
        let mut table = Table::new(&headings);
        for state in message.event.states() {
            let slow = slow.get(&state.axis);
            let mut row = vec![
                message.event.period.to_string(),
                state.axis.to_string(),
                words::axis_state(state.state).to_owned(),
                state.result.to_string(),
            ];
            row.extend(self.fields.iter().map(|field| cell(field, &state, slow)));
            table.row(row);
        }
        let skipped = usize::from(!self.widths.is_empty());
        for line in table.lines_in(&mut self.widths).iter().skip(skipped) {
            self.out.text(line)?;
        }
        let mut value = json::line("period", json::cycle::period(&message.event));
        let motors = self.out.motors;
        value["slow"] =
            slow.values().map(|slow| json::axis::slow(slow, motors.of(slow.axis))).collect();
        self.out.object(&value)
    }

    /// How it went.
    fn tell_end(&self, session: &Session) -> Result<(), Failure> {
        let Some(last) = &self.last else { return Ok(()) };
        let last = &last.event;
        let Overruns { bus, motor, host, gateway } = last.overruns;
        let text = format!(
            "{} of {} periods told; the latest began {} µs late, jitter {} µs; longer than they \
             should be: {bus} for a bus, {motor} for a motor, {gateway} for the gateway; {host} \
             lost on the way to the host",
            self.told,
            u64::from(last.period) + 1,
            self.latest_us,
            last.jitter_us,
        );
        let has_overruns = [bus, motor, host, gateway].iter().any(|count| *count > 0);
        let text = if has_overruns { format!("{text} {}", Page::Overruns) } else { text };
        let mut fields = json::cycle::period(last);
        json::extend(&mut fields, json!({ "told": self.told, "latest_us": self.latest_us }));
        session.out.event("cycle_ended", text, fields)
    }
}

/// What was told of an axis in turns, so much later.
fn aged(slow: &SlowState, since_us: u64) -> SlowState {
    let since_us = u32::try_from(since_us).unwrap_or(u32::MAX);
    let aged = |age_us: u32| age_us.saturating_add(since_us);
    let reading = |of: Reading| Reading { age_us: aged(of.age_us), ..of };
    SlowState {
        axis: slow.axis,
        voltage_v: slow.voltage_v.map(reading),
        motor_temperature_c: slow.motor_temperature_c.map(reading),
        driver_temperature_c: slow.driver_temperature_c.map(reading),
        faults: slow.faults.map(|of| FaultReading { age_us: aged(of.age_us), ..of }),
    }
}

/// A field of an axis.
fn cell(field: StateField, state: &CycleState, slow: Option<&SlowState>) -> String {
    let fast = |value: Option<f32>| or_nothing(value.map(|value| format!("{value:.3}")));
    let slow_reading =
        |of: fn(&SlowState) -> Option<Reading>| states::reading(field, slow.and_then(of));
    match field {
        StateField::Position => fast(state.position_rad),
        StateField::Velocity => fast(state.velocity_rad_s),
        StateField::Current => fast(state.current_a),
        StateField::Voltage => slow_reading(|slow| slow.voltage_v),
        StateField::MotorTemperature => slow_reading(|slow| slow.motor_temperature_c),
        StateField::DriverTemperature => slow_reading(|slow| slow.driver_temperature_c),
        StateField::Faults => states::faults(slow.and_then(|slow| slow.faults)),
    }
}
