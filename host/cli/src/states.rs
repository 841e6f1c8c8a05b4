//! States of axes as a table in SI units.

use host_protocol::replies::AxisReport;
use host_protocol::{FaultReading, Reading};

use crate::table::Table;
use crate::words::{self, NOTHING};

const HEADINGS: [&str; 11] = [
    ">axis",
    "state",
    ">position rad",
    ">velocity rad/s",
    ">current A",
    ">voltage V",
    ">motor °C",
    ">driver °C",
    "faults",
    ">age ms",
    "trip",
];

/// Digits after the point: what the motors' own resolution is worth.
const ANGLE_DIGITS: usize = 3;
const VELOCITY_DIGITS: usize = 2;
const CURRENT_DIGITS: usize = 2;
const VOLTAGE_DIGITS: usize = 1;
const TEMPERATURE_DIGITS: usize = 0;

/// A row for each axis.
pub fn table(reports: &[AxisReport]) -> Table {
    let mut table = Table::new(&HEADINGS);
    for report in reports {
        table.row([
            report.axis.to_string(),
            words::axis_state(report.state).to_owned(),
            words::reading(report.position_rad, ANGLE_DIGITS),
            words::reading(report.velocity_rad_s, VELOCITY_DIGITS),
            words::reading(report.current_a, CURRENT_DIGITS),
            words::reading(report.voltage_v, VOLTAGE_DIGITS),
            words::reading(report.motor_temperature_c, TEMPERATURE_DIGITS),
            words::reading(report.driver_temperature_c, TEMPERATURE_DIGITS),
            faults(report.faults),
            age(report),
            report.trip.map_or(String::new(), |trip| words::trip_reason(&trip.reason)),
        ]);
    }
    table
}

fn faults(faults: Option<FaultReading>) -> String {
    match faults {
        None => NOTHING.to_owned(),
        Some(FaultReading { word: 0, .. }) => "none".to_owned(),
        Some(FaultReading { word, .. }) => format!("{word:#06x}"),
    }
}

/// The age of what tells most about motion: the velocity, or else the position.
fn age(report: &AxisReport) -> String {
    let reading: Option<Reading> = report.velocity_rad_s.or(report.position_rad);
    reading.map_or(NOTHING.to_owned(), |reading| (reading.age_us / 1_000).to_string())
}
