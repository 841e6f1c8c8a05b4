//! `mgw plan`: how often the axes of a configuration can be given setpoints together. The core
//! computes it for each bus; here the host's line is added.

mod advice;
mod delays;
mod print;

use std::time::Duration;

use gateway::{Assumptions, AxisPlan, BusPlan, Gateway, MAX_AXES, MAX_BUSES, PERIOD_US, Set};
use host_protocol::{
    BusKind, Error, MAX_CYCLE_AXES, Protocol, StateFields, Subject, cycle_event_bytes,
    cycle_frame_bytes,
};
use mgw_client::{make_impedance, make_position, make_velocity};

use crate::args::{HostLine, PlanArgs};
use crate::config::{self, BoardPorts, Configuration};
use crate::explain::Page;
use crate::failure::Failure;
use crate::names::Names;
use crate::output::Output;
use delays::Planned;
pub use print::to_json as plan_to_json;

/// Bits of a byte on the host's line, with start and stop bit.
const BYTE_BITS: u64 = 10;
/// Above this a bus is no CAN bus, bit/s.
const FASTEST_CAN: u32 = 1_000_000;
/// Bitrates of serial lines are multiples of it.
const BAUD_STEP: u32 = 9_600;

/// What is planned for, beside the configuration.
#[derive(Debug, Clone)]
pub struct Premises {
    pub assumed: Assumptions,
    /// The axes whose reply delay somebody has stated.
    pub stated_delays: Set,
    /// Frames of others in a second, by bus.
    pub foreign: [u32; MAX_BUSES],
    pub host: HostLine,
    pub fields: StateFields,
    /// Axes that take positions are given some.
    pub has_positions: bool,
    pub kinds: [BusKind; MAX_BUSES],
    /// The rate is one of `RunCycle`, not of `Cycle`.
    pub running: bool,
}

/// A whole gateway, as planned.
#[derive(Debug)]
pub struct Plan {
    /// Each bus with axes that take part, and its number.
    pub buses: Vec<(u8, BusPlan)>,
    /// Bytes of a cycle from the host, and back to it.
    pub bytes: (usize, usize),
    /// What these take on the host's line.
    pub line: (Duration, Duration),
    /// Bytes of the event of a period of `RunCycle`, and what they take.
    pub event: (usize, Duration),
    /// From the host's first byte to the last one back, one `Cycle` after the other; nothing where a
    /// bus has no time left.
    pub round: Option<Duration>,
    /// The period that `RunCycle` holds: that of the slowest bus, or of the host's line; nothing
    /// where a bus has no time left or the gateway takes no period as long.
    pub running: Option<Duration>,
    /// The same, for the longest single one.
    pub longest: Option<Duration>,
    /// How long the setpoint of an axis lives at most that lives the shortest; nothing where all are
    /// configured without expiry.
    pub shortest_life: Option<Duration>,
}

impl Plan {
    /// Plans the buses of a gateway's core.
    pub fn of(core: &Gateway, premises: &Premises) -> Self {
        let mut buses = Vec::new();
        for (bus, foreign) in (0..).zip(premises.foreign) {
            let assumed = Assumptions {
                foreign_frames_s: foreign,
                fields: premises.fields,
                ..premises.assumed.clone()
            };
            let plan = core.plan_bus(bus, &assumed).filter(|plan| !plan.axes.is_empty());
            buses.extend(plan.map(|plan| (bus, plan)));
        }
        let axes = buses.iter().flat_map(|(_, plan)| &plan.axes);
        let lives = axes.clone().filter_map(|axis| axis.life).map(std_time);
        let mask = axes.clone().fold(Set::NONE, |mask, axis| mask.with(Set::of(axis.axis))).bits();
        let takes_position = |planned: &AxisPlan| premises.has_positions && planned.takes_position;
        let setpoint = |axis| {
            let made = if premises.assumed.impedance.has(axis) {
                make_impedance(axis, 0.0, 0.0, 0.0, 0.0, 0.0)
            } else if axes.clone().any(|planned| planned.axis == axis && takes_position(planned)) {
                make_position(axis, 0.0, 0.0)
            } else {
                make_velocity(axis, 0.0)
            };
            made.setpoint
        };
        let bytes = cycle_frame_bytes(mask, setpoint, premises.fields);
        let line = (premises.host.time(bytes.0), premises.host.time(bytes.1));
        let event = cycle_event_bytes(mask, premises.fields);
        let event = (event, premises.host.time(event));
        let software = std_time(premises.assumed.software);
        let slowest = |of: fn(&BusPlan) -> Option<gateway::Duration>| {
            let times = buses.iter().map(|(_, plan)| of(plan)).collect::<Option<Vec<_>>>()?;
            times.into_iter().max().map(std_time)
        };
        let [shortest, longest_allowed] =
            [PERIOD_US.0, PERIOD_US.1].map(|us| Duration::from_micros(us.into()));
        let round = |bus| line.0 + software + bus + software + line.1;
        Self {
            round: slowest(|plan| plan.repeat).map(round),
            running: slowest(|plan| plan.period)
                .map(|bus| bus.max(event.1).max(shortest))
                .filter(|period| *period <= longest_allowed),
            longest: slowest(|plan| plan.longest).map(round),
            shortest_life: lives.min(),
            buses,
            bytes,
            line,
            event,
        }
    }

    /// The plan of a configuration; nothing where no gateway would take it.
    pub fn of_configuration(configuration: &Configuration, premises: &Premises) -> Option<Self> {
        let board = board_for(configuration, premises);
        let core = config::core_of(configuration, &board).ok()?;
        Some(Self::of(&core, premises))
    }

    /// Rounds of `Cycle` in a second.
    pub fn rate(&self) -> Option<f64> {
        self.round.map(rate)
    }

    /// The rate that the premises ask for.
    pub fn wanted_rate(&self, premises: &Premises) -> Option<f64> {
        if premises.running { self.running.map(rate) } else { self.rate() }
    }

    /// Whether so many cycles in a second hold, of those that the premises ask for.
    pub fn holds(&self, hertz: f64, premises: &Premises) -> bool {
        self.wanted_rate(premises).is_some_and(|rate| rate >= hertz)
            && self.axes() <= MAX_CYCLE_AXES
            && self.never_armed().next().is_none()
            && hertz >= self.slowest_rate(premises)
    }

    /// The least rate: of `RunCycle` that of the longest period, of `Cycle` one at which no setpoint
    /// expires before the next.
    pub fn slowest_rate(&self, premises: &Premises) -> f64 {
        let longest = match premises.running {
            true => Some(Duration::from_micros(PERIOD_US.1.into())),
            false => self.shortest_life,
        };
        longest.map_or(0.0, rate)
    }

    /// Why axes that take part are never armed.
    pub fn never_armed(&self) -> impl Iterator<Item = Error> {
        let axes = self.buses.iter().flat_map(|(_, plan)| &plan.axes);
        axes.filter(|axis| !axis.can_confirm).map(|axis| Error::CannotConfirm { axis: axis.axis })
    }

    /// How many axes take part.
    pub fn axes(&self) -> usize {
        self.buses.iter().map(|(_, plan)| plan.axes.len()).sum()
    }
}

impl HostLine {
    fn time(self, bytes: usize) -> Duration {
        match self {
            Self::Usb => Duration::ZERO,
            Self::Baud(baud) => {
                let bits = BYTE_BITS * bytes as u64;
                Duration::from_micros((bits * 1_000_000).div_ceil(u64::from(baud.max(1))))
            }
        }
    }
}

/// How often something that takes so long can be in a second.
pub fn rate(time: Duration) -> f64 {
    1.0 / time.as_secs_f64()
}

/// A rate in tenths of a hertz that still holds: rounded down.
pub fn held(rate: f64) -> f64 {
    (rate * 10.0).floor() / 10.0
}

/// A span of the core.
pub fn std_time(span: gateway::Duration) -> Duration {
    Duration::from_micros(span.as_micros())
}

/// The board that has what the configuration asks for.
fn board_for(configuration: &Configuration, premises: &Premises) -> BoardPorts {
    let port = |(bus, kind): (u8, BusKind)| {
        let rates = configuration.buses.get(&bus).map(|bus| bus.bitrate).into_iter().collect();
        (kind, rates)
    };
    let ports = (0..).zip(premises.kinds).map(port).collect();
    BoardPorts { ports, max_axes: u8::try_from(MAX_AXES).unwrap_or(u8::MAX) }
}

/// `mgw plan`
pub fn run(arguments: &PlanArgs, out: Output) -> Result<(), Failure> {
    let nothing = Configuration::default();
    let file = config::parse(&arguments.source, &nothing);
    let configuration = file.onto(nothing);
    let premises = premises(arguments, &configuration, out)?;
    let findings = config::check(&file, &configuration, &board_for(&configuration, &premises));
    config::refuse(&arguments.source.path, findings)?;
    let plan = Plan::of_configuration(&configuration, &premises).filter(|plan| plan.axes() > 0);
    let plan = plan.ok_or_else(|| {
        Failure::Usage(format!("{} has no axis to plan for", arguments.source.path))
    })?;
    let wanted = arguments.rate.filter(|rate| !plan.holds(*rate, &premises));
    let changes =
        wanted.map(|rate| advice::changes(&configuration, &premises, rate)).unwrap_or_default();
    print::plan(out, &plan, &premises, arguments.rate, &changes)?;
    match wanted {
        None => Ok(()),
        Some(wanted) => {
            let text = advice::refusal(&plan, &premises, wanted, &changes);
            Err(Failure::named("DoesNotHold", Page::BusOverloaded, text))
        }
    }
}

fn premises(
    arguments: &PlanArgs,
    configuration: &Configuration,
    out: Output,
) -> Result<Premises, Failure> {
    let names = Names::from(configuration);
    let there = |number, row| match configuration.has(row) {
        true => Ok(number),
        false => {
            let path = &arguments.source.path;
            Err(Failure::Usage(format!("{row} is named, and {path} does not have it")))
        }
    };
    let bus = |typed| names.find_bus(typed).and_then(|bus| there(bus, Subject::Bus(bus)));
    let axis = |typed| names.find_axis(typed).and_then(|axis| there(axis, Subject::Axis(axis)));
    let serial = arguments.rs485.iter().map(bus).collect::<Result<Vec<_>, _>>()?;
    let mut kinds = [BusKind::Can; MAX_BUSES];
    for (bus, kind) in (0..).zip(&mut kinds) {
        let bitrate = configuration.buses.get(&bus).map_or(0, |bus| bus.bitrate);
        let is_serial = bitrate > FASTEST_CAN || bitrate > 0 && bitrate.is_multiple_of(BAUD_STEP);
        if is_serial || serial.contains(&bus) {
            *kind = BusKind::Rs485;
        }
    }
    let mut foreign = [0; MAX_BUSES];
    for (typed, frames) in &arguments.foreign {
        let bus = bus(typed)?;
        if kinds.get(usize::from(bus)) == Some(&BusKind::Rs485) {
            let text = format!("bus {bus} is RS485: there nobody else talks. --foreign is for CAN");
            return Err(Failure::Usage(text));
        }
        // A bus that no gateway has is found when the file is looked at.
        foreign.get_mut(usize::from(bus)).into_iter().for_each(|foreign| *foreign = *frames);
    }
    let mut impedance = Set::NONE;
    for typed in &arguments.impedance {
        let axis = axis(typed)?;
        let kind = configuration.bus_of(axis).and_then(|bus| kinds.get(usize::from(bus)));
        if configuration.protocol_of(axis) != Some(Protocol::Rmd) || kind != Some(&BusKind::Can) {
            let text =
                format!("axis {axis} takes no impedance setpoints: only RMD motors on CAN do");
            return Err(Failure::Usage(text));
        }
        impedance = impedance.with(Set::of(axis));
    }
    let mut assumed = Assumptions {
        software: gateway::Duration::from_micros(arguments.gateway_us.into()),
        impedance,
        ..Assumptions::DEFAULT
    };
    let mut stated = Set::NONE;
    let models = arguments.models.iter().map(|(typed, model)| Ok((axis(typed)?, model.clone())));
    let models = models.collect::<Result<Vec<_>, Failure>>()?;
    let planned = Planned { configuration, kinds: &kinds, models: &models };
    let measured = arguments.delays.as_ref().map(|source| delays::read(source, &planned));
    let measured = measured.transpose()?.unwrap_or_default();
    measured.notes.iter().for_each(|note| out.aside(note));
    let measured = measured.delays.into_iter().map(|(axis, us)| (Some(axis), us));
    let given = arguments.reply_delays.iter();
    let given = given.map(|(typed, us)| Ok((typed.as_ref().map(axis).transpose()?, *us)));
    let given = given.collect::<Result<Vec<_>, Failure>>()?;
    // What is said of all goes before what is said of one.
    let (of_all, of_one): (Vec<_>, Vec<_>) =
        given.into_iter().partition(|(axis, _)| axis.is_none());
    for (axis, us) in of_all.into_iter().chain(measured).chain(of_one) {
        for (place, delay) in (0_u8..).zip(&mut assumed.reply_delay) {
            if axis.is_none_or(|axis| axis == place) {
                *delay = gateway::Duration::from_micros(us.into());
                stated = stated.with(Set::of(place));
            }
        }
    }
    Ok(Premises {
        assumed,
        stated_delays: stated,
        foreign,
        host: arguments.host,
        fields: StateFields::of(&arguments.fields),
        has_positions: !arguments.no_positions,
        kinds,
        running: arguments.running,
    })
}
