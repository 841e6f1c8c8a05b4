//! What comes from the gateway: results go to who asked, events to all.

use std::time::Duration;

use host_protocol::messages::class::COMMANDS;
use host_protocol::requests::{ReleaseAuthority, Subscribe};
use host_protocol::{Call, Error, Frame, Kind, Reply, Request};

use super::{Multiplexer, News, State, nothing};
use crate::cable::Asker;
use crate::events::Told;
use crate::program::{Fate, Turn};

/// After a refusal Hello goes out again after this time.
const GREET_AGAIN: Duration = Duration::from_secs(5);

impl Multiplexer {
    /// Bytes of the gateway.
    pub fn cable_bytes(&mut self, now: Duration, mut bytes: &[u8]) {
        while !bytes.is_empty() && self.state != State::Closed {
            let mut deframer = std::mem::take(&mut self.deframer);
            // What is damaged is asked for again by who waits for it.
            if let Some(Ok(frame)) = deframer.take(&mut bytes) {
                self.heard_at = now;
                self.copies.keep(&self.cable, &frame);
                self.heard(now, &frame);
            }
            self.deframer = deframer;
        }
    }

    fn heard(&mut self, now: Duration, frame: &Frame<'_>) {
        match frame.kind {
            Kind::Reply | Kind::Error => self.answered(now, frame),
            Kind::Event => self.told(frame),
            Kind::Request | Kind::WatcherRequest => {}
        }
    }

    fn told(&mut self, frame: &Frame<'_>) {
        let missing = self.next_event.map_or(0, |next| frame.sequence.wrapping_sub(next));
        // More than half of all numbers: an old one came again.
        let missing = if missing < 1 << 15 { missing } else { 0 };
        self.next_event = Some(frame.sequence.wrapping_add(1));
        let Some(told) = Told::read(frame.number, frame.body) else { return };
        self.gateway_us = told.time_us();
        if told.ends_authority() {
            self.commander = None;
        }
        for program in self.programs.values_mut() {
            program.inbox.count_lost(missing.into());
            program.tell(&told, self.subscribed.period_us);
        }
    }

    fn answered(&mut self, now: Duration, frame: &Frame<'_>) {
        let Some(asked) = self.cable.asked(frame.sequence) else { return };
        if frame.kind == Kind::Reply && frame.number != asked.ask.number {
            return;
        }
        let Some(asked) = self.cable.take(now, frame.sequence) else { return };
        if matches!(self.state, State::Greeting { .. }) {
            if asked.ask.opens_session() && !asked.watches {
                self.greeted(now, frame);
            } else {
                self.pass_on(&asked.asker, frame);
            }
            return;
        }
        let error = (frame.kind == Kind::Error).then_some(frame.number);
        if asked.watches {
            if error == Some(Error::NoSession {}.number()) {
                self.lose(now, "it has started anew");
                self.state = State::Greeting { next: now, hello: None };
                return;
            }
            self.probed_at = now;
        }
        let Asker::Program { id, order } = asked.asker else { return };
        if error == Some(Error::NobodyInCommand {}.number()) && !asked.ask.watches {
            // Who asked first commands now; others that asked before they could know ask again.
            if asked.claims == self.claims {
                self.in_command = Some(id);
                self.claims += 1;
            }
            if let Some(program) = self.programs.get_mut(&id)
                && let Some(kept) = program.kept(order)
            {
                kept.fate = Fate::Waits;
                program.queue.push_front(Turn::New(order));
            }
            return;
        }
        let took =
            error.is_none() && !asked.watches && Request::classes(asked.ask.number) & COMMANDS != 0;
        if took && self.in_command == Some(id) {
            let name = self.programs.get(&id).map(|program| program.name.clone());
            self.commander = name.filter(|name| !name.is_empty());
        }
        let releases = asked.ask.number == ReleaseAuthority::NUMBER && error.is_none();
        if releases && self.in_command == Some(id) {
            (self.in_command, self.commander) = (None, None);
            self.claims += 1;
        }
        if asked.ask.number == Subscribe::NUMBER
            && error.is_some()
            && let Some(program) = self.programs.get_mut(&id)
        {
            program.subscription = None;
        }
        self.pass_on(&asked.asker, frame);
    }

    fn pass_on(&mut self, asker: &Asker, frame: &Frame<'_>) {
        if let Asker::Program { id, order } = *asker
            && let Some(program) = self.programs.get_mut(&id)
        {
            program.answer(order, frame.kind, frame.number, frame.body);
        }
    }

    fn greeted(&mut self, now: Duration, frame: &Frame<'_>) {
        match Reply::decode(frame.number, frame.body) {
            Ok(Reply::Hello(hello)) if frame.kind == Kind::Reply => {
                self.gateway_us = hello.time_us;
                (self.state, self.next_event) = (State::Up, Some(0));
                (self.subscribed, self.probed_at) = (nothing(), now);
                let (board, firmware) = (hello.board.to_string(), hello.firmware.to_string());
                self.news.push(News::Found { board, firmware });
            }
            _ => {
                let error = Error::decode(frame.number, frame.body)
                    .unwrap_or(Error::Unknown { number: frame.number });
                self.state = State::Greeting { next: now + GREET_AGAIN, hello: None };
                self.news.push(News::Refused(error));
            }
        }
    }

    /// No session outlives the gateway's: what is owed is answered, and the connections end.
    pub(super) fn lose(&mut self, now: Duration, why: &'static str) {
        self.cable.clear();
        (self.in_command, self.commander, self.subscribed) = (None, None, nothing());
        self.claims += 1;
        if self.state != State::Up {
            return;
        }
        self.heard_at = now;
        for program in self.programs.values_mut() {
            program.refuse_owed(Error::GatewayAway {}, |_| true);
            program.over = true;
        }
        self.news.push(News::Lost(why));
    }
}
