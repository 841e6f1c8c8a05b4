//! The server without input or output: bytes of programs and of the cable in, bytes for both out.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use host_protocol::requests::{Hello, Ping, ReleaseAuthority, SUBSCRIPTION_PERIOD_US, Subscribe};
use host_protocol::{
    Call, Deframer, Error, Frame, Kind, PROTOCOL_MAJOR, PROTOCOL_MINOR, Reply, Request, StateFields,
};

use crate::ask::Ask;
use crate::cable::{Asker, Cable};
use crate::events::Told;
use crate::program::{Fate, Program, Turn};
use crate::seen::{Copies, Seen};

/// Hello goes out again after this time.
const HELLO_EVERY: Duration = Duration::from_millis(100);
/// After a refusal, after this time.
const GREET_AGAIN: Duration = Duration::from_secs(5);
/// How long a program waits for a gateway that has just been connected.
const GREETING_TAKES: Duration = Duration::from_millis(1_500);
/// Without a request of a watcher answered for this long the server asks one itself: a gateway that
/// started anew refuses it. It is no sign of life.
const PROBE_EVERY: Duration = Duration::from_secs(1);
/// A gateway that says nothing for this long is lost.
const LOST_AFTER: Duration = Duration::from_millis(3_500);
/// Stops of programs that have gone, at most.
const LAST_WORDS: usize = 64;
/// The period of a subscription to nothing, µs.
const NO_PERIOD_US: u32 = 1_000_000;

/// A program that is connected.
pub type ProgramId = u64;

/// What happened to the cable.
#[derive(Debug, Clone, PartialEq)]
pub enum News {
    /// A gateway answers.
    Found {
        /// Its board.
        board: String,
        /// What runs there.
        firmware: String,
    },
    /// The gateway is lost; why.
    Lost(&'static str),
    /// It refuses the server.
    Refused(Error),
}

/// How far the cable is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Closed,
    /// Hello is said until it is answered: when next, and under which number.
    Greeting {
        next: Duration,
        hello: Option<u16>,
    },
    Up,
}

/// One gateway for many programs.
pub struct Multiplexer {
    state: State,
    deframer: Deframer,
    cable: Cable,
    programs: BTreeMap<ProgramId, Program>,
    opened: ProgramId,
    /// The program that commands, as far as the gateway has not said otherwise.
    in_command: Option<ProgramId>,
    /// How often that has changed.
    claims: u64,
    /// Stops of programs that have gone.
    last_words: VecDeque<Ask>,
    /// Whose turn it was last.
    turn: ProgramId,
    /// What the gateway has been asked to sample.
    subscribed: Subscribe,
    /// The number that the next event of the gateway has.
    next_event: Option<u16>,
    gateway_us: u64,
    heard_at: Duration,
    probed_at: Duration,
    news: Vec<News>,
    copies: Copies,
}

impl Multiplexer {
    /// One without cable and programs. `seed`: the first number on the cable, another one each
    /// time.
    #[must_use]
    pub fn new(seed: u16) -> Self {
        Self {
            state: State::Closed,
            deframer: Deframer::new(),
            cable: Cable::starting_at(seed),
            programs: BTreeMap::new(),
            opened: 0,
            in_command: None,
            claims: 0,
            last_words: VecDeque::new(),
            turn: 0,
            subscribed: nothing(),
            next_event: None,
            gateway_us: 0,
            heard_at: Duration::ZERO,
            probed_at: Duration::ZERO,
            news: Vec::new(),
            copies: Copies::default(),
        }
    }

    /// From here on every frame of the cable is kept for [`take_seen`](Self::take_seen).
    pub fn copy_frames(&mut self) {
        self.copies.is_wanted = true;
    }

    /// The frames that have crossed the cable since the last time: those that
    /// [`poll_cable`](Self::poll_cable) gave, and those that came whole. A repeated one is there
    /// again.
    pub fn take_seen(&mut self) -> Vec<Seen> {
        self.copies.take()
    }

    /// A program has connected; `proved`: it may use the gateway.
    pub fn program_opened(&mut self, now: Duration, proved: bool) -> ProgramId {
        self.opened += 1;
        self.programs.insert(self.opened, Program::new(now, proved));
        self.opened
    }

    /// Its connection has ended. If it commanded, the gateway hears nothing more of it. A stop that
    /// was its last word still goes out, if there is a gateway.
    pub fn program_closed(&mut self, id: ProgramId) {
        let Some(mut program) = self.programs.remove(&id) else { return };
        if self.state == State::Closed || !program.proved {
            return;
        }
        for stop in program.take_stops() {
            if let Turn::Unanswered(ask) = stop
                && !self.last_words.contains(&ask)
                && self.last_words.len() < LAST_WORDS
            {
                self.last_words.push_back(ask);
            }
        }
    }

    /// Whether it has asked anything.
    #[must_use]
    pub fn has_asked(&self, id: ProgramId) -> bool {
        self.programs.get(&id).is_some_and(Program::has_asked)
    }

    /// Whether its connection is to be closed, once [`poll_program`](Self::poll_program) gives
    /// nothing more.
    #[must_use]
    pub fn is_over(&self, id: ProgramId) -> bool {
        self.programs.get(&id).is_none_or(|program| program.over)
    }

    /// The program that commands, as far as is known.
    #[must_use]
    pub fn in_command(&self) -> Option<ProgramId> {
        self.in_command
    }

    /// Whether a gateway answers.
    #[must_use]
    pub fn is_up(&self) -> bool {
        self.state == State::Up
    }

    /// What happened to the cable since the last time.
    pub fn take_news(&mut self) -> Vec<News> {
        std::mem::take(&mut self.news)
    }

    /// The cable has been opened.
    pub fn cable_opened(&mut self, now: Duration) {
        self.deframer = Deframer::new();
        self.cable.clear();
        self.state = State::Greeting { next: now, hello: None };
    }

    /// The cable is gone.
    pub fn cable_closed(&mut self, now: Duration) {
        self.lose(now, "the connection to it has ended");
        self.state = State::Closed;
        self.last_words.clear();
    }

    /// Bytes of a program.
    pub fn program_bytes(&mut self, now: Duration, id: ProgramId, mut bytes: &[u8]) {
        while let Some(program) = self.programs.get_mut(&id)
            && let Some(ask) = program.receive(now, &mut bytes)
        {
            if !program.over {
                self.asked_by(now, id, ask);
            } else if ask.stops() && program.proved {
                // Its connection is about to be closed.
                Self::stop_unanswered(program, ask);
            }
        }
    }

    fn asked_by(&mut self, now: Duration, id: ProgramId, ask: Ask) {
        let is_closed = self.state == State::Closed;
        let Some(program) = self.programs.get_mut(&id) else { return };
        if let Some(kept) = program.known(&ask) {
            let order = kept.order;
            match kept.fate {
                Fate::Waits => {}
                Fate::Asked(sequence) if self.cable.asked(sequence).is_none() && ask.stops() => {
                    kept.fate = Fate::Waits;
                    program.stops.push_back(Turn::New(order));
                }
                Fate::Asked(sequence) => {
                    let turns = if ask.stops() { &mut program.stops } else { &mut program.queue };
                    let again = Turn::Again(sequence);
                    if !turns.contains(&again) {
                        turns.push_back(again);
                    }
                }
                Fate::Answered { .. } => {
                    program.answer_again(order);
                    if ask.stops() {
                        Self::stop_unanswered(program, ask);
                    }
                }
            }
            return;
        }
        if ask.opens_session() && program.proved {
            program.begin_session();
            if self.in_command == Some(id) {
                // Its authority ends by silence, like that of a program that has gone.
                self.in_command = None;
                self.claims += 1;
            }
        }
        let (stops, sets_baud, proved) = (ask.stops(), ask.sets_baud(), program.proved);
        let Some(order) = program.keep(now, ask.clone()) else {
            program.inbox.request_dropped();
            if stops && proved {
                Self::stop_unanswered(program, ask);
            }
            return;
        };
        if !proved {
            program.refuse(order, Error::NoSession {});
            program.over = true;
        } else if stops {
            program.stops.push_back(Turn::New(order));
        } else if sets_baud {
            program.refuse(order, Error::LinkHasNoBaud {});
        } else if is_closed {
            program.refuse(order, Error::GatewayAway {});
        } else {
            program.queue.push_back(Turn::New(order));
        }
    }

    /// A stop is executed each time it comes; of the same ones that wait one is enough.
    fn stop_unanswered(program: &mut Program, ask: Ask) {
        let is_same = |turn: &Turn| matches!(turn, Turn::Unanswered(other) if other.number == ask.number && other.body == ask.body);
        if !program.stops.iter().any(is_same) {
            program.stops.push_back(Turn::Unanswered(ask));
        }
    }

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
        let Some(asked) = self.cable.take(frame.sequence) else { return };
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
        let releases = asked.ask.number == ReleaseAuthority::NUMBER && error.is_none();
        if releases && self.in_command == Some(id) {
            self.in_command = None;
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
    fn lose(&mut self, now: Duration, why: &'static str) {
        self.cable.clear();
        (self.in_command, self.subscribed) = (None, nothing());
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

    /// What time alone brings about: to be called every few milliseconds.
    pub fn tick(&mut self, now: Duration) {
        for asker in self.cable.forget(now) {
            if let Asker::Program { id, order } = asker
                && let Some(program) = self.programs.get_mut(&id)
            {
                program.forget(order);
            }
        }
        for program in self.programs.values_mut() {
            program.lapse(now);
            if self.state != State::Up {
                program
                    .refuse_owed(Error::GatewayAway {}, |kept| now >= kept.since + GREETING_TAKES);
            }
        }
        if self.state == State::Up && now >= self.heard_at + LOST_AFTER {
            self.lose(now, "it does not answer any more");
            self.state = State::Greeting { next: now, hello: None };
        }
    }

    /// The next frame for a program.
    pub fn poll_program(&mut self, id: ProgramId) -> Option<Vec<u8>> {
        let gateway_us = self.gateway_us;
        self.programs.get_mut(&id)?.next_frame(gateway_us)
    }

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
        let first = self.in_command.into_iter();
        for id in first.chain(self.in_turn()).collect::<Vec<_>>() {
            if let Some(frame) = self.next_of(now, id) {
                if self.in_command != Some(id) {
                    self.turn = id;
                }
                return Some(frame);
            }
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
        if let Some(ask) = self.last_words.pop_front() {
            return Some(self.cable.ask(now, Asker::Server, ask, true, self.claims).1);
        }
        for id in self.in_turn().collect::<Vec<_>>() {
            let turn = self.programs.get_mut(&id).and_then(|program| program.stops.pop_front());
            if let Some(frame) = turn.and_then(|turn| self.send(now, id, turn)) {
                self.turn = id;
                return Some(frame);
            }
        }
        None
    }

    fn next_of(&mut self, now: Duration, id: ProgramId) -> Option<Vec<u8>> {
        let watches = self.in_command != Some(id);
        loop {
            let program = self.programs.get_mut(&id)?;
            let turn = program.queue.front()?.clone();
            if let Turn::New(order) = turn
                && let Some(kept) = program.kept(order)
                && !self.cable.has_room(now, watches || kept.ask.watches, &kept.ask)
            {
                return None;
            }
            self.programs.get_mut(&id)?.queue.pop_front();
            if let Some(frame) = self.send(now, id, turn) {
                return Some(frame);
            }
        }
    }

    /// The frame of what a program wants; `None` where there is nothing to send for it any more.
    fn send(&mut self, now: Duration, id: ProgramId, turn: Turn) -> Option<Vec<u8>> {
        let commands = self.in_command == Some(id);
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
                self.programs.get_mut(&id)?.kept(order)?.fate = Fate::Asked(sequence);
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

fn nothing() -> Subscribe {
    Subscribe { axes: 0, fields: StateFields::from_bits(0), period_us: NO_PERIOD_US }
}

fn body<C: Call>(request: &C) -> Vec<u8> {
    let mut out = [0; host_protocol::MAX_BODY];
    postcard::to_slice(request, &mut out).map(|body| body.to_vec()).unwrap_or_default()
}
