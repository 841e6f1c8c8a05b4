//! The simulator's gateway [at full load](crate::full_load) for as long as wanted, in virtual time.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use mgw_client::Client;
use mgw_sim::{BOARD, Injection, MotorWiring, SimTransport, Station, Wiring, World};

use crate::full_load::{FullBus, FullLoad, REPLY_TIME, Tally};

/// Two CAN buses at 1 Mbit/s, and one axis on RS485.
const BUSES: [FullBus; 3] = [
    FullBus { bus: 0, bitrate: 1_000_000, motors: 4 },
    FullBus { bus: 1, bitrate: 1_000_000, motors: 4 },
    FullBus { bus: 2, bitrate: 1_000_000, motors: 1 },
];
/// The period of the cycle: at 944 µs the frames of four axes fill a bus.
const PERIOD: Duration = Duration::from_micros(1_050);
const BAUD: u32 = 2_000_000;
/// How often everybody's counts are compared.
const LOOK_EVERY: Duration = Duration::from_secs(1);
const TELL_EVERY: Duration = Duration::from_secs(60);

/// Requests and replies on each bus.
type Seen = [(u64, u64); BUSES.len()];

/// Runs for so long. `tell` hears every minute of virtual time how far it is, and says whether to
/// go on.
///
/// # Errors
/// What was lost, came twice, grew or disagreed.
pub fn run(duration: Duration, mut tell: impl FnMut(&Tally) -> bool) -> Result<Tally, String> {
    let motors: Vec<MotorWiring> = BUSES.into_iter().flat_map(FullBus::motors).collect();
    let count = motors.len();
    let wiring = Wiring { motors, random_number: Some(1), ..Wiring::on(&BOARD) };
    let world = Rc::new(RefCell::new(World::try_new(wiring).map_err(|e| e.to_string())?));
    for motor in 0..count {
        world.borrow_mut().inject(motor, Injection::ReplyTime(Some(REPLY_TIME)));
    }
    let transport = SimTransport::new(world.clone(), 0);
    let client = Client::connect_as(transport, 1, 1).map_err(|e| e.to_string())?;
    let mut load = FullLoad::set_up(client, BAUD, BUSES.to_vec(), PERIOD)?;
    world.borrow_mut().trace();
    load.begin()?;
    let mut seen = Seen::default();
    let (mut next_look, mut next_tell) = (LOOK_EVERY, Duration::ZERO);
    while load.tally.lasted < duration {
        load.last_until(next_look)?;
        next_look += LOOK_EVERY;
        count_frames(&world, &mut seen);
        let backlog = world.borrow().host_backlog(0);
        load.look(backlog)?;
        if load.tally.lasted >= next_tell {
            next_tell += TELL_EVERY;
            if !tell(&load.tally) {
                break;
            }
        }
    }
    load.end()?;
    count_frames(&world, &mut seen);
    load.compare(&seen)
}

/// Counts what was on the wires since the last time.
fn count_frames(world: &RefCell<World>, seen: &mut Seen) {
    for entry in world.borrow_mut().trace() {
        let Some((sent, heard)) = seen.get_mut(usize::from(entry.bus)) else { continue };
        *if entry.from == Station::Gateway { sent } else { heard } += 1;
    }
}
