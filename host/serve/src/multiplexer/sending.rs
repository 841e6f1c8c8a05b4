//! What goes out on the cable next, and as whose.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::requests::{Hello, Ping, SUBSCRIPTION_PERIOD_US, Subscribe};
use host_protocol::{Call, Deframer, PROTOCOL_MAJOR, PROTOCOL_MINOR, Request, StateFields};

use super::{Multiplexer, ProgramId, State, nothing};
use crate::ask::Ask;
use crate::cable::Asker;
use crate::program::{Fate, Turn};

/// Hello goes out again after this time.
const HELLO_EVERY: Duration = Duration::from_millis(100);
/// Without a request of a watcher answered for this long the server asks one itself: a gateway that
/// started anew refuses it. It is no sign of life.
const PROBE_EVERY: Duration = Duration::from_secs(1);
/// Bytes of what it asks by itself, at most.
const OWN_BODY: usize = 32;

impl Multiplexer {
    /// The next frame for the cable: stops, then what the server asks itself, then who commands,
    /// then those who watch in turn.
    pub fn poll_cable(&mut self, now: Duration) -> Option<Vec<u8>> {
        let frame = self.next_for_cable(now)?;
        if self.copies.is_wanted
            && let Some(Ok(frame)) = Deframer::new().take(&mut frame.as_slice())
        {
            self.copies.keep(&self.cable, &frame);
        }
        Some(frame)
    }

    fn next_for_cable(&mut self, now: Duration) -> Option<Vec<u8>> {
        if self.state == State::Closed {
            return None;
        }
        if let Some(frame) = self.next_stop(now) {
            return Some(frame);
        }
        if let State::Greeting { next, hello } = self.state {
            return if now >= next { self.hello(now, hello) } else { None };
        }
        if let Some(frame) = self.own_request(now) {
            return Some(frame);
        }
        let watches = |id: &ProgramId| self.in_command != Some(*id);
        let mut ids: Vec<_> = self.in_turn().filter(watches).collect();
        if let Some(id) = self.in_command {
            ids.insert(if self.watchers_next { ids.len() } else { 0 }, id);
        }
        for id in ids {
            let ControlFlow::Break(frame) = self.next_of(now, id) else { continue };
            if self.in_command == Some(id) {
                self.watchers_next = frame.is_none();
            } else if frame.is_some() {
                (self.turn, self.watchers_next) = (id, false);
            }
            return frame;
        }
        None
    }

    /// The programs, beginning behind the one that had its turn last.
    fn in_turn(&self) -> impl Iterator<Item = ProgramId> {
        let behind = self.programs.range(self.turn + 1..).map(|(id, _)| *id);
        behind.chain(self.programs.range(..=self.turn).map(|(id, _)| *id))
    }

    fn next_stop(&mut self, now: Duration) -> Option<Vec<u8>> {
        if !self.cable.has_room_for_stop(now) {
            return None;
        }
        // Those who live and those who have gone take turns.
        let gone_first = !self.last_words_went;
        [gone_first, !gone_first].into_iter().find_map(|of_gone| {
            let frame = if of_gone { self.next_last_word(now) } else { self.next_live_stop(now) };
            self.last_words_went = of_gone;
            frame
        })
    }

    fn next_last_word(&mut self, now: Duration) -> Option<Vec<u8>> {
        let ask = self.last_words.pop_front()?;
        Some(self.cable.ask(now, Asker::Server, ask, true, self.claims).1)
    }

    fn next_live_stop(&mut self, now: Duration) -> Option<Vec<u8>> {
        for id in self.in_turn().collect::<Vec<_>>() {
            let Some(program) = self.programs.get_mut(&id) else { continue };
            let waits =
                |turn: &Turn| matches!(turn, Turn::Again(of) if self.cable.has_just_gone(now, *of));
            let place = program.stops.iter().position(|turn| !waits(turn));
            let turn = place.and_then(|place| program.stops.remove(place));
            if let Some(frame) = turn.and_then(|turn| self.send(now, id, turn)) {
                self.turn = id;
                return Some(frame);
            }
        }
        None
    }

    /// The next frame of a program, if it has one. Where that waits for the cable nobody goes
    /// before it.
    fn next_of(&mut self, now: Duration, id: ProgramId) -> ControlFlow<Option<Vec<u8>>> {
        let watches = self.in_command != Some(id);
        while let Some(program) = self.programs.get_mut(&id) {
            let Some(turn) = program.queue.front().cloned() else { break };
            let may_hang = program.may_hang(now);
            let body = match turn {
                Turn::New(order) => program.kept(order).map(|kept| &kept.ask),
                Turn::Again(sequence) => self.cable.asked(sequence).map(|asked| &asked.ask),
                Turn::Unanswered(ref ask) => Some(ask),
            };
            let (body, marked) = body.map_or((0, false), |ask| (ask.body.len(), ask.watches));
            if let Turn::New(order) = turn {
                let watches = watches || marked;
                if !watches && may_hang {
                    program.queue.pop_front();
                    program.drop_request(order);
                    continue;
                }
                if !self.cable.has_room(now, watches) {
                    break;
                }
            }
            if !self.cable.is_clear_for(now, body) {
                return ControlFlow::Break(None);
            }
            program.queue.pop_front();
            if let Some(frame) = self.send(now, id, turn) {
                return ControlFlow::Break(Some(frame));
            }
        }
        ControlFlow::Continue(())
    }

    /// The frame of what a program wants; `None` where there is nothing to send for it any more.
    fn send(&mut self, now: Duration, id: ProgramId, turn: Turn) -> Option<Vec<u8>> {
        // What goes out for a program that may hang is no sign of life.
        let may_hang = self.programs.get(&id).is_some_and(|program| program.may_hang(now));
        let commands = self.in_command == Some(id) && !may_hang;
        let claims = self.claims;
        match turn {
            Turn::New(order) => {
                let program = self.programs.get_mut(&id)?;
                let mut ask = program.kept(order)?.ask.clone();
                if ask.number == Subscribe::NUMBER {
                    self.subscribe(id, &mut ask);
                }
                let watches = !commands || ask.watches;
                let asker = Asker::Program { id, order };
                let (sequence, frame) = self.cable.ask(now, asker, ask, watches, claims);
                self.programs.get_mut(&id)?.kept(order)?.fate = Fate::Asked(sequence);
                Some(frame)
            }
            Turn::Again(sequence) => {
                let asked = self.cable.asked(sequence)?;
                // As a sign of life it would be that of who commands now.
                if asked.watches {
                    return self.cable.again(now, sequence);
                }
                if commands {
                    // What the gateway could take for a new one is a sign of life all the same.
                    let again = self.cable.again(now, sequence);
                    return Some(again.unwrap_or_else(|| self.own(now, &Ping {}, false).1));
                }
                let (ask, asker) = (asked.ask.clone(), asked.asker);
                let Asker::Program { order, .. } = asker else { return None };
                if !ask.stops() {
                    return None;
                }
                let (sequence, frame) = self.cable.ask(now, asker, ask, true, claims);
                // A new session has forgotten it, but not that it stops.
                if let Some(kept) = self.programs.get_mut(&id)?.kept(order) {
                    kept.fate = Fate::Asked(sequence);
                }
                Some(frame)
            }
            Turn::Unanswered(ask) => {
                let watches = !commands || ask.watches;
                Some(self.cable.ask(now, Asker::Server, ask, watches, claims).1)
            }
        }
    }

    /// Of a subscription that the gateway would take, the union of all goes out in its place.
    fn subscribe(&mut self, id: ProgramId, ask: &mut Ask) {
        let Ok(Request::Subscribe(wanted)) = Request::decode(ask.number, &ask.body) else { return };
        let (shortest, longest) = SUBSCRIPTION_PERIOD_US;
        if !(shortest..=longest).contains(&wanted.period_us) || wanted.fields.check().is_err() {
            return;
        }
        if let Some(program) = self.programs.get_mut(&id) {
            program.subscription = (wanted.axes != 0).then_some(wanted);
            program.inbox.sample_anew();
        }
        self.subscribed = self.union();
        ask.body = body(&self.subscribed);
    }

    fn union(&self) -> Subscribe {
        let all = self.programs.values().filter_map(|program| program.subscription);
        all.reduce(|one, other| Subscribe {
            axes: one.axes | other.axes,
            fields: StateFields::from_bits(one.fields.bits() | other.fields.bits()),
            period_us: one.period_us.min(other.period_us),
        })
        .unwrap_or_else(nothing)
    }

    /// The same bytes each time, so that one session begins.
    fn hello(&mut self, now: Duration, said: Option<u16>) -> Option<Vec<u8>> {
        let next = now + HELLO_EVERY;
        self.state = State::Greeting { next, hello: said };
        if let Some(again) = said.and_then(|sequence| self.cable.again(now, sequence)) {
            return Some(again);
        }
        let session = u32::try_from(now.as_micros() & 0xFFFF_FFFF).unwrap_or(0) ^ 0x5EED_0000;
        let hello =
            Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: PROTOCOL_MINOR, session };
        let (sequence, frame) = self.own(now, &hello, false);
        self.state = State::Greeting { next, hello: Some(sequence) };
        Some(frame)
    }

    /// What the server asks by itself, for nobody: as a watcher.
    fn own_request(&mut self, now: Duration) -> Option<Vec<u8>> {
        if !self.cable.is_clear_for(now, OWN_BODY) {
            return None;
        }
        let union = self.union();
        if union != self.subscribed {
            self.subscribed = union;
            return Some(self.own(now, &union, true).1);
        }
        if now < self.probed_at + PROBE_EVERY {
            return None;
        }
        self.probed_at = now;
        Some(self.own(now, &Ping {}, true).1)
    }

    fn own<C: Call>(&mut self, now: Duration, request: &C, watches: bool) -> (u16, Vec<u8>) {
        let ask = Ask { sequence: 0, number: C::NUMBER, body: body(request), watches };
        self.cable.ask(now, Asker::Server, ask, watches, self.claims)
    }
}

fn body<C: Call>(request: &C) -> Vec<u8> {
    let mut out = [0; host_protocol::MAX_BODY];
    postcard::to_slice(request, &mut out).map(|body| body.to_vec()).unwrap_or_default()
}
