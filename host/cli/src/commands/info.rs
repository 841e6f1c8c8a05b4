//! `mgw info`

use host_protocol::replies::GatewayReport;
use host_protocol::{BusLimit, Subject};
use serde_json::json;

use crate::dialects;
use crate::failure::Failure;
use crate::json;
use crate::session::Session;
use crate::table::Table;
use crate::words;

/// Shows what the gateway said when the session was opened.
pub fn run(session: &mut Session) -> Result<(), Failure> {
    let hello = session.client.hello().clone();
    let status = session.client.gateway_status()?;
    let commander = status.holder.map_or(Ok(None), |_| session.client.commander())?;
    let stored = session.client.read_stored()?;
    let image = session.client.image()?;
    let motors = dialects::of_axes(session)?;
    let mut object = json::gateway::info(&hello, &status, &stored, &image);
    let names = session.known_names();
    object["name"] = json!(names.of(Subject::Gateway));
    object["commander"] = json!(commander);
    for (number, _) in (0u8..).zip(&hello.buses) {
        object["buses"][usize::from(number)]["name"] = json!(names.of(Subject::Bus(number)));
    }
    object["rmd_axes"] = motors.iter().map(dialects::Asked::json).collect();
    let out = session.out;
    out.object(&object)?;

    let lines = [
        ("board", hello.board.to_string()),
        ("firmware", format!("{}  ({})", hello.firmware, hello.build_id)),
        ("update", words::image(&image)),
        ("protocol", format!("{}.{}", hello.protocol_major, hello.protocol_minor)),
        ("started", format!("{}, {} ago", words::name(&hello.boot), words::seconds(hello.time_us))),
        ("axes", format!("up to {}", hello.max_axes)),
        ("message", format!("up to {} bytes", hello.max_message)),
        (
            "recorded",
            format!(
                "{} trips and starts, crash report: {}; see mgw trips",
                hello.trips_recorded,
                words::yes_or_no(hello.has_crash_report)
            ),
        ),
        ("command", words::in_command(status.holder, commander.as_deref())),
        ("e-stop", e_stop(&status)),
        ("stored", words::stored(&stored)),
        (
            "enable",
            match status.enable_output {
                Some(true) => "output active".to_owned(),
                Some(false) => "output inactive: an axis is unreachable".to_owned(),
                None => "no output".to_owned(),
            },
        ),
        (
            "self-test",
            match (status.random_number, status.memory_damaged) {
                (true, false) => "passed".to_owned(),
                (false, false) => NO_RANDOM_NUMBER.to_owned(),
                (true, true) => MEMORY_DAMAGED.to_owned(),
                (false, true) => format!("{NO_RANDOM_NUMBER}; {MEMORY_DAMAGED}"),
            },
        ),
    ];
    let limit = status.bus_limit.map(|limit| ("buses", bus_limit(limit).to_owned()));
    let name = names.of(Subject::Gateway).map(|name| ("name", name.to_owned()));
    for (name, text) in name.into_iter().chain(lines).chain(limit) {
        out.text(format!("{name:<10}{text}"))?;
    }
    let mut table = Table::new(&[">bus", "kind", "protocols", "bitrates", "name"]);
    for (number, bus) in (0u8..).zip(&hello.buses) {
        let bitrates: Vec<String> = bus.bitrates.iter().map(ToString::to_string).collect();
        table.row([
            number.to_string(),
            bus.kind.to_string(),
            words::protocols(bus.protocols),
            bitrates.join(", "),
            names.of(Subject::Bus(number)).unwrap_or_default().to_owned(),
        ]);
    }
    out.table(&table)?;
    motors.iter().flat_map(dialects::Asked::lines).try_for_each(|line| out.text(line))
}

const NO_RANDOM_NUMBER: &str = "the random generator gave no number: nothing can be armed";
const MEMORY_DAMAGED: &str =
    "the memory that outlives a reset was damaged: the e-stop was latched and every axis tripped";

/// Why a bus has no bitrate in the table.
fn bus_limit(limit: BusLimit) -> &'static str {
    match limit {
        BusLimit::BootPin => {
            "bus 0 is off: its input is BOOT0 too; set nSWBOOT0 = 0 and nBOOT0 = 1"
        }
        BusLimit::ChipRevision => {
            "bus 1 is off: with two CAN controllers this chip can read wrong frames; \
             buy one of revision V (NUCLEO-H743ZI2)"
        }
        BusLimit::NoClock => {
            "CAN is off: the board's clock did not run at the start, and the chip's own is not \
                exact enough; see to the clock, then reset the board"
        }
    }
}

/// Whether the e-stop is latched, and its input open.
pub fn e_stop(status: &GatewayReport) -> String {
    let latched = if status.e_stop_latched { "latched" } else { "not latched" };
    match status.e_stop_input_open {
        Some(open) => format!("{latched}, input {}", words::open_or_closed(open)),
        None => format!("{latched}, no input"),
    }
}
