//! States of axes as tables in SI units.

use host_protocol::replies::AxisReport;
use host_protocol::{AxisState, Event, FaultReading, Reading, StateField, StateFields};

use crate::explain::Page;
use crate::faults::Protocols;
use crate::json;
use crate::names::Names;
use crate::table::Table;
use crate::words::{self, NOTHING, or_nothing};

/// A reading older than this is marked, µs.
const STALE_AFTER_US: u32 = 1_000_000;
/// The mark.
const STALE: &str = "*";

/// Every field.
pub const ALL: StateFields = StateFields::of(StateField::ALL);

/// These fields, or every one where none is named.
pub fn or_all(named: &[StateField]) -> StateFields {
    if named.is_empty() { ALL } else { StateFields::of(named) }
}

/// What stands above a field.
pub fn heading(field: StateField) -> &'static str {
    match field {
        StateField::Position => ">position rad",
        StateField::Velocity => ">velocity rad/s",
        StateField::Current => ">current A",
        StateField::Voltage => ">voltage V",
        StateField::MotorTemperature => ">motor °C",
        StateField::DriverTemperature => ">driver °C",
        StateField::Faults => "faults",
    }
}

/// What a field is called in JSON, as in PROTOCOL.md.
pub fn json_names(field: &StateField) -> &'static [&'static str] {
    let number = json::axis::NUMBERS.iter().find(|(number, _)| number == field);
    number.map_or(&json::axis::FAULTS, |(_, name)| std::slice::from_ref(name))
}

/// Digits after the point: what the motors' own resolution is worth.
fn digits(field: StateField) -> usize {
    match field {
        StateField::Position => 3,
        StateField::Velocity | StateField::Current => 2,
        StateField::Voltage => 1,
        StateField::MotorTemperature | StateField::DriverTemperature | StateField::Faults => 0,
    }
}

/// A row for each axis, with why it tripped.
pub fn table(reports: &[AxisReport], motors: &Protocols, names: &Names) -> Table {
    let fields = StateField::ALL.iter().map(|field| heading(*field));
    let headings: Vec<&str> =
        axis_headings(names).into_iter().chain(["state"]).chain(fields).chain(["trip"]).collect();
    let mut table = Table::new(&headings);
    for report in reports {
        let mut row = axis_cells(report.axis, names);
        row.push(words::axis_state(report.state).to_owned());
        row.extend(StateField::ALL.iter().map(|field| match field {
            StateField::Position => reading(*field, report.position_rad),
            StateField::Velocity => reading(*field, report.velocity_rad_s),
            StateField::Current => reading(*field, report.current_a),
            StateField::Voltage => reading(*field, report.voltage_v),
            StateField::MotorTemperature => reading(*field, report.motor_temperature_c),
            StateField::DriverTemperature => reading(*field, report.driver_temperature_c),
            StateField::Faults => faults(report.faults),
        }));
        row.push(report.trip.map_or(String::new(), |trip| {
            let reason = words::trip_reason(&trip.reason, motors.of(report.axis));
            format!("{reason} {}", Page::of_trip(&trip.reason))
        }));
        table.row(row);
    }
    table
}

/// These, and one more where an axis has a name: the column of names.
fn named<T: Clone>(names: &Names, cells: &[T], name: T) -> Vec<T> {
    let name = names.have_axes().then_some(name);
    cells.iter().cloned().chain(name).collect()
}

/// The number of an axis, and its name where there is a column of names.
pub fn axis_cells(axis: u8, names: &Names) -> Vec<String> {
    let name = or_nothing(names.axis(axis));
    named(names, &[axis.to_string()], name)
}

/// The headings for them.
pub fn axis_headings(names: &Names) -> Vec<&'static str> {
    named(names, &[">axis"], "name")
}

/// The age of the youngest reading of a sample, µs.
pub fn youngest_us(event: &Event) -> Option<u32> {
    StateField::ALL.iter().filter_map(|field| event.age_us(*field)).min()
}

/// A sample as the row of a table that grows with time, under its headings; nothing of another
/// event.
pub fn sample(event: &Event, fields: StateFields, names: &Names) -> Option<Table> {
    let Event::Sample { axis, state, faults: fault_word, .. } = event else { return None };
    let headings: Vec<&str> = axis_headings(names)
        .into_iter()
        .chain(["state"])
        .chain(fields.iter().map(heading))
        .collect();
    let mut table = Table::new(&headings);
    let mut row = axis_cells(*axis, names);
    row.push(steady(*state));
    row.extend(fields.iter().map(|field| match field {
        StateField::Faults => faults(*fault_word),
        number => reading(number, event.reading(number)),
    }));
    table.row(row);
    Some(table)
}

/// A state as wide as most are, so that the columns of later rows keep their places.
fn steady(state: AxisState) -> String {
    const WIDTH: usize = 12;
    format!("{:<WIDTH$}", words::axis_state(state))
}

/// A reading in the digits of its field, marked where it is old.
pub fn reading(field: StateField, reading: Option<Reading>) -> String {
    let digits = digits(field);
    or_nothing(reading.map(|reading| format!("{:.digits$}{}", reading.value, mark(reading.age_us))))
}

/// A fault word likewise.
pub fn faults(faults: Option<FaultReading>) -> String {
    match faults {
        None => NOTHING.to_owned(),
        Some(FaultReading { word: 0, age_us, .. }) => format!("none{}", mark(age_us)),
        Some(FaultReading { word, warnings: 0, age_us }) => format!("{word:#06x}{}", mark(age_us)),
        Some(FaultReading { word, warnings, age_us }) if word == warnings => {
            format!("{word:#06x}{} only warns", mark(age_us))
        }
        Some(FaultReading { word, warnings, age_us }) => {
            format!("{word:#06x}{}, {warnings:#06x} only warns", mark(age_us))
        }
    }
}

fn mark(age_us: u32) -> &'static str {
    if age_us > STALE_AFTER_US { STALE } else { "" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_that_only_warns_is_told_from_one_that_trips() {
        let text = |word, warnings| faults(Some(FaultReading { word, warnings, age_us: 0 }));
        assert_eq!(text(0, 0), "none");
        assert_eq!(text(0x0040, 0), "0x0040");
        assert_eq!(text(0x1000, 0x1000), "0x1000 only warns");
        assert_eq!(text(0x1040, 0x1000), "0x1040, 0x1000 only warns");
    }

    #[test]
    fn a_sample_shows_what_was_asked_for_and_marks_what_is_old() {
        let event = Event::Sample {
            axis: 3,
            state: AxisState::Active,
            position_rad: Some(Reading { value: 1.25, age_us: 900 }),
            velocity_rad_s: Some(Reading { value: -2.0, age_us: 400 }),
            current_a: None,
            voltage_v: Some(Reading { value: 24.0, age_us: 1_000_001 }),
            motor_temperature_c: None,
            driver_temperature_c: None,
            faults: Some(FaultReading { word: 2, warnings: 0, age_us: 2_000_000 }),
        };
        let fields =
            StateFields::of(&[StateField::Position, StateField::Voltage, StateField::Faults]);
        let lines = sample(&event, fields, &Names::default()).unwrap().lines();
        assert_eq!(
            lines,
            [
                "axis  state         position rad  voltage V  faults",
                "   3  active               1.250      24.0*  0x0002*"
            ]
        );
        assert!(sample(&Event::EStopCleared {}, ALL, &Names::default()).is_none());
    }
}
