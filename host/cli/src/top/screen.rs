//! The screen: from what is known to lines of text, as many as the terminal has.

use std::time::Duration;

use host_protocol::{AxisState, StateField};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::Line;

use super::columns::{Column, cut, headings, row, that_fit, wrapped};
use super::view::View;
use crate::commands::e_stop_text;
use crate::explain::Page;
use crate::faults;
use crate::live::{Axis, Bus, Link, Live};
use crate::words::{self, NOTHING, or_nothing};

/// The keys.
const HELP: &str = "space stop all  ↑↓ choose axis  c clear its trip  q quit";
/// A reading older than this is marked, as in `mgw state`, µs.
const STALE_AFTER_US: u32 = 1_000_000;
/// Before what is said of the row above.
const INDENT: usize = 6;
/// What the log has at least, where there is room for more than the axes.
const LEAST_LOG: usize = 3;
/// Trips and starts that are shown at most.
const MOST_TRIPS: usize = 8;

/// A row of the table of axes.
struct AxisRow<'a> {
    axis: &'a Axis,
    chosen: bool,
    now: Duration,
}

/// Everything, in lines of this width; `height` of them at most.
pub fn lines(
    live: &Live,
    view: &View,
    now: Duration,
    width: u16,
    height: u16,
) -> Vec<Line<'static>> {
    let (width, height) = (usize::from(width), usize::from(height));
    let paint = Paint { colour: view.colour };
    let mut top = header(live, width, paint);
    let message = message(view, width, height, paint);
    let help = Line::styled(cut(HELP, width), paint.bold());
    // What may never be missing: the header, what was said last, the keys.
    let rest = height.saturating_sub(top.len() + message.len() + 1);
    let (axes, chosen) = axes(live, view, now, width, paint);
    let buses = buses(live, width, paint);
    let show_buses = axes.len() + buses.len() + LEAST_LOG <= rest;
    let for_axes = rest - if show_buses { buses.len() } else { 0 };
    top.extend(around(axes, chosen, for_axes));
    if show_buses {
        top.extend(buses);
    }
    let room = height.saturating_sub(top.len() + message.len() + 1);
    top.extend(log(live, width, room, paint));
    let filled = height.saturating_sub(message.len() + 1);
    top.resize(filled, Line::raw(""));
    top.extend(message);
    top.push(help);
    top.truncate(height);
    top
}

fn header(live: &Live, width: usize, paint: Paint) -> Vec<Line<'static>> {
    let hello = live.hello.as_ref().map(|hello| format!("{}, {}", hello.board, hello.firmware));
    let parts = [live.name.clone(), hello, Some(live.port.clone())];
    let mut first = parts.into_iter().flatten().collect::<Vec<_>>().join("  ");
    if live.lost > 0 {
        first.push_str(&format!("  {} lost", live.lost));
    }
    let first = Line::styled(cut(&crate::printable::printable(&first), width), paint.bold());
    if let Link::Lost { why } = &live.link {
        let text = format!("NOT CONNECTED, connecting again: {why}");
        return vec![first, Line::styled(cut(&text, width), paint.bad())];
    }
    let Some(status) = &live.status else { return vec![first, Line::raw("")] };
    let holder = words::in_command(status.holder, live.commander.as_deref());
    let holder = crate::printable::printable(&holder);
    let enable = match status.enable_output {
        Some(true) => "  enable: active",
        Some(false) => "  enable: INACTIVE",
        None => "",
    };
    let rate = live.samples.per_second().map(|rate| format!("  {rate:.0} samples/s"));
    let text = format!(
        "command: {holder}  e-stop: {}{enable}{}",
        e_stop_text(status),
        rate.unwrap_or_default()
    );
    let is_bad = status.e_stop_latched
        || status.e_stop_input_open == Some(true)
        || status.enable_output == Some(false);
    vec![first, Line::styled(cut(&text, width), if is_bad { paint.bad() } else { paint.plain() })]
}

/// The table of axes, and in which of its lines the chosen one is.
fn axes(
    live: &Live,
    view: &View,
    now: Duration,
    width: usize,
    paint: Paint,
) -> (Vec<Line<'static>>, usize) {
    if live.axes.is_empty() {
        return (vec![Line::raw("no axis is configured")], 0);
    }
    let columns = axis_columns();
    let columns = that_fit(&columns, width);
    let mut lines = vec![Line::styled(headings(&columns), paint.bold())];
    let mut chosen_line = 0;
    for axis in &live.axes {
        let chosen = view.chosen == Some(axis.number);
        if chosen {
            chosen_line = lines.len();
        }
        let text = row(&columns, &AxisRow { axis, chosen, now });
        lines.push(Line::styled(text, paint.state(axis.state)));
        if let Some(why) = why(axis, now) {
            let why = wrapped(&why, INDENT, width);
            lines.extend(why.into_iter().map(|line| Line::styled(line, paint.state(axis.state))));
        }
    }
    (lines, chosen_line)
}

/// What is to be said of an axis below its row: its trip, or faults that it has without one.
fn why(axis: &Axis, now: Duration) -> Option<String> {
    if let AxisState::Tripped { confirmed } = axis.state {
        let stop = if confirmed { "stop confirmed" } else { "STOP NOT CONFIRMED" };
        let reason = axis.trip.map_or(String::new(), |reason| {
            let text = words::trip_reason(&reason, axis.protocol);
            format!(": {text} {}", Page::of_trip(&reason))
        });
        return Some(format!("{stop}{reason}"));
    }
    let faults = axis.faults(now).filter(|faults| faults.word != 0)?;
    let warns = if faults.word == faults.warnings { ", only warns" } else { "" };
    Some(format!("faults: {}{warns}", faults::in_words(axis.protocol, faults.word)))
}

/// As many of the lines as there is room for: the headings, and those around the chosen one.
fn around(lines: Vec<Line<'static>>, chosen: usize, room: usize) -> Vec<Line<'static>> {
    if lines.len() <= room || room < 2 {
        return lines.into_iter().take(room).collect();
    }
    let body = room - 1;
    // With the line below it, which says why it tripped.
    let last = chosen + usize::from(body > 1);
    let first = (last + 1).saturating_sub(body).clamp(1, lines.len() - body);
    let mut kept: Vec<_> = lines;
    let headings = kept.remove(0);
    let shown = kept.into_iter().skip(first - 1).take(body);
    std::iter::once(headings).chain(shown).collect()
}

fn buses(live: &Live, width: usize, paint: Paint) -> Vec<Line<'static>> {
    let columns = that_fit(&BUS_COLUMNS, width);
    let mut lines = vec![Line::styled(headings(&columns), paint.bold())];
    for bus in live.buses.iter().filter(|bus| bus.report.is_some()) {
        lines.push(Line::styled(row(&columns, bus), paint.bus(bus)));
    }
    lines
}

/// Trips and starts, and below them events: half of the room each, more where the other has less.
fn log(live: &Live, width: usize, room: usize, paint: Paint) -> Vec<Line<'static>> {
    let trips = live.log.history(MOST_TRIPS).count().min(room.saturating_sub(1).div_ceil(2));
    let mut lines = Vec::new();
    let mut part = |heading: &'static str, texts: Vec<String>| {
        if !texts.is_empty() {
            lines.push(Line::styled(heading, paint.bold()));
            lines.extend(texts.into_iter().map(Line::raw));
        }
    };
    let cut = |line: &str| cut(line, width);
    part("trips and starts", live.log.history(trips).map(cut).collect());
    let left = room.saturating_sub(if trips > 0 { trips + 1 } else { 0 } + 1);
    part("events", live.log.events(left).map(cut).collect());
    lines
}

fn message(view: &View, width: usize, height: usize, paint: Paint) -> Vec<Line<'static>> {
    if let Some(axis) = view.confirm {
        let text = format!("clear the trip of axis {axis}? It stays disarmed. y: yes, else: no");
        let lines = wrapped(&text, 0, width);
        return lines.into_iter().map(|line| Line::styled(line, paint.bold())).collect();
    }
    let style = if view.message.is_bad { paint.bad() } else { paint.bold() };
    let lines = view.message.lines.iter().flat_map(|line| wrapped(line, 0, width));
    let all: Vec<_> = lines.map(|line| Line::styled(line, style)).collect();
    let room = (height / 3).max(1);
    if all.len() <= room {
        return all;
    }
    let more = Line::styled(format!("and {} lines more", all.len() + 1 - room), style);
    all.into_iter().take(room - 1).chain([more]).collect()
}

fn axis_columns<'a>() -> [Column<AxisRow<'a>>; 9] {
    [
        Column::left(" axis", 5, 9, axis_number),
        Column::left("name", 10, 2, |row| row.axis.name.clone().unwrap_or_default()),
        Column::left("protocol", 8, 4, |row| or_nothing(row.axis.protocol)),
        Column::left("state", 12, 9, |row| state(row.axis.state).to_owned()),
        Column::right("rad", 9, 7, |row| reading(row, StateField::Position, 3)),
        Column::right("rad/s", 8, 8, |row| reading(row, StateField::Velocity, 2)),
        Column::right("A", 7, 6, |row| reading(row, StateField::Current, 2)),
        Column::right("°C", 4, 3, temperature),
        Column::right("age", 6, 5, age),
    ]
}

const BUS_COLUMNS: [Column<Bus>; 9] = [
    Column::right("  bus", 5, 9, |bus| bus.number.to_string()),
    Column::left("name", 10, 1, |bus| bus.name.clone().unwrap_or_default()),
    Column::left("kind", 5, 2, |bus| bus.kind.to_string()),
    Column::right("bit/s", 7, 3, |bus| {
        let config = bus.report.and_then(|report| report.config);
        or_nothing(config.map(|config| config.bitrate))
    }),
    Column::left("state", 12, 8, |bus| or_nothing(bus.report.map(|report| report.state))),
    Column::right("load", 6, 7, |bus| {
        or_nothing(bus.load_at_most().map(|load| format!("≤{:.0} %", load * 100.0)))
    }),
    Column::right("sent/s", 6, 4, |bus| {
        or_nothing(bus.rates().map(|(sent, _)| format!("{sent:.0}")))
    }),
    Column::right("recv/s", 6, 4, |bus| {
        or_nothing(bus.rates().map(|(_, received)| format!("{received:.0}")))
    }),
    Column::left("errors", 15, 6, errors),
];

fn axis_number(row: &AxisRow<'_>) -> String {
    format!("{}{:>4}", if row.chosen { ">" } else { " " }, row.axis.number)
}

/// The state in one word.
fn state(state: AxisState) -> &'static str {
    match state {
        AxisState::Tripped { .. } => "TRIPPED",
        other => words::axis_state(other),
    }
}

fn reading(row: &AxisRow<'_>, field: StateField, digits: usize) -> String {
    let reading = row.axis.reading(field, row.now);
    or_nothing(reading.map(|reading| {
        let mark = if reading.age_us > STALE_AFTER_US { "*" } else { "" };
        format!("{:.digits$}{mark}", reading.value)
    }))
}

/// Of the motor, or of its driver where that is all that it tells.
fn temperature(row: &AxisRow<'_>) -> String {
    let fields = [StateField::MotorTemperature, StateField::DriverTemperature];
    let known = fields.into_iter().find(|field| row.axis.reading(*field, row.now).is_some());
    or_nothing(known.map(|field| reading(row, field, 0)))
}

fn age(row: &AxisRow<'_>) -> String {
    match row.axis.age_us(row.now) {
        None => NOTHING.to_owned(),
        Some(us) if us < STALE_AFTER_US => format!("{} ms", us / 1_000),
        Some(us) => format!("{} s", us / STALE_AFTER_US),
    }
}

/// What went wrong on a bus since it was configured, the worst first.
fn errors(bus: &Bus) -> String {
    let Some(report) = bus.report else { return NOTHING.to_owned() };
    let counts = report.counters;
    let parts = [
        (u64::from(counts.bus_offs), "bus-off"),
        (u64::from(counts.missed_acknowledgements), "no ack"),
        (u64::from(report.transmit_errors) + u64::from(report.receive_errors), "TEC+REC"),
        (u64::from(counts.receive_overflows), "overflow"),
        (u64::from(counts.rejected), "rejected"),
        (u64::from(counts.late), "late"),
    ];
    let told = parts.iter().filter(|(count, _)| *count > 0);
    let told: Vec<String> = told.map(|(count, what)| format!("{what} {count}")).collect();
    if told.is_empty() { "none".to_owned() } else { told.join(" ") }
}

/// Colours, where they are wanted; everything is in the words, too.
#[derive(Debug, Clone, Copy)]
struct Paint {
    colour: bool,
}

impl Paint {
    fn plain(self) -> Style {
        Style::new()
    }

    fn bold(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    fn coloured(self, colour: Color) -> Style {
        if self.colour { Style::new().fg(colour) } else { self.plain() }
    }

    fn bad(self) -> Style {
        self.coloured(Color::Red).add_modifier(Modifier::BOLD)
    }

    fn state(self, state: AxisState) -> Style {
        match state {
            AxisState::Tripped { .. } => self.bad(),
            AxisState::Active => self.coloured(Color::Green),
            AxisState::Arming | AxisState::Armed => self.coloured(Color::Yellow),
            AxisState::Stopping => self.coloured(Color::Magenta),
            AxisState::Unconfigured | AxisState::Idle | AxisState::Holding => self.plain(),
        }
    }

    fn bus(self, bus: &Bus) -> Style {
        use host_protocol::BusState::{BusOff, Passive, Warning};
        match bus.report.map(|report| report.state) {
            Some(BusOff | Passive) => self.bad(),
            Some(Warning) => self.coloured(Color::Yellow),
            _ => self.plain(),
        }
    }
}
