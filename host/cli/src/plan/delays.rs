//! The reply delays that `mgw plan --delays` reads: by axis, as `mgw bench --delays` writes them,
//! or by motor, as the table of `mgw delays` has them.

use std::collections::{BTreeMap, BTreeSet};

use host_protocol::BusKind;
use serde::Deserialize;

use crate::args::Typed;
use crate::config::{Configuration, Source};
use crate::delays::{Entry, Key, SIMULATOR, Table};
use crate::failure::Failure;
use crate::names::Names;
use crate::words;

/// The longest delay that is taken for one, µs.
const LONGEST_US: u32 = 1_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// By axis, µs.
    reply_delay_us: BTreeMap<String, u32>,
}

/// What is planned for.
pub struct Planned<'a> {
    /// The axes and their buses.
    pub configuration: &'a Configuration,
    /// What carries each bus.
    pub kinds: &'a [BusKind],
    /// The models of motors that somebody has named, by axis.
    pub models: &'a [(u8, String)],
}

/// Delays, and what is to be said of them.
#[derive(Debug, Default)]
pub struct Stated {
    /// Axis and µs.
    pub delays: Vec<(u8, u32)>,
    /// For the person who plans.
    pub notes: Vec<String>,
}

/// The delays of a file.
pub fn read(source: &Source, planned: &Planned<'_>) -> Result<Stated, Failure> {
    let wrong = |what: String| Failure::Usage(format!("{}: {what}", source.path));
    if Table::begins(&source.text) {
        let table = Table::parse(&source.text).map_err(wrong)?;
        return Ok(of_table(&table, planned));
    }
    if !planned.models.is_empty() {
        let text = "it has delays by axis, and --motor chooses among those of a table by motor";
        return Err(wrong(text.to_owned()));
    }
    by_axis(source, planned).map(|delays| Stated { delays, notes: Vec::new() })
}

/// Of each axis the longest delay that the table has of a motor as it may be: of its protocol, on
/// such a bus, at this bitrate.
fn of_table(table: &Table, planned: &Planned<'_>) -> Stated {
    let mut stated = Stated::default();
    let configuration = planned.configuration;
    for axis in configuration.axes.keys() {
        let place = configuration.protocol_of(*axis).zip(configuration.bus_of(*axis));
        let Some((protocol, bus)) = place else { continue };
        let bitrate = configuration.buses.get(&bus).map_or(0, |bus| bus.bitrate);
        let kind = words::kind(planned.kinds.get(usize::from(bus)));
        let model = planned.models.iter().find(|(of, _)| of == axis).map(|(_, model)| model);
        let fitting: Vec<(&Key, &Entry)> = table
            .entries()
            .filter(|(key, _)| key.protocol == protocol.name() && key.bus == kind)
            .filter(|(key, _)| key.bitrate == bitrate)
            .filter(|(key, _)| model.is_none_or(|model| key.model == *model))
            .collect();
        let longest = fitting.iter().map(|(_, entry)| entry.delays.most()).max();
        match longest {
            Some(longest) => stated.delays.push((*axis, longest)),
            None => stated.notes.push(format!(
                "axis {axis}: the table has nothing of {} {} on {kind} at {bitrate} bit/s",
                protocol.name(),
                model.map_or("motors", String::as_str)
            )),
        }
        let models: BTreeSet<&str> = fitting.iter().map(|(key, _)| key.model.as_str()).collect();
        if models.len() > 1 {
            let models: Vec<&str> = models.into_iter().collect();
            stated.notes.push(format!(
                "axis {axis}: the longest delay of {}; --motor {axis}=MODEL chooses one",
                models.join(", ")
            ));
        }
        if fitting.iter().any(|(key, _)| key.place == SIMULATOR) {
            stated.notes.push(format!("axis {axis}: its delay is in part that of a simulator"));
        }
    }
    stated
}

/// The delays of a file that has them by axis.
fn by_axis(source: &Source, planned: &Planned<'_>) -> Result<Vec<(u8, u32)>, Failure> {
    let wrong = |what: &str| Failure::Usage(format!("{}: {what}", source.path));
    let file: File = toml::from_str(&source.text).map_err(|error| {
        wrong(&format!(
            "{}; it takes a table reply_delay_us with AXIS = MICROSECONDS, or what `mgw delays` \
             writes",
            error.message()
        ))
    })?;
    let names = Names::from(planned.configuration);
    let no_axis = |axis: &str| wrong(&format!("{axis} is no axis, 0 to 31, and no name of one"));
    file.reply_delay_us
        .into_iter()
        .map(|(axis, us)| {
            let typed: Typed = axis.parse().map_err(|_| no_axis(&axis))?;
            let number = names.find_axis(&typed).map_err(|failure| wrong(&failure.to_string()))?;
            if usize::from(number) >= gateway::MAX_AXES {
                return Err(no_axis(&axis));
            }
            let range =
                format!("the delay of axis {axis} is {us}, and may be 0 to {LONGEST_US} µs");
            if us > LONGEST_US { Err(wrong(&range)) } else { Ok((number, us)) }
        })
        .collect()
}
