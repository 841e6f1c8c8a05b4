//! What was measured, as tables and as JSON.

use serde_json::{Value, json};

use super::{Cycles, Measured, Spread};
use crate::args::BenchArgs;
use crate::failure::Failure;
use crate::plan::{Premises, plan_to_json, rate, std_time};
use crate::session::Session;
use crate::table::Table;
use crate::words::{or_nothing, rounded};

/// Prints all of it.
pub fn measured(
    session: &Session,
    arguments: &BenchArgs,
    premises: &Premises,
    measured: &Measured,
) -> Result<(), Failure> {
    let (out, hello) = (session.out, session.client.hello());
    out.text(format!(
        "{}, firmware {}, build {}; {} rounds each",
        hello.board, hello.firmware, hello.build_id, arguments.rounds
    ))?;
    let mut trips = Table::new(&HEADINGS);
    for (name, spread) in [("Ping", &measured.ping), ("ReadState", &measured.read_state)] {
        trips.row(cells(name.to_owned(), spread, None));
    }
    for cycles in &measured.cycles {
        let name = format!("Cycle of {}", cycles.axes.len());
        trips.row(cells(name, &cycles.spread, Some(cycles)));
    }
    out.table(&trips)?;
    out.text("jitter: p99 - p50; bus %: of the busiest bus's wire, its frames at their longest")?;
    for cycles in measured.cycles.iter().filter(|cycles| cycles.unanswered > 0) {
        let (count, of) = (cycles.unanswered, cycles.axes.len());
        out.text(format!("{count} setpoints of the cycles of {of} were not answered in time"))?;
    }
    for (axis, us) in &measured.delays {
        out.text(format!("axis {axis}: its motor begins its reply after {us} µs (estimated)"))?;
    }
    out.object(&json!({ "bench": {
        "board": hello.board.as_str(), "firmware": hello.firmware.as_str(),
        "build_id": hello.build_id.as_str(),
        "ping": to_json(&measured.ping), "read_state": to_json(&measured.read_state),
        "cycles": measured.cycles.iter().map(|cycles| json!({
            "axes": cycles.axes, "unanswered": cycles.unanswered,
            "measured": to_json(&cycles.spread), "planned": plan_to_json(&cycles.plan, premises),
            "bus_use_percent": rounded(bus_use(cycles)),
        })).collect::<Value>(),
        "reply_delays": measured.delays.iter().map(|(axis, us)| json!({
            "axis": axis, "reply_delay_us": us, "source": "estimated",
        })).collect::<Value>(),
    }}))
}

const HEADINGS: [&str; 10] = [
    "round",
    ">p50 µs",
    ">p99 µs",
    ">p99.9 µs",
    ">max µs",
    ">jitter µs",
    ">rate Hz",
    ">planned µs",
    ">planned Hz",
    ">bus %",
];

fn cells(name: String, spread: &Spread, cycles: Option<&Cycles>) -> Vec<String> {
    let us = |permille| spread.at(permille).as_micros().to_string();
    let round = cycles.and_then(|cycles| cycles.plan.round);
    vec![
        name,
        us(500),
        us(990),
        us(999),
        us(1_000),
        spread.jitter().as_micros().to_string(),
        format!("{:.1}", spread.rate()),
        or_nothing(round.map(|round| round.as_micros())),
        or_nothing(round.map(|round| format!("{:.1}", rate(round)))),
        or_nothing(cycles.map(|cycles| format!("{:.1}", bus_use(cycles)))),
    ]
}

/// The part of the busiest bus's time that the frames of the cycles took at most, percent.
pub fn bus_use(cycles: &Cycles) -> f64 {
    let wires = cycles.plan.buses.iter().map(|(_, plan)| std_time(plan.wire));
    100.0 * wires.max().unwrap_or_default().as_secs_f64() * cycles.spread.rate()
}

fn to_json(spread: &Spread) -> Value {
    let us = |permille| spread.at(permille).as_micros();
    json!({
        "rounds": spread.rounds(), "p50_us": us(500), "p99_us": us(990), "p99_9_us": us(999),
        "max_us": us(1_000), "jitter_us": spread.jitter().as_micros(),
        "rate_hz": rounded(spread.rate()),
    })
}
