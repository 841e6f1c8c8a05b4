//! The stop: on a connection of its own, which waits behind nothing, for whoever asks.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use mgw_cli::programs;
use mgw_client::{StopRequest, stop_before_hello};
use serde_json::json;
use zenoh::query::Query;

use crate::door::{refuse, reply};
use crate::reach::Reach;
use crate::refusal::Refusal;

/// Stops of the same at a time that nothing has answered. Each is written again every 25 ms until
/// something does: one more would say nothing new.
const UNANSWERED: usize = 16;

/// Stops that are under way.
#[derive(Debug, Clone, Default)]
pub struct Brake(Arc<Mutex<Vec<StopRequest>>>);

impl Brake {
    /// Stops, in a thread of its own, and answers on `key` when the gateway has taken it.
    pub fn stop(&self, reach: &Reach, request: StopRequest, query: Query, key: String) {
        if !self.begin(request) {
            return refuse(&query, &Refusal::Busy { waiting: UNANSWERED }.to_json());
        }
        let (reach, brake) = (reach.clone(), self.clone());
        thread::spawn(move || {
            let stopped =
                reach.open().and_then(|mut transport| stop_before_hello(&mut transport, request));
            brake.end(request);
            match stopped {
                Ok(()) => reply(&query, &key, &json!({ "done": true })),
                Err(error) => refuse(&query, &programs::error(error)),
            }
        });
    }

    fn under_way(&self) -> MutexGuard<'_, Vec<StopRequest>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn begin(&self, request: StopRequest) -> bool {
        let mut under_way = self.under_way();
        let has_room = under_way.iter().filter(|one| **one == request).count() < UNANSWERED;
        if has_room {
            under_way.push(request);
        }
        has_room
    }

    fn end(&self, request: StopRequest) {
        let mut under_way = self.under_way();
        if let Some(place) = under_way.iter().position(|one| *one == request) {
            under_way.swap_remove(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::StopTarget;

    #[test]
    fn many_stops_of_an_axis_leave_room_for_an_e_stop() {
        let brake = Brake::default();
        let one = StopRequest::Stop(StopTarget::Axis(0));
        assert!((0..UNANSWERED).all(|_| brake.begin(one)));
        assert!(!brake.begin(one));
        assert!(brake.begin(StopRequest::EStop) && brake.begin(StopRequest::Stop(StopTarget::All)));
        brake.end(one);
        assert!(brake.begin(one));
    }
}
