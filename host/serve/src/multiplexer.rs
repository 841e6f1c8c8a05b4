//! The server without input or output: bytes of programs and of the cable in, bytes for both out.

mod asking;
mod hearing;
mod sending;

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use host_protocol::requests::Subscribe;
use host_protocol::{Deframer, Error, StateFields};

use crate::ask::Ask;
use crate::cable::{Asker, Cable};
use crate::program::{Program, Turn};
use crate::seen::{Copies, Seen};

/// How long a program waits for a gateway that has just been connected.
const GREETING_TAKES: Duration = Duration::from_millis(1_500);
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
    /// What the program is called that took authority last, until it is known to have lost it. It
    /// may have gone.
    commander: Option<String>,
    /// How often `in_command` has changed.
    claims: u64,
    /// Stops of programs that have gone, and whether one of them went out last of all stops.
    last_words: VecDeque<Ask>,
    last_words_went: bool,
    /// Whose turn it was last.
    turn: ProgramId,
    /// Who commands has waited for a full cable: one who watches goes next.
    watchers_next: bool,
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
            commander: None,
            claims: 0,
            last_words: VecDeque::new(),
            last_words_went: false,
            turn: 0,
            watchers_next: false,
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

    /// What it is called where others are told of it.
    pub fn name_program(&mut self, id: ProgramId, name: String) {
        if let Some(program) = self.programs.get_mut(&id) {
            program.name = name;
        }
    }

    /// What a program is called.
    #[must_use]
    pub fn name_of(&self, id: ProgramId) -> &str {
        self.programs.get(&id).map_or("", |program| &program.name)
    }

    /// Its connection has ended. If it commanded, the gateway hears nothing more of it. A stop that
    /// was its last word still goes out, if there is a gateway.
    pub fn program_closed(&mut self, id: ProgramId) {
        let Some(mut program) = self.programs.remove(&id) else { return };
        if self.state == State::Closed || !program.proved {
            return;
        }
        for stop in program.take_stops() {
            let ask = match stop {
                Turn::Unanswered(ask) => Some(ask),
                Turn::Again(sequence) => self.cable.asked(sequence).map(|asked| asked.ask.clone()),
                Turn::New(_) => None,
            };
            let is_known = |ask: &Ask| self.last_words.iter().any(|known| known.is_like(ask));
            let new = ask.filter(|ask| ask.stops() && !is_known(ask));
            if self.last_words.len() < LAST_WORDS {
                self.last_words.extend(new);
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
}

fn nothing() -> Subscribe {
    Subscribe { axes: 0, fields: StateFields::from_bits(0), period_us: NO_PERIOD_US }
}
