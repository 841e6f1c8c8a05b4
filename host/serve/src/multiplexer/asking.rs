//! What programs ask: each request is remembered, answered from memory, refused, or waits for its
//! turn on the cable.

use std::time::Duration;

use host_protocol::{Call as _, Error, Kind, MAX_BODY};
use mgw_client::ReadCommander;

use super::{Multiplexer, ProgramId, State};
use crate::ask::Ask;
use crate::program::{Fate, Program, Turn};

impl Multiplexer {
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
        let asks_for_commander = ask.number == ReadCommander::NUMBER;
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
        } else if asks_for_commander {
            let mut out = [0; MAX_BODY];
            let body = postcard::to_slice(&self.commander, &mut out).unwrap_or_default();
            program.answer(order, Kind::Reply, ReadCommander::NUMBER, body);
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
        let is_same = |turn: &Turn| matches!(turn, Turn::Unanswered(other) if other.is_like(&ask));
        if !program.stops.iter().any(is_same) {
            program.stops.push_back(Turn::Unanswered(ask));
        }
    }
}
