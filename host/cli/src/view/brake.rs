//! The stop: on a connection of its own, which waits behind nothing, for whoever asks.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::StopTarget;
use mgw_client::{Interrupt, StopRequest, Transport};
use mgw_view::Outbox;
use serde_json::{Value, json};

use super::reach::Reach;
use crate::commands::{send_stop_first, stop_report};
use crate::explain::with_page;
use crate::failure::Failure;
use crate::output::Output;
use crate::session::Session;

/// Stops at a time that nothing has answered. Each is written again every 25 ms until something
/// does: one more would say nothing new.
const UNANSWERED: usize = 16;
/// Stops at a time whose confirmations are awaited. Of further ones it is only told that they were
/// taken.
const AWAITED: usize = 32;

static SENDING: AtomicUsize = AtomicUsize::new(0);
static WAITING: AtomicUsize = AtomicUsize::new(0);

/// Behind a stop that was taken, for the motors' confirmations: a page gives its request up after
/// 3.5 s.
const REPORTED_WITHIN: Duration = Duration::from_secs(2);

/// A place among so many, until it is dropped.
struct Place(&'static AtomicUsize);

impl Place {
    fn take(taken: &'static AtomicUsize, of: usize) -> Option<Self> {
        let place = Self(taken);
        (taken.fetch_add(1, Ordering::Relaxed) < of).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Stops every axis; `taken` is called as soon as the gateway has taken it. Then what each axis
/// says.
fn stop(reach: &Reach, taken: impl FnOnce()) -> Result<Vec<Value>, Failure> {
    let Some(place) = Place::take(&SENDING, UNANSWERED) else {
        let text = format!("{UNANSWERED} stops are sent again until they are answered");
        return Err(Failure::Usage(text));
    };
    let transport = reach.open()?;
    let connect = |transport: Box<dyn Transport>| {
        drop(place);
        taken();
        Session::on(transport, Interrupt::default(), Output::kept())
    };
    let mut session = send_stop_first(transport, StopRequest::Stop(StopTarget::All), connect)?;
    let Some(_place) = Place::take(&WAITING, AWAITED) else { return Ok(Vec::new()) };
    let axes = session.axes_or_all(&[])?;
    let (outcomes, result) = stop_report::await_all(&mut session, &axes);
    match result {
        // Each axis says it for itself.
        Ok(()) | Err(Failure::StopNotConfirmed { .. }) => {
            Ok(stop_report::objects(&outcomes, &session.out.motors))
        }
        Err(failure) => Err(failure),
    }
}

/// What is told at the end.
fn report(axes: &[Value]) -> Value {
    json!({ "event": "stop", "phase": "report", "axes": axes })
}

/// Stops for a page, in a thread of its own.
pub fn stop_for(reach: &Reach, outbox: &Outbox) {
    let (reach, outbox) = (reach.clone(), outbox.clone());
    thread::spawn(move || {
        let taken = || outbox.put_json(&json!({ "event": "stop", "phase": "taken" }));
        let told = match stop(&reach, taken) {
            Ok(axes) => report(&axes),
            Err(failure) => json!({
                "event": "stop", "phase": "failed", "name": failure.name(),
                "message": with_page(&failure),
            }),
        };
        outbox.put_json(&told);
    });
}

/// Stops for a request of HTTP: whether it was taken, and what it came to, as JSON. Who asks waits
/// for the motors' confirmations only so long as it would still hear that it was taken.
pub fn stop_by_post(reach: &Reach) -> (bool, String) {
    let (tell, told) = mpsc::channel();
    let reach = reach.clone();
    thread::spawn(move || {
        let ended = stop(&reach, || drop(tell.send(None)));
        let _ = tell.send(Some(ended));
    });
    let mut taken = None::<Instant>;
    loop {
        let next = match taken {
            None => told.recv().ok(),
            Some(at) => told.recv_timeout(REPORTED_WITHIN.saturating_sub(at.elapsed())).ok(),
        };
        match next {
            Some(None) => taken = Some(Instant::now()),
            Some(Some(Ok(axes))) => return (true, report(&axes).to_string()),
            Some(Some(Err(failure))) => return (taken.is_some(), failure.to_json().to_string()),
            None => {
                return (taken.is_some(), json!({ "event": "stop", "phase": "taken" }).to_string());
            }
        }
    }
}
