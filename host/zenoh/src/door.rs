//! Where queries come in: each is read, and goes to who answers it.

use std::sync::mpsc::{SyncSender, TrySendError};
use std::sync::{Mutex, PoisonError};

use serde_json::{Value, json};
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::query::Query;

use crate::brake::Brake;
use crate::clock::GatewayTime;
use crate::command::{Command, Lease, Word};
use crate::hand::{Grip, Hand};
use crate::keys::Meaning;
use crate::refusal::Refusal;

/// Queries for states that wait, at most.
pub const WAITING: usize = 64;

/// What is behind it.
pub struct Door {
    /// For the one peer in command.
    pub grip: Grip,
    /// The gateway's time.
    pub time: GatewayTime,
    /// For those who ask how something is.
    pub states: SyncSender<Query>,
    /// For those who stop.
    pub brake: Brake,
    /// What the peer in command commands with.
    pub hand: Mutex<Option<Hand>>,
}

impl Door {
    /// Lets a query in. Waits for nothing.
    pub fn let_in(&self, query: Query) {
        let key = query.key_expr().as_str();
        let refusal = match self.grip.keys.meaning(key) {
            Ok(None) => None,
            Ok(Some(Meaning::State)) => match self.states.try_send(query.clone()) {
                Ok(()) => None,
                Err(TrySendError::Full(_)) => Some(Refusal::Busy { waiting: WAITING }),
                Err(TrySendError::Disconnected(_)) => Some(Refusal::GatewayAway),
            },
            Ok(Some(Meaning::Command(word))) => self.command(word, &query).err(),
            Err(refusal) => Some(refusal),
        };
        if let Some(refusal) = refusal {
            refuse(&query, &refusal.to_json());
        }
    }

    fn command(&self, word: Word, query: &Query) -> Result<(), Refusal> {
        let payload = query.payload().map(|payload| payload.to_bytes()).unwrap_or_default();
        let key = self.grip.keys.command(word);
        match Command::read(word, &payload)? {
            Command::Stop(request) => {
                self.brake.stop(&self.grip.reach, request, query.clone(), key);
            }
            Command::Take { peer } => self.take(&peer, query)?,
            Command::KeepAlive { lease } => {
                self.hear(lease)?;
                self.with_hand(|hand| hand.keep_alive(lease));
                let time_us = self.time.now_us().ok_or(Refusal::GatewayAway)?;
                reply(query, &key, &json!({ "time_us": time_us }));
            }
            Command::Do { lease, deed } => {
                self.hear(lease)?;
                let ordered = self.with_hand(|hand| hand.order(lease, deed, query));
                ordered.unwrap_or(Err(Refusal::LeaseOver))?;
            }
        }
        Ok(())
    }

    fn hear(&self, lease: Lease) -> Result<(), Refusal> {
        let now = self.grip.court.now();
        self.grip.court.authority().hear(now, lease)
    }

    fn take(&self, peer: &str, query: &Query) -> Result<(), Refusal> {
        let lease = Lease(fastrand::u64(..));
        let (name, key) = (self.grip.keys.name(), self.grip.keys.peer(peer));
        let now = self.grip.court.now();
        self.grip.court.authority().take(now, peer, lease, name, &key)?;
        // Held while it begins: what the peer says next must find it.
        let mut hand = self.hand.lock().unwrap_or_else(PoisonError::into_inner);
        *hand = Some(Hand::take(self.grip.clone(), lease, query.clone()));
        Ok(())
    }

    fn with_hand<R>(&self, act: impl FnOnce(&Hand) -> R) -> Option<R> {
        self.hand.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(act)
    }
}

/// Answers a query under a key.
pub fn reply(query: &Query, key: &str, value: &Value) {
    let reply = query.reply(key, value.to_string()).encoding(Encoding::APPLICATION_JSON);
    // Who asked has gone.
    drop(reply.wait());
}

/// Refuses a query, with an object that has an `error`.
pub fn refuse(query: &Query, error: &Value) {
    let reply = query.reply_err(error.to_string()).encoding(Encoding::APPLICATION_JSON);
    // As above.
    drop(reply.wait());
}
