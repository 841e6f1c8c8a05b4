//! Who looks on, and what each of them is told.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mgw_view::{Message, Outbox, foxglove};
use serde_json::{Value, json};

use crate::record::Message as Recorded;

/// Pictures on their way to a page that it has not drawn: further ones are left out, and counted.
const UNDRAWN: usize = 15;

/// What is told of something as it is now, in this order to who comes later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Whether there is a gateway.
    Link,
    /// What it is, and which axes it has.
    Axes,
    /// How it is.
    Gateway,
    /// How a bus is.
    Bus(u8),
    /// How an axis is.
    Axis(u8),
    /// Its trips and starts.
    Incidents,
}

/// One who looks on.
enum Seat {
    Page { outbox: Outbox, undrawn: VecDeque<u64> },
    Foxglove { outbox: Outbox, session: foxglove::Session },
}

#[derive(Default)]
struct Inner {
    seats: BTreeMap<u64, Seat>,
    next: u64,
    /// The last of each kind, for who comes later.
    latest: BTreeMap<Part, Value>,
    channels: Vec<foxglove::Channel>,
    ticks: u64,
}

/// All who look on.
#[derive(Clone, Default)]
pub struct Hub(Arc<Mutex<Inner>>);

impl Hub {
    /// A page comes and is told how everything is.
    pub fn seat_page(&self, outbox: &Outbox) -> u64 {
        let mut inner = self.inner();
        inner.latest.values().for_each(|value| outbox.put_json(value));
        inner.seat(Seat::Page { outbox: outbox.clone(), undrawn: VecDeque::new() })
    }

    /// A program comes that reads by Foxglove's protocol.
    pub fn seat_foxglove(&self, outbox: &Outbox) -> u64 {
        let mut inner = self.inner();
        outbox.put_json(&foxglove::server_info("mgw serve", &inner.next.to_string()));
        outbox.put_json(&foxglove::advertise(&inner.channels));
        let session = foxglove::Session::default();
        inner.seat(Seat::Foxglove { outbox: outbox.clone(), session })
    }

    /// It has gone.
    pub fn leave(&self, seat: u64) {
        self.inner().seats.remove(&seat);
    }

    /// A page has drawn this picture, and so all before it.
    pub fn has_drawn(&self, seat: u64, tick: u64) {
        if let Some(Seat::Page { undrawn, .. }) = self.inner().seats.get_mut(&seat) {
            undrawn.retain(|sent| *sent > tick);
        }
    }

    /// What a program says by Foxglove's protocol.
    pub fn hear_foxglove(&self, seat: u64, text: &str) {
        if let Some(Seat::Foxglove { outbox, session }) = self.inner().seats.get_mut(&seat)
            && let Err(why) = session.take(text)
        {
            outbox.put_json(&foxglove::error(&why));
        }
    }

    /// Tells all pages, also those that come later.
    pub fn keep(&self, part: Part, value: &Value) {
        self.inner().latest.insert(part, value.clone());
        self.tell(value);
    }

    /// Another session begins: what was known of buses and axes is known no longer.
    pub fn forget(&self) {
        self.inner().latest.clear();
    }

    /// Tells all pages.
    pub fn tell(&self, value: &Value) {
        let text = value.to_string();
        for seat in self.inner().seats.values() {
            if let Seat::Page { outbox, .. } = seat {
                outbox.put(Message::text(text.clone()));
            }
        }
    }

    /// A picture for all pages that have drawn those before.
    pub fn draw(&self, mut picture: Value) {
        let mut inner = self.inner();
        inner.ticks += 1;
        let tick = inner.ticks;
        picture["tick"] = json!(tick);
        for seat in inner.seats.values_mut() {
            let Seat::Page { outbox, undrawn } = seat else { continue };
            if undrawn.len() >= UNDRAWN {
                outbox.count_dropped();
                continue;
            }
            undrawn.push_back(tick);
            picture["left_out"] = json!(outbox.dropped());
            outbox.put_sample(Message::text(picture.to_string()));
        }
    }

    /// What can be read by Foxglove's protocol from now on.
    pub fn offer(&self, channels: Vec<foxglove::Channel>) {
        let mut inner = self.inner();
        if channels == inner.channels {
            return;
        }
        let before = std::mem::replace(&mut inner.channels, channels);
        for seat in inner.seats.values() {
            if let Seat::Foxglove { outbox, .. } = seat {
                if !before.is_empty() {
                    outbox.put_json(&foxglove::unadvertise(&before));
                }
                outbox.put_json(&foxglove::advertise(&inner.channels));
            }
        }
    }

    /// Whether anybody reads by Foxglove's protocol.
    pub fn has_foxglove(&self) -> bool {
        self.inner().seats.values().any(|seat| matches!(seat, Seat::Foxglove { .. }))
    }

    /// A message of a channel for all who have subscribed to it.
    pub fn publish(&self, told: &Recorded, log_time_ns: u64) {
        let inner = self.inner();
        let Some(channel) = inner.channels.iter().find(|channel| channel.topic == told.topic)
        else {
            return;
        };
        let payload = told.value.to_string();
        for seat in inner.seats.values() {
            let Seat::Foxglove { outbox, session } = seat else { continue };
            for subscription in session.of(channel.id) {
                let data = foxglove::data(subscription, log_time_ns, payload.as_bytes());
                outbox.put_sample(data);
            }
        }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn seat(&mut self, seat: Seat) -> u64 {
        self.next += 1;
        self.seats.insert(self.next, seat);
        self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_draws_nothing_is_spared_the_rest_which_is_counted() {
        let hub = Hub::default();
        let (slow, quick) = (Outbox::default(), Outbox::default());
        hub.seat_page(&slow);
        let seat = hub.seat_page(&quick);
        for tick in 1..=1_000 {
            hub.draw(json!({ "event": "samples" }));
            hub.has_drawn(seat, tick);
        }
        assert_eq!(slow.dropped(), 1_000 - 15);
        // Nobody takes them out here: the outbox itself is bounded, too.
        assert_eq!(quick.dropped(), 1_000 - 256);
    }

    #[test]
    fn a_page_that_draws_again_is_told_again() {
        let hub = Hub::default();
        let outbox = Outbox::default();
        let seat = hub.seat_page(&outbox);
        (0..100).for_each(|_| hub.draw(json!({})));
        assert_eq!(outbox.dropped(), 85);
        hub.has_drawn(seat, 15);
        (0..15).for_each(|_| hub.draw(json!({})));
        assert_eq!(outbox.dropped(), 85);
        hub.draw(json!({}));
        assert_eq!(outbox.dropped(), 86);
    }
}
