//! `mgw cycle`

use std::time::Duration;

use gateway::PERIOD_US;
use host_protocol::{AxisState, CycleEvent, MAX_CYCLE_AXES, Overruns, Quantity, StateFields};
use mgw_client::{Client, Hold, Round, Transport};
use serde_json::json;

use super::arm::while_armed;
use super::drive::{ArmedAxis, no_longer_armed, refuse_twice, round, tell_stopped};
use super::limits;
use crate::args::{CycleArgs, CycleTarget};
use crate::explain::Page;
use crate::failure::Failure;
use crate::json;
use crate::output::Output;
use crate::session::{EVENTS_AT_ONCE, Session, print_events};
use crate::table::Table;
use crate::words::{self, or_nothing};

/// Between two printed periods.
const PRINT_EVERY: Duration = Duration::from_millis(200);
const HEADINGS: [&str; 7] =
    [">period", ">axis", "state", "setpoint", ">position rad", ">velocity rad/s", ">current A"];

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
    let mut periods = Periods::new(session);
    let stopped = while_armed(session, &axes, |session, armed| {
        session.client.run_cycle(&axes, StateFields::of(&arguments.fields), period)?;
        let with_setpoint = |(armed, target): (&ArmedAxis, &CycleTarget)| {
            let ArmedAxis { axis, epoch, ttl } = *armed;
            Hold { axis, epoch, setpoint: target.setpoint, ttl }
        };
        let holds: Vec<Hold> = armed.iter().zip(&targets).map(with_setpoint).collect();
        let duration = arguments.seconds.unwrap_or(Duration::MAX);
        let held =
            session.client.hold_setpoints(&holds, duration, |client| periods.turn(client, armed));
        periods.failure.take().map_or(held.map_err(Failure::from), Err)
    });
    let told = periods.tell_end(session);
    let stopped = stopped?;
    told?;
    stopped.iter().try_for_each(|report| tell_stopped(session, report))
}

/// What was told of the periods so far.
struct Periods {
    out: Output,
    /// When one is printed next.
    next: Duration,
    widths: Vec<usize>,
    /// How many were told of, and the last of them.
    told: u64,
    last: Option<CycleEvent>,
    latest_us: u32,
    failure: Option<Failure>,
}

impl Periods {
    fn new(session: &Session) -> Self {
        let (out, next) = (session.out, session.client.now());
        Self { out, next, widths: Vec::new(), told: 0, last: None, latest_us: 0, failure: None }
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
            self.last = Some(message.event);
        }
        let axes: Vec<u8> = armed.iter().map(|armed| armed.axis).collect();
        if let Some(tripped) = print_events(client, &axes, self.out)? {
            return Ok(Some(tripped));
        }
        let Some(event) = self.last.clone().filter(|_| client.now() >= self.next) else {
            return Ok(None);
        };
        self.next = client.now() + PRINT_EVERY;
        self.print(&event)?;
        let is_armed = |state| matches!(state, AxisState::Armed | AxisState::Active);
        let lost = event.states().find(|state| !is_armed(state.state)).map(|state| state.axis);
        let Some(lost) = armed.iter().find(|armed| Some(armed.axis) == lost) else {
            return Ok(None);
        };
        let report = client.read_state_when_free(lost.axis)?;
        Ok(no_longer_armed(&report, lost.epoch, self.out.motors))
    }

    fn print(&mut self, event: &CycleEvent) -> Result<(), Failure> {
        let mut table = Table::new(&HEADINGS);
        let cell = |value: Option<f32>| or_nothing(value.map(|value| format!("{value:.3}")));
        for state in event.states() {
            table.row([
                event.period.to_string(),
                state.axis.to_string(),
                words::axis_state(state.state).to_owned(),
                state.result.to_string(),
                cell(state.position_rad),
                cell(state.velocity_rad_s),
                cell(state.current_a),
            ]);
        }
        let skipped = usize::from(!self.widths.is_empty());
        for line in table.lines_in(&mut self.widths).iter().skip(skipped) {
            self.out.text(line)?;
        }
        self.out.object(&json::line("period", json::cycle::period(event)))
    }

    /// How it went.
    fn tell_end(&self, session: &Session) -> Result<(), Failure> {
        let Some(last) = &self.last else { return Ok(()) };
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
