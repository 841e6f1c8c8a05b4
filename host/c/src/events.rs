//! What the gateway says without being asked.

use std::time::Duration;

use host_protocol::{Event, EventMessage};

use crate::arguments::put;
use crate::connection::{Session, mgw_gateway, with_session};
use crate::error::mgw_result;
use crate::values::{mgw_axis, mgw_trip_reason};

/// What happened.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_event_kind {
    /// Nothing, in the time that was given.
    None = 0,
    /// An axis tripped: `axis.trip` says why.
    Tripped = 1,
    /// A stop is confirmed: `axis.stop_confirmed`.
    StopConfirmed = 2,
    /// An axis is in another state: `axis.state`.
    StateChanged = 3,
    /// This host has no right to command any more: what it had armed stops.
    AuthorityLost = 4,
    /// The e-stop is latched: nothing arms.
    EstopLatched = 5,
    /// The e-stop is cleared.
    EstopCleared = 6,
    /// The stops of an axis stay unconfirmed: its motor may be turning.
    AxisUnreachable = 7,
    /// A stop has not left in its time.
    StopDelayed = 8,
    /// Something else of PROTOCOL.md: `number`.
    Other = 9,
}

/// An event.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct mgw_event {
    /// A `mgw_event_kind`.
    pub kind: u32,
    /// The number of the event in PROTOCOL.md.
    pub number: u16,
    /// Events that were lost since the call before: in the gateway, on the way, or here, where 1024
    /// wait to be read.
    pub dropped: u32,
    /// Gateway time, µs.
    pub time_us: u64,
    /// The axis that it is of; `axis.axis` is 255 where it is of none. Of the rest only what the
    /// kind names counts.
    pub axis: mgw_axis,
}

/// What is of no axis.
const NO_AXIS: u8 = u8::MAX;

impl From<Option<EventMessage>> for mgw_event {
    fn from(message: Option<EventMessage>) -> Self {
        let of = |axis| mgw_axis::in_state(axis, host_protocol::AxisState::Unconfigured);
        let Some(EventMessage { dropped, time_us, event }) = message else {
            let kind = mgw_event_kind::None as u32;
            return Self { kind, number: 0, dropped: 0, time_us: 0, axis: of(NO_AXIS) };
        };
        let (kind, axis) = match &event {
            Event::Tripped { axis, trip } => {
                let tripped = host_protocol::AxisState::Tripped { confirmed: false };
                let reason = mgw_trip_reason::from(&trip.reason) as u32;
                let axis = mgw_axis { trip: reason, ..mgw_axis::in_state(*axis, tripped) };
                (mgw_event_kind::Tripped, axis)
            }
            Event::StopConfirmed { axis, .. } => {
                let axis = mgw_axis { stop_confirmed: true, ..of(*axis) };
                (mgw_event_kind::StopConfirmed, axis)
            }
            Event::StateChanged { axis, state } => {
                (mgw_event_kind::StateChanged, mgw_axis::in_state(*axis, *state))
            }
            Event::AuthorityLost { .. } => (mgw_event_kind::AuthorityLost, of(NO_AXIS)),
            Event::EStopLatched {} => (mgw_event_kind::EstopLatched, of(NO_AXIS)),
            Event::EStopCleared {} => (mgw_event_kind::EstopCleared, of(NO_AXIS)),
            Event::AxisUnreachable { axis, .. } => (mgw_event_kind::AxisUnreachable, of(*axis)),
            Event::StopDelayed { axis, .. } => (mgw_event_kind::StopDelayed, of(*axis)),
            _ => (mgw_event_kind::Other, of(NO_AXIS)),
        };
        Self { kind: kind as u32, number: event.number(), dropped, time_us, axis }
    }
}

/// Waits at most `timeout_us` µs for the next event and writes it to `event`: of kind
/// `MGW_EVENT_KIND_NONE` where none came. It sends nothing: what is armed needs setpoints
/// meanwhile, and a gateway that has restarted behind an open cable tells events from the next
/// `mgw_keep_alive`, `mgw_set` or `mgw_cycle` on.
///
/// # Safety
/// `event` is null or a place for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn mgw_poll_event(
    gateway: *mut mgw_gateway,
    timeout_us: u32,
    event: *mut mgw_event,
) -> mgw_result {
    // Safety: as the caller promises.
    unsafe {
        with_session(gateway, |session| {
            let Session { client, told_lost } = session;
            let message = client.poll_event(Duration::from_micros(timeout_us.into()))?;
            let mut told = mgw_event::from(message);
            let losses = client.losses();
            let lost = losses.events_lost + losses.events_dropped;
            let lost_since = u32::try_from(lost - *told_lost).unwrap_or(u32::MAX);
            told.dropped = told.dropped.saturating_add(lost_since);
            *told_lost = lost;
            put(event, told);
            Ok(())
        })
    }
}
