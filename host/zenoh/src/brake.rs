//! The stop: on a connection of its own, which waits behind nothing, for whoever asks.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use mgw_cli::programs;
use mgw_client::{StopRequest, stop_before_hello};
use serde_json::json;
use zenoh::query::Query;

use crate::door::{refuse, reply};
use crate::reach::Reach;
use crate::refusal::Refusal;

/// Stops at a time that nothing has answered. Each is written again every 25 ms until something
/// does: one more would say nothing new.
const UNANSWERED: usize = 16;

/// Stops that are under way.
#[derive(Debug, Clone, Default)]
pub struct Brake(Arc<AtomicUsize>);

/// One of them.
struct Place(Arc<AtomicUsize>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Brake {
    /// Stops, in a thread of its own, and answers on `key` when the gateway has taken it.
    pub fn stop(&self, reach: &Reach, request: StopRequest, query: Query, key: String) {
        let place = Place(self.0.clone());
        if self.0.fetch_add(1, Ordering::Relaxed) >= UNANSWERED {
            return refuse(&query, &Refusal::Busy { waiting: UNANSWERED }.to_json());
        }
        let reach = reach.clone();
        thread::spawn(move || {
            let stopped =
                reach.open().and_then(|mut transport| stop_before_hello(&mut transport, request));
            drop(place);
            match stopped {
                Ok(()) => reply(&query, &key, &json!({ "done": true })),
                Err(error) => refuse(&query, &programs::error(error)),
            }
        });
    }
}
