//! `mgw bus`

use host_protocol::replies::BusReport;
use serde_json::json;

use crate::failure::Failure;
use crate::json;
use crate::session::Session;
use crate::table::Table;
use crate::words::{self, or_nothing};

/// Shows one bus, or all of the board.
pub fn run(session: &mut Session, bus: Option<u8>) -> Result<(), Failure> {
    let buses = match bus {
        Some(bus) => vec![bus],
        None => (0..).take(session.client.hello().buses.len()).collect(),
    };
    let mut reports = Vec::new();
    for bus in buses {
        reports.push((bus, session.client.bus_status(bus)?));
    }
    session.out.object(&json!({ "buses": reports.iter().map(|(bus, report)| json::gateway::bus(*bus, report)).collect::<Vec<_>>() }))?;
    let mut setup = Table::new(&[
        ">bus",
        "state",
        ">bit/s",
        "protocols",
        "exclusive",
        ">reply window µs",
        ">TEC",
        ">REC",
        "raw",
    ]);
    let mut counters = Table::new(&[
        ">bus",
        ">transmitted",
        ">received",
        ">unmatched",
        ">late",
        ">rejected",
        ">overflows",
        ">no acknowledgement",
        ">cancelled",
        ">bus-off",
    ]);
    for (bus, report) in &reports {
        setup.row(setup_row(*bus, report));
        let count = &report.counters;
        counters.row([
            bus.to_string(),
            count.transmitted.to_string(),
            count.received.to_string(),
            count.unmatched.to_string(),
            count.late.to_string(),
            count.rejected.to_string(),
            count.receive_overflows.to_string(),
            count.missed_acknowledgements.to_string(),
            count.cancelled.to_string(),
            count.bus_offs.to_string(),
        ]);
    }
    session.out.table(&setup)?;
    session.out.text("")?;
    session.out.table(&counters)
}

fn setup_row(bus: u8, report: &BusReport) -> [String; 9] {
    let config = report.config;
    [
        bus.to_string(),
        report.state.to_string(),
        or_nothing(config.map(|config| config.bitrate)),
        or_nothing(config.map(|config| words::protocols(config.protocols))),
        or_nothing(config.map(|config| words::yes_or_no(config.exclusive))),
        or_nothing(config.map(|config| config.reply_window_us)),
        report.transmit_errors.to_string(),
        report.receive_errors.to_string(),
        words::open_or_closed(report.raw_open).to_owned(),
    ]
}
