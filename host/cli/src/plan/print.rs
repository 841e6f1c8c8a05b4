//! A plan as tables and as JSON.

use std::time::Duration;

use gateway::BusPlan;
use serde_json::{Value, json};

use super::{Plan, Premises, held, rate, std_time};
use crate::args::HostLine;
use crate::explain::Page;
use crate::failure::Failure;
use crate::output::Output;
use crate::table::Table;
use crate::words::{kind, or_nothing};

/// Prints a plan, and what would make the wanted rate hold.
pub fn plan(
    out: Output,
    plan: &Plan,
    premises: &Premises,
    wanted: Option<f64>,
    changes: &[String],
) -> Result<(), Failure> {
    out.table(&buses(plan, premises))?;
    out.text("")?;
    out.table(&axes(plan, premises))?;
    out.text("")?;
    let (there, back) = plan.bytes;
    let line = match premises.host {
        HostLine::Usb => "USB, whose time counts for nothing".to_owned(),
        HostLine::Baud(baud) => format!("{baud} baud"),
    };
    out.text(format!(
        "host: {there} bytes out and {back} back, {} and {} µs, on {line}",
        plan.line.0.as_micros(),
        plan.line.1.as_micros()
    ))?;
    match (plan.round, plan.longest) {
        (Some(round), Some(longest)) => out.text(format!(
            "Cycle: {:.1} Hz, a round in {} µs, the longest in {} µs",
            held(rate(round)),
            round.as_micros(),
            longest.as_micros()
        ))?,
        _ => out.text("Cycle: none, a bus has no time left")?,
    }
    for error in plan.never_armed() {
        out.text(format!("never armed: {error} {}", Page::DoesNotArm))?;
    }
    for (bus, plan) in &plan.buses {
        for axis in plan.axes.iter().filter(|axis| !axis.reply_counts) {
            out.text(format!(
                "axis {}: a reply may come {} µs behind its request, and bus {bus} gives it {} µs: \
                 reply_window_us",
                axis.axis,
                axis.reply_within.as_micros(),
                plan.reply_window.as_micros()
            ))?;
        }
    }
    match plan.running {
        Some(running) => out.text(format!(
            "RunCycle: {:.1} Hz, a period of {} µs; its event of {} bytes takes {} µs of that",
            held(rate(running)),
            running.as_micros(),
            plan.event.0,
            plan.event.1.as_micros()
        ))?,
        None => out.text(format!(
            "RunCycle: none: a bus has no time left, or needs a period of more than {} µs",
            gateway::PERIOD_US.1
        ))?,
    }
    out.text(
        "RunCycle is refused below a bus's shortest period; from its period on it holds, and only \
         periods with polls in them take longer; from its steady period on none does",
    )?;
    out.text(format!(
        "assumed: {} µs of the gateway's software to the bus, between requests and back; every \
         frame as long as its unknown bits can make it; a position for each axis that takes one \
         but for --no-positions and --impedance; CAN where neither its bitrate nor --rs485 says \
         RS485; a reply delay of {} µs where * stands",
        premises.assumed.software.as_micros(),
        gateway::Assumptions::REPLY_DELAY.as_micros()
    ))?;
    out.object(&json!({
        "plan": to_json(plan, premises), "wanted_hz": wanted,
        "holds": wanted.map(|wanted| plan.holds(wanted, premises)), "changes": changes,
    }))
}

fn buses(plan: &Plan, premises: &Premises) -> Table {
    let mut table = Table::new(&[
        ">bus",
        "kind",
        ">axes",
        ">wire µs",
        ">cycle µs",
        ">period µs",
        ">steady µs",
        ">shortest µs",
        ">longest µs",
        ">rate Hz",
        ">polls %",
        ">streams %",
        ">foreign %",
    ]);
    for (bus, plan) in &plan.buses {
        table.row([
            bus.to_string(),
            kind(premises.kinds.get(usize::from(*bus))).to_owned(),
            plan.axes.len().to_string(),
            plan.wire.as_micros().to_string(),
            plan.cycle.as_micros().to_string(),
            or_none(plan.period),
            or_none(plan.steady),
            or_none(plan.shortest),
            or_none(plan.longest),
            or_nothing(bus_rate(plan).map(|rate| format!("{:.1}", held(rate)))),
            percent(plan.polls_permille),
            percent(plan.streams_permille),
            percent(plan.foreign_permille),
        ]);
    }
    table
}

fn axes(plan: &Plan, premises: &Premises) -> Table {
    let mut table = Table::new(&[
        ">axis",
        ">bus",
        ">request bits",
        ">reply bits",
        ">replies",
        ">reads",
        ">reply delay µs",
        ">answered µs",
        ">stop alone µs",
        ">stop with all µs",
    ]);
    let all =
        plan.buses.iter().flat_map(|(bus, plan)| plan.axes.iter().map(move |axis| (bus, axis)));
    for (bus, axis) in all {
        let mark = if premises.stated_delays.has(axis.axis) { "" } else { "*" };
        table.row([
            axis.axis.to_string(),
            bus.to_string(),
            axis.request_bits.to_string(),
            axis.reply_bits.to_string(),
            axis.replies.to_string(),
            axis.reads.to_string(),
            format!("{}{mark}", axis.reply_delay.as_micros()),
            axis.answered.as_micros().to_string(),
            or_none(axis.stop_alone),
            or_none(axis.stop_together),
        ]);
    }
    table
}

/// Microseconds, where there are any.
fn or_none(time: Option<gateway::Duration>) -> String {
    or_nothing(time.map(|time| time.as_micros()))
}

/// Cycles of one bus in a second, whatever the host.
fn bus_rate(plan: &BusPlan) -> Option<f64> {
    plan.period.filter(|period| *period > gateway::Duration::ZERO).map(|p| rate(std_time(p)))
}

fn percent(permille: u64) -> String {
    format!("{}.{}", permille / 10, permille % 10)
}

/// The plan for programs.
pub fn to_json(plan: &Plan, premises: &Premises) -> Value {
    let us = |time: gateway::Duration| time.as_micros();
    let whole_us = |time: Duration| time.as_micros();
    let buses = plan.buses.iter().map(|(bus, plan)| {
        let axes = plan.axes.iter().map(|axis| {
            json!({
                "axis": axis.axis, "request_bits": axis.request_bits,
                "reply_bits": axis.reply_bits, "replies": axis.replies, "reads": axis.reads,
                "reply_delay_us": us(axis.reply_delay),
                "can_confirm": axis.can_confirm,
                "reply_delay_stated": premises.stated_delays.has(axis.axis),
                "answered_us": us(axis.answered), "reply_within_us": us(axis.reply_within),
                "reply_counts": axis.reply_counts,
                "stop_alone_us": axis.stop_alone.map(us),
                "stop_together_us": axis.stop_together.map(us),
            })
        });
        json!({
            "bus": bus, "kind": kind(premises.kinds.get(usize::from(*bus))),
            "wire_us": us(plan.wire), "cycle_us": us(plan.cycle), "repeat_us": plan.repeat.map(us),
            "period_us": plan.period.map(us), "steady_us": plan.steady.map(us),
            "shortest_us": plan.shortest.map(us), "longest_us": plan.longest.map(us), "rate_hz": bus_rate(plan).map(held),
            "polls_permille": plan.polls_permille, "streams_permille": plan.streams_permille,
            "foreign_permille": plan.foreign_permille, "reply_window_us": us(plan.reply_window),
            "axes": axes.collect::<Value>(),
        })
    });
    let baud = match premises.host {
        HostLine::Baud(baud) => Some(baud),
        HostLine::Usb => None,
    };
    json!({
        "buses": buses.collect::<Value>(),
        "host": {
            "baud": baud, "out_bytes": plan.bytes.0, "back_bytes": plan.bytes.1,
            "out_us": plan.line.0.as_micros(), "back_us": plan.line.1.as_micros(),
            "event_bytes": plan.event.0, "event_us": plan.event.1.as_micros(),
        },
        "software_us": us(premises.assumed.software),
        "round_us": plan.round.map(whole_us), "longest_us": plan.longest.map(whole_us),
        "rate_hz": plan.rate().map(held),
        "running_us": plan.running.map(whole_us), "running_hz": plan.running.map(rate).map(held),
    })
}
