//! The log's lines on what the core tells: links, axes, trips, e-stop. The tasks log what happens
//! to their ports.

use gateway::LogEntry;
use host_protocol::{AxisState, Event};

/// Logs one entry.
pub fn write(entry: LogEntry) {
    match entry {
        LogEntry::Hello { link } => defmt::info!("host link {=u8}: hello", link),
        LogEntry::InCommand { link } => defmt::info!("host link {=u8}: in command", link),
        LogEntry::NoRandomNumber => {
            defmt::error!("the random generator of the chip gave no number: nothing can be armed");
        }
        LogEntry::MemoryDamaged => {
            defmt::error!("retained memory was damaged: the e-stop is latched, every axis trips");
        }
        LogEntry::Dropped { count } => defmt::warn!("{=u32} lines are missing here", count),
        LogEntry::Event(event) => write_event(event),
    }
}

fn write_event(event: Event) {
    match event {
        // The trip itself is told by an event of its own, and more of it.
        Event::StateChanged { state: AxisState::Tripped { .. }, .. } => {}
        Event::StateChanged { axis, state } => defmt::info!("axis {=u8}: {}", axis, state),
        Event::Tripped { axis, trip } => defmt::warn!("axis {=u8}: tripped: {}", axis, trip.reason),
        Event::StopConfirmed { axis, reaction_us, elapsed_us, .. } => defmt::info!(
            "axis {=u8}: stop sent after {=u32} us, confirmed after {=u32} us",
            axis,
            reaction_us,
            elapsed_us
        ),
        Event::AxisUnreachable { axis, stop_transmitted: true } => {
            defmt::error!("axis {=u8}: unreachable, its motor may be turning", axis)
        }
        Event::AxisUnreachable { axis, stop_transmitted: false } => {
            defmt::error!("axis {=u8}: its stop cannot be sent, its motor may be turning", axis)
        }
        Event::AuthorityLost { reason } => defmt::info!("nobody is in command: {}", reason),
        Event::EStopLatched {} => defmt::warn!("e-stop latched"),
        Event::EStopCleared {} => defmt::info!("e-stop cleared"),
        Event::EStopInputChanged { open: true } => defmt::warn!("e-stop input open"),
        Event::EStopInputChanged { open: false } => defmt::info!("e-stop input closed"),
        Event::EnableOutputChanged { active: true } => defmt::info!("enable output active"),
        Event::EnableOutputChanged { active: false } => defmt::warn!("enable output inactive"),
        // The task of a CAN bus tells more of it.
        Event::BusStateChanged { .. } => {}
        other => defmt::debug!("{}", other),
    }
}
