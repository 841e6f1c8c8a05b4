//! 32 programs on one cable: one commands, one does not read, two flood, the others watch. Each is
//! killed, and the cable is out.

use std::time::Duration;

use mgw_client::host_protocol::requests as ask;
use mgw_client::host_protocol::{
    AxisParameter, AxisState, Call, ClearTarget, Event, Kind, StateField, StateFields, StopTarget,
    Trip, TripReason, Value,
};
use mgw_client::{ClientError, Transport};

use crate::MS;
use crate::rig::{Bench, LONG, Program, TURNING, frame, turn};

/// Between two setpoints.
const EVERY: Duration = Duration::from_millis(10);
/// The silence of a host after which its axes trip.
const SILENCE: Duration = Duration::from_millis(250);
/// A setpoint has 43 bytes, the bits of which take this long at 921600 bit/s.
const WORD: Duration = Duration::from_micros(467);
/// Numbers are written into the configuration of this axis.
const COUNTED_AXIS: u8 = 1;
/// A stop leaves within this time (GUARANTEES G5): 100 µs and six frames of 135 bits at 1 Mbit/s.
const BOUND_US: u32 = 910;

struct Crowd {
    bench: Bench,
    commander: Program,
    watchers: Vec<Program>,
    deaf: Program,
    floods: Vec<Program>,
    epoch: u32,
    rounds: u16,
    acknowledged: u32,
}

impl Crowd {
    fn new() -> Self {
        let bench = Bench::new();
        let commander = bench.program();
        let watchers = (0..28).map(|_| watcher(&bench, 50)).collect();
        let (deaf, floods) = (watcher(&bench, 1), vec![bench.program(), bench.program()]);
        bench.set_reads(deaf.transport().id, false);
        let (epoch, rounds, acknowledged) = (0, 0, 100_000);
        Self { bench, commander, watchers, deaf, floods, epoch, rounds, acknowledged }
    }

    fn turn(&mut self) {
        if let AxisState::Tripped { .. } = self.commander.list_axes().unwrap()[0].state {
            self.commander.clear(ClearTarget::Axis(0)).unwrap();
        }
        self.epoch = turn(&mut self.commander);
    }

    /// Everybody does what is theirs, so many times.
    fn go_on(&mut self, times: u16) {
        for _ in 0..times {
            self.rounds += 1;
            for flood in &mut self.floods {
                for more in 0..20 {
                    let sequence = self.rounds.wrapping_mul(20).wrapping_add(more);
                    let asked = frame(sequence, &ask::ReadState { axis: 0 });
                    flood.transport_mut().send(&asked).unwrap();
                }
            }
            self.commander.set(0, self.epoch, TURNING, LONG).unwrap();
            let number = Value::Unsigned(self.acknowledged + 1);
            self.commander.configure_axis(COUNTED_AXIS, AxisParameter::TtlUs, number).unwrap();
            self.acknowledged += 1;
            let place = usize::from(self.rounds) % self.watchers.len();
            let axes = self.watchers[place].list_axes().unwrap();
            assert_eq!(axes[0].state, AxisState::Active);
            for program in self.watchers.iter_mut().chain([&mut self.commander]) {
                while program.poll_event(Duration::ZERO).unwrap().is_some() {}
                assert_eq!(program.losses().events_lost, 0, "they are counted, not missing");
            }
            self.bench.run(EVERY);
        }
    }

    /// It is the next frame on the cable, and the motor has it in time.
    fn is_stopped_by(&mut self, place: usize) {
        let asked = self.bench.now();
        self.watchers[place].stop(StopTarget::Axis(0)).unwrap();
        let passed = self.first_on_the_cable(asked, ask::Stop::NUMBER);
        assert_eq!(passed, asked, "it is the next frame on the cable");
        let reaction_us = loop {
            let told = self.watchers[place].poll_event(100 * MS).unwrap();
            match told.expect("the stop is confirmed").event {
                Event::StopConfirmed { axis: 0, reaction_us, .. } => break reaction_us,
                _ => continue,
            }
        };
        assert!(reaction_us <= BOUND_US, "{reaction_us} µs");
    }

    fn first_on_the_cable(&self, since: Duration, wanted: u16) -> Duration {
        let rig = self.bench.0.borrow();
        let mut passed = rig.cable.iter().filter(|(at, _, of)| *at >= since && *of == wanted);
        passed.next().expect("it was answered").0
    }

    /// When who commanded was heard last.
    fn last_word(&self) -> Duration {
        let rig = self.bench.0.borrow();
        rig.cable.iter().rev().find(|(_, kind, _)| *kind == Kind::Request).unwrap().0
    }

    /// The axis has tripped by the silence of who commanded, at its time.
    fn has_tripped_since(&mut self, last_word: Duration) {
        let mut looks = self.bench.program();
        let trip = looks.read_state(0).unwrap().trip.expect("it has tripped");
        self.bench.close(&looks);
        let Trip { reason, time_us, .. } = trip;
        assert_eq!(reason, TripReason::HostSilent);
        let after = Duration::from_micros(time_us) - last_word;
        assert!((SILENCE..=SILENCE + WORD + MS).contains(&after), "{after:?}");
    }

    /// What was acknowledged is there.
    fn has_lost_nothing(&mut self) {
        let there = self.watchers[0].read_axis_parameter(COUNTED_AXIS, AxisParameter::TtlUs);
        assert_eq!(there.unwrap(), Some(Value::Unsigned(self.acknowledged)));
    }

    fn everybody_comes_again(&mut self) {
        self.commander = self.bench.program();
        self.watchers.iter_mut().for_each(|one| *one = watcher(&self.bench, 50));
        self.deaf = watcher(&self.bench, 1);
        self.bench.set_reads(self.deaf.transport().id, false);
        self.floods.iter_mut().for_each(|one| *one = self.bench.program());
    }
}

fn watcher(bench: &Bench, period_ms: u32) -> Program {
    let mut program = bench.program();
    let fields = StateFields::of(&[StateField::Position, StateField::Velocity]);
    program.subscribe(&[0], fields, MS * period_ms).unwrap();
    program
}

#[test]
fn of_32_programs_stops_go_first_and_nothing_acknowledged_is_lost() {
    let mut crowd = Crowd::new();
    for round in 0..3 {
        crowd.turn();
        crowd.go_on(30);
        crowd.is_stopped_by(round * 7);
        crowd.has_lost_nothing();

        // The deaths of others change nothing for who commands.
        crowd.bench.run(200 * MS);
        crowd.turn();
        crowd.bench.close(&crowd.deaf);
        crowd.bench.close(&crowd.floods[0]);
        crowd.bench.close(&crowd.watchers[3]);
        crowd.deaf = watcher(&crowd.bench, 1);
        crowd.bench.set_reads(crowd.deaf.transport().id, false);
        crowd.floods[0] = crowd.bench.program();
        crowd.watchers[3] = watcher(&crowd.bench, 50);
        crowd.commander.ping().unwrap();
        crowd.go_on(30);

        // Killed in command.
        crowd.bench.close(&crowd.commander);
        let last_word = crowd.last_word();
        crowd.bench.run(2 * SILENCE);
        crowd.has_tripped_since(last_word);
        crowd.has_lost_nothing();

        // The cable is out.
        crowd.commander = crowd.bench.program();
        crowd.turn();
        crowd.go_on(30);
        let last_word = crowd.last_word();
        crowd.bench.unplug();
        crowd.bench.run(2 * SILENCE);
        let Err(ClientError::Transport(_) | ClientError::Gateway(_)) = crowd.commander.ping()
        else {
            panic!("there is no cable")
        };
        crowd.bench.plug();
        crowd.bench.run(100 * MS);
        crowd.has_tripped_since(last_word);
        crowd.everybody_comes_again();
        crowd.has_lost_nothing();
    }
}
