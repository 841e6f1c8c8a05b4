//! Which single change would make a rate hold: each is tried by planning anew.

use gateway::MAX_BUSES;
use host_protocol::{AxisParameter, BusKind, MAX_CYCLE_AXES, StateField, StateFields, Value};

use super::{Plan, Premises, held};
use crate::args::HostLine;
use crate::config::Configuration;

/// Faster lines to the host.
const HOST_LINES: [HostLine; 4] =
    [HostLine::Baud(921_600), HostLine::Baud(2_000_000), HostLine::Baud(3_000_000), HostLine::Usb];
/// Faster buses, bit/s.
const CAN_BITRATES: [u32; 3] = [250_000, 500_000, 1_000_000];
const RS485_BITRATES: [u32; 5] = [115_200, 500_000, 1_000_000, 1_500_000, 2_000_000];

/// The single changes with which the rate holds, in words.
pub fn changes(configuration: &Configuration, premises: &Premises, rate: f64) -> Vec<String> {
    let holds = |configuration: &Configuration, premises: &Premises| {
        Plan::of_configuration(configuration, premises)
            .is_some_and(|plan| plan.holds(rate, premises))
    };
    let mut found = Vec::new();
    let faster = HOST_LINES.into_iter().filter(|line| is_faster(*line, premises.host));
    let with_line = |host| Premises { host, ..premises.clone() };
    if let Some(line) = faster.into_iter().find(|line| holds(configuration, &with_line(*line))) {
        found.push(match line {
            HostLine::Baud(baud) => format!("a host line of {baud} baud"),
            HostLine::Usb => "USB to the host".to_owned(),
        });
    }
    let short = Premises { has_positions: false, ..premises.clone() };
    if premises.has_positions && holds(configuration, &short) {
        found.push("no positions among the setpoints (--no-positions)".to_owned());
    }
    // The fields that take the most bytes are not needed by every loop.
    let fewer = [StateField::Position, StateField::Velocity].into_iter().find(|field| {
        let fields = StateFields::of(&[*field]);
        fields != premises.fields && holds(configuration, &Premises { fields, ..premises.clone() })
    });
    found.extend(fewer.map(|field| format!("fewer fields, for example only {}", field.name())));
    for (bus, config) in &configuration.buses {
        let rates: &[u32] = match premises.kinds.get(usize::from(*bus)) {
            Some(BusKind::Can) => &CAN_BITRATES,
            _ => &RS485_BITRATES,
        };
        let faster = rates.iter().filter(|rate| **rate > config.bitrate).find(|rate| {
            let mut changed = configuration.clone();
            changed.buses.entry(*bus).and_modify(|config| config.bitrate = **rate);
            holds(&changed, premises)
        });
        found.extend(faster.map(|rate| format!("{rate} bit/s on bus {bus}")));
        found.extend(fewer_axes(configuration, premises, *bus, &holds));
    }
    found
}

/// How many axes of a bus may stay, if the others go to one that has none, or without the others.
fn fewer_axes(
    configuration: &Configuration,
    premises: &Premises,
    bus: u8,
    holds: &dyn Fn(&Configuration, &Premises) -> bool,
) -> Option<String> {
    let here = configuration.axes_on(bus);
    let all = here.len();
    let free = (0..).take(MAX_BUSES).find(|other| !configuration.buses.contains_key(other));
    let moved = free.and_then(|other: u8| {
        let mut premises = premises.clone();
        *premises.kinds.get_mut(usize::from(other))? = *premises.kinds.get(usize::from(bus))?;
        (1..all).rev().find(|left| {
            let mut changed = configuration.clone();
            let same = changed.buses.get(&bus).cloned();
            changed.buses.extend(same.map(|config| (other, config)));
            for axis in &here[*left..] {
                let values = changed.axes.entry(*axis).or_default();
                values.insert(AxisParameter::Bus, Value::Unsigned(other.into()));
            }
            holds(&changed, &premises)
        })
    });
    if let Some(left) = moved {
        return Some(format!(
            "{left} instead of {all} axes on bus {bus}, the others on another bus"
        ));
    }
    (1..all).rev().find_map(|left| {
        let mut changed = configuration.clone();
        changed.axes.retain(|axis, _| !here[left..].contains(axis));
        holds(&changed, premises)
            .then(|| format!("{left} instead of {all} axes on bus {bus}, without the others"))
    })
}

fn is_faster(line: HostLine, than: HostLine) -> bool {
    match (line, than) {
        (_, HostLine::Usb) => false,
        (HostLine::Usb, _) => true,
        (HostLine::Baud(line), HostLine::Baud(than)) => line > than,
    }
}

/// Why a rate does not hold, and what would make it.
pub fn refusal(plan: &Plan, premises: &Premises, wanted: f64, changes: &[String]) -> String {
    let rate = plan.wanted_rate(premises);
    let none = match premises.running {
        true => "a bus has no time left, or needs a longer period than a gateway takes",
        false => "a bus has no time left for cycles",
    };
    let reached =
        rate.map_or(none.to_owned(), |rate| format!("{:.1} Hz can be reached", held(rate)));
    let slowest = plan.slowest_rate(premises);
    let reached = match plan.axes() {
        _ if let Some(error) = plan.never_armed().next() => error.to_string(),
        axes if axes > MAX_CYCLE_AXES => {
            format!("one cycle has at most {MAX_CYCLE_AXES} axes, and these are {axes}")
        }
        _ if wanted < slowest && premises.running => {
            format!("the gateway takes no RunCycle of less than {slowest} Hz")
        }
        _ if wanted < slowest => {
            format!("a setpoint expires before the next below {slowest:.1} Hz: ttl_us")
        }
        _ => reached,
    };
    let would = match changes {
        [] => {
            "No single change of the host's line, a bitrate, the fields or the number of axes on \
               one bus makes it hold"
                .to_owned()
        }
        changes => format!("It would hold with: {}", changes.join("; or ")),
    };
    format!("{wanted} Hz do not hold: {reached}. {would}")
}
