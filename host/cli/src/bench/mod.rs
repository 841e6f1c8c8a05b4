//! `mgw bench`: how fast a gateway answers and takes setpoints, beside what is planned for it.

mod figure;
mod print;
mod spread;
mod table;

use std::collections::BTreeMap;
use std::time::Duration;

use gateway::{Assumptions, Gateway, MAX_BUSES, Set};
use host_protocol::{AxisState, BusKind, CycleResult, MAX_CYCLE_AXES, Protocol, StateFields};
use mgw_client::{AxisSetpoint, ClientError, make_signal, make_velocity};

use crate::args::BenchArgs;
use crate::commands;
use crate::config::{self, BoardPorts, Configuration};
use crate::failure::{Failure, list};
use crate::plan::{Plan, Premises};
use crate::session::Session;
use crate::terminal;
use crate::written;
use spread::Spread;

/// What was measured.
pub struct Measured {
    pub ping: Spread,
    pub read_state: Spread,
    pub cycles: Vec<Cycles>,
    pub delays: Vec<(u8, u32)>,
}

/// Cycles of some axes.
pub struct Cycles {
    pub axes: Vec<u8>,
    pub spread: Spread,
    /// Setpoints of them that no motor has answered.
    pub unanswered: u32,
    pub plan: Plan,
}

/// What is needed beside the session.
struct Bench<'a> {
    arguments: &'a BenchArgs,
    configuration: Configuration,
    core: Box<Gateway>,
    premises: Premises,
    /// How long a setpoint is valid.
    ttl: Duration,
}

/// Measures, and prints.
pub fn run(session: &mut Session, arguments: &BenchArgs) -> Result<(), Failure> {
    let axes = axes(session, arguments)?;
    let bench = Bench::new(session, arguments, &axes)?;
    for axis in &axes {
        commands::check_setpoint(session, *axis, bench.setpoint(*axis).setpoint)?;
    }
    ask(session, arguments, &axes)?;
    let rounds = arguments.rounds;
    let ping = measure(session, rounds, |session| Ok(session.client.ping()?))?;
    let read_state = measure(session, rounds, |session| {
        session.client.read_state_when_free(axes[0]).map(drop).map_err(Failure::from)
    })?;
    let mut cycles = Vec::new();
    for count in counts(axes.len()) {
        cycles.push(bench.cycles(session, &axes[..count])?);
    }
    let alone = match (&arguments.delays, &arguments.table) {
        (None, None) => Vec::new(),
        _ => bench.each_alone(session, &axes)?,
    };
    let mut delays = Vec::new();
    if let Some(path) = &arguments.delays {
        delays = reply_delays(&alone, &ping);
        written::write(path, delays_file(&delays), true)?;
    }
    if let Some(path) = &arguments.table {
        let table = table::of(session, &bench, &alone, &ping)?;
        written::write(path, table.to_string(), true)?;
    }
    let measured = Measured { ping, read_state, cycles, delays };
    if let Some(path) = &arguments.svg {
        written::write(path, figure::svg(&measured.cycles)?, true)?;
    }
    print::measured(session, arguments, &bench.premises, &measured)
}

/// 1, 2, 4, … and all.
fn counts(axes: usize) -> impl Iterator<Item = usize> {
    let powers = (0..usize::BITS).map(|power| 1 << power).take_while(move |count| *count < axes);
    powers.chain([axes])
}

/// The axes to measure, each once.
fn axes(session: &mut Session, arguments: &BenchArgs) -> Result<Vec<u8>, Failure> {
    let axes = session.axes_or_all(&arguments.axes)?;
    session.refuse_unconfigured(&axes, "it cannot be measured")?;
    if !arguments.velocity.is_finite() {
        return Err(Failure::Usage("--velocity takes a number of rad/s".to_owned()));
    }
    commands::refuse_twice(&axes)?;
    match axes.len() {
        0 => Err(Failure::not_measured("no axis is configured")),
        count if count > MAX_CYCLE_AXES => Err(Failure::Usage(format!(
            "one cycle has at most {MAX_CYCLE_AXES} axes, and these are {count}; name those to \
             measure"
        ))),
        _ => Ok(axes),
    }
}

/// Asks whether to arm, unless that is said already.
fn ask(session: &mut Session, arguments: &BenchArgs, axes: &[u8]) -> Result<(), Failure> {
    let what = format!(
        "bench arms axes {} and gives them {} rad/s, thrusters signal 0",
        list(axes),
        arguments.velocity
    );
    terminal::agree(session, arguments.yes, &what)
}

/// How long each of so many rounds takes, in the time of the transport.
fn measure(
    session: &mut Session,
    rounds: u32,
    mut round: impl FnMut(&mut Session) -> Result<(), Failure>,
) -> Result<Spread, Failure> {
    let mut times = Vec::new();
    let begin = session.client.now();
    for _ in 0..rounds {
        let before = session.client.now();
        round(session)?;
        times.push(session.client.now().saturating_sub(before));
    }
    let all = session.client.now().saturating_sub(begin);
    Ok(Spread::of(times, all))
}

impl<'a> Bench<'a> {
    fn new(session: &mut Session, arguments: &'a BenchArgs, axes: &[u8]) -> Result<Self, Failure> {
        let configuration = config::read(&mut session.client)?;
        let board = BoardPorts::of(session.client.hello());
        let core = config::core_of(&configuration, &board).map_err(Failure::would_be_refused)?;
        let mut kinds = [BusKind::Can; MAX_BUSES];
        for (bus, kind) in kinds.iter_mut().enumerate() {
            *kind = board.kind(bus).unwrap_or(BusKind::Can);
        }
        let premises = Premises {
            assumed: Assumptions {
                software: gateway::Duration::from_micros(arguments.gateway_us.into()),
                ..Assumptions::DEFAULT
            },
            stated_delays: Set::NONE,
            foreign: [0; MAX_BUSES],
            host: arguments.host,
            fields: StateFields::of(&arguments.fields),
            // What it sends are velocities and signals.
            has_positions: false,
            kinds,
            running: false,
        };
        let ttls = axes.iter().map(|axis| session.client.axis_ttl(*axis));
        let ttl = ttls.collect::<Result<Vec<_>, _>>()?.into_iter().min().unwrap_or_default();
        // The gateway takes none that is valid for longer than the TTL, and its time is known only
        // within half a round trip.
        let ttl = ttl * 3 / 4;
        Ok(Self { arguments, configuration, core, premises, ttl })
    }

    fn setpoint(&self, axis: u8) -> AxisSetpoint {
        if self.configuration.protocol_of(axis) == Some(Protocol::Thruster) {
            make_signal(axis, 0.0)
        } else {
            make_velocity(axis, self.arguments.velocity)
        }
    }

    /// Arms axes together, gives them setpoints round after round, and stops them.
    fn cycles(&self, session: &mut Session, axes: &[u8]) -> Result<Cycles, Failure> {
        let setpoints: Vec<AxisSetpoint> = axes.iter().map(|axis| self.setpoint(*axis)).collect();
        let mut unanswered = 0;
        let armed = session.client.arm_together(axes).map_err(Failure::from);
        let measured = armed.and_then(|epoch| {
            measure(session, self.arguments.rounds, |session| {
                let states =
                    session.client.cycle(epoch, &setpoints, self.premises.fields, self.ttl)?;
                for state in states {
                    match state.result {
                        CycleResult::Answered => {}
                        CycleResult::NoReply => unanswered += 1,
                        result => {
                            let text = format!("axis {}: {result}", state.axis);
                            return Err(Failure::not_measured(text));
                        }
                    }
                }
                Ok(())
            })
        });
        // Whatever happened above: the next frames are the stops of what was armed here.
        session.client.stop_armed().map_err(|error| Failure::lost(axes, error))?;
        if let Err(Failure::Client(error @ ClientError::StopUnanswered { .. })) = measured {
            return Err(Failure::lost(axes, error));
        }
        let mut tripped = None;
        let end = session.stops_until();
        for axis in axes {
            let report = session.await_stop(*axis, end)?;
            if let (AxisState::Tripped { .. }, Some(trip)) = (report.state, report.trip) {
                tripped = tripped.or(Some(Failure::tripped(*axis, &trip, session.out.motors)));
            }
        }
        match (measured, tripped) {
            (_, Some(tripped)) => Err(tripped),
            (Err(failure), None) => Err(failure),
            (Ok(spread), None) => {
                let plan = self.plan(axes, &self.premises);
                Ok(Cycles { axes: axes.to_vec(), spread, unanswered, plan })
            }
        }
    }

    fn plan(&self, axes: &[u8], premises: &Premises) -> Plan {
        let axes = axes.iter().fold(Set::NONE, |set, axis| set.with(Set::of(*axis)));
        let assumed = Assumptions { axes, ..premises.assumed.clone() };
        Plan::of(&self.core, &Premises { assumed, ..premises.clone() })
    }

    /// Cycles of each axis alone.
    fn each_alone(&self, session: &mut Session, axes: &[u8]) -> Result<Vec<Cycles>, Failure> {
        axes.iter().map(|axis| self.cycles(session, &[*axis])).collect()
    }
}

/// How long each motor takes to begin its reply, estimated: the median of its cycles less that of a
/// ping, and less the rest of what is planned for it alone. What the ping does not have, the
/// gateway's work for the bus, counts as the motor's.
fn reply_delays(alone: &[Cycles], ping: &Spread) -> Vec<(u8, u32)> {
    let delay = |cycles: &Cycles| {
        Some((*cycles.axes.first()?, delay_us(cycles, cycles.spread.at(500), ping)))
    };
    alone.iter().filter_map(delay).collect()
}

/// The delay of the motor of these cycles in a round that took so long, µs.
fn delay_us(cycles: &Cycles, round: Duration, ping: &Spread) -> u32 {
    let beside: u64 = cycles.plan.buses.iter().map(|(_, plan)| frames_us(plan)).sum();
    let rest = round.saturating_sub(ping.at(500)).saturating_sub(Duration::from_micros(beside));
    u32::try_from(rest.as_micros()).unwrap_or(u32::MAX)
}

/// What the frames of a planned cycle of one axis take, without its motor's delay, µs.
fn frames_us(plan: &gateway::BusPlan) -> u64 {
    let delay = plan.axes.first().map_or(0, |axis| axis.reply_delay.as_micros());
    plan.cycle.as_micros().saturating_sub(delay)
}

fn delays_file(delays: &[(u8, u32)]) -> String {
    let lines: BTreeMap<u8, u32> = delays.iter().copied().collect();
    let lines = lines.iter().map(|(axis, us)| format!("{axis} = {us}\n"));
    format!(
        "# Written by `mgw bench --delays`: estimated from the times of cycles, so each has what \
         the gateway\n# and the host's line take in it. For `mgw plan --delays`.\n\
         [reply_delay_us]\n{}",
        lines.collect::<String>()
    )
}
