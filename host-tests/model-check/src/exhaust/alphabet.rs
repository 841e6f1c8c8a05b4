//! What can happen next.

use super::bytes::{
    FREE_BRAKE, moves, moves_leniently, native, raw, raw_in_two, read, reply_id, request_id, serial,
};
use super::pairs::Pair;
use super::prepared::WINDOW_US;
use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};
use crate::plant::{BUS_SETUP, LINE, MOTORS, Wired};
use crate::world::World;
use host_protocol::{AxisParameter, Protocol};

/// What can happen next. Until it does, nothing does.
#[derive(Debug, Clone, PartialEq)]
pub enum Letter {
    /// Somebody does something now.
    Now(Action),
    /// What is on its way happens: a frame ends, a reply begins, a deadline passes.
    Next,
    /// So much time passes, µs.
    Pause(u64),
}

impl Letter {
    /// Lets it happen. The step of it, where it is one by itself.
    pub fn happen(&self, world: &mut World) {
        match self {
            Self::Now(action) => world.act(action),
            Self::Next => world.run_to_next(),
            Self::Pause(us) => world.run_to(world.since_start_us() + us),
        }
    }

    /// As a step at this time; what only lets time pass is none.
    #[must_use]
    pub fn step(&self, at_us: u64) -> Option<Step> {
        match self {
            Self::Now(action) => Some(Step { at_us, action: action.clone() }),
            Self::Next | Self::Pause(_) => None,
        }
    }
}

/// The host that drives, and another.
const DRIVER: u8 = 0;
const OTHER: u8 = 1;
/// How long a setpoint lives, µs.
const LEAD_US: i32 = 48_000;
/// The period of a free-running cycle, µs.
const PERIOD_US: u32 = 20_000;
/// A node that no axis has.
const FREE_NODE: u32 = 9;

fn permit(axis: u8, epoch: i32, lead_us: i32) -> Permit {
    Permit { axis, epoch, lead_us }
}

fn goal(axis: u8, value: f32) -> Goal {
    match MOTORS[usize::from(axis)].protocol {
        Protocol::Thruster => Goal::Signal(value / 5.0),
        Protocol::Rmd | Protocol::D5 => Goal::Velocity(value),
    }
}

/// A setpoint as a host sends it that drives an axis.
pub(super) fn fresh(axis: u8) -> Ask {
    Ask::Setpoint { permit: permit(axis, 0, LEAD_US), goal: goal(axis, 0.5) }
}

fn set(axis: u8, parameter: AxisParameter, value: u32) -> Ask {
    Ask::Set { axis, parameter: parameter.number(), value: Number::Unsigned(value) }
}

/// Everything that can happen to a pair.
#[must_use]
pub fn alphabet(pair: &Pair) -> Vec<Letter> {
    let [first, second] = pair.axes;
    let mut letters = vec![Letter::Next];
    letters.extend([1_000, 20_000, 100_000, 300_000].map(Letter::Pause));
    let asks = of_driver(first, second).into_iter().map(|ask| Action::Ask { link: DRIVER, ask });
    let others = of_other(first, second).into_iter().map(|ask| Action::Ask { link: OTHER, ask });
    let motors = of_motors(first, second);
    letters.extend(asks.chain(others).chain(motors).chain(of_board()).map(Letter::Now));
    letters.extend(of_bus(first, second).into_iter().map(Letter::Now));
    letters
}

fn of_driver(first: u8, second: u8) -> Vec<Ask> {
    let [motor, beside] = [first, second].map(|axis| &MOTORS[usize::from(axis)]);
    let bus = motor.bus;
    // A bus that has no axis, or only the second.
    let elsewhere = if bus == LINE { 0 } else { LINE };
    let stranger = Wired { bus: elsewhere, protocol: Protocol::Rmd, node: 1, ..*motor };
    let both = 1 << first | 1 << second;
    let mut members = vec![(first, goal(first, 0.5)), (second, goal(second, 0.5))];
    members.sort_by_key(|(axis, _)| *axis);
    let mut asks = vec![
        // Setpoints: fresh, another one, stale, of another epoch; a move by a distance.
        fresh(first),
        fresh(second),
        Ask::Setpoint { permit: permit(first, 0, LEAD_US), goal: goal(first, -1.0) },
        Ask::Setpoint { permit: permit(first, 0, -1), goal: goal(first, 0.5) },
        Ask::Setpoint { permit: permit(first, -1, LEAD_US), goal: goal(first, 0.5) },
        Ask::Move { permit: permit(first, 0, LEAD_US), distance: 1.0, speed: 1.0 },
        // Both together: armed, moved in one request, and in periods.
        Ask::ArmTogether { axes: both },
        Ask::Cycle { lead_us: LEAD_US, epoch: 0, members },
        Ask::RunCycle { axes: both, period_us: PERIOD_US },
        Ask::RunCycle { axes: 0, period_us: PERIOD_US },
        // What ends motion.
        Ask::Stop { axis: first },
        Ask::Stop { axis: second },
        Ask::StopAll,
        Ask::Disarm { axis: first },
        Ask::Disarm { axis: second },
        Ask::EStop,
        Ask::Release,
        // What allows it.
        Ask::Arm { axis: first },
        Ask::Arm { axis: second },
        Ask::Clear { axis: first },
        Ask::Clear { axis: second },
        Ask::ClearGateway,
        Ask::ClearUnreachable { axis: first },
        Ask::Ping,
        // Configuration: to another bus, to another node, to that of the other axis, away; the bus
        // itself.
        set(first, AxisParameter::Bus, elsewhere.into()),
        set(first, AxisParameter::Node, FREE_NODE),
        set(first, AxisParameter::Node, beside.node.into()),
        set(first, AxisParameter::Protocol, (motor.protocol.number() % 3 + 1).into()),
        Ask::Remove { axis: first },
        set(second, AxisParameter::Bus, if beside.bus == LINE { 0 } else { LINE.into() }),
        Ask::Remove { axis: second },
        Ask::Provision { axis: first, timeout_ms: 100 },
        Ask::Bus {
            bus,
            window_us: WINDOW_US + 1_000,
            protocols: BUS_SETUP[usize::from(bus)].1,
            exclusive: false,
        },
        // Raw access: a question, motions.
        Ask::RawOpen { bus, unsafe_access: false },
        raw(motor, read(motor)),
        raw(motor, moves(motor)),
        raw(motor, moves_leniently(motor)),
        Ask::RawClose { bus },
        Ask::RawOpen { bus: elsewhere, unsafe_access: true },
        raw(&stranger, moves(&stranger)),
    ];
    if motor.protocol == Protocol::D5 && beside.bus == bus {
        // To where the other motor hears motion.
        let id =
            if beside.protocol == Protocol::Rmd { 0x400 } else { 0x300 } + u32::from(beside.node);
        asks.push(set(first, AxisParameter::D5RequestId, id));
    }
    if motor.protocol != Protocol::D5 {
        asks.push(Ask::Native { permit: permit(first, 0, LEAD_US), data: native(motor) });
    }
    if motor.protocol == Protocol::Rmd {
        asks.push(raw(motor, FREE_BRAKE.to_vec()));
    }
    if bus == LINE {
        asks.extend(raw_in_two(motor));
    }
    asks
}

fn of_other(first: u8, second: u8) -> [Ask; 7] {
    [
        Ask::Stop { axis: first },
        Ask::Stop { axis: second },
        Ask::StopAll,
        Ask::Disarm { axis: first },
        Ask::EStop,
        Ask::Take,
        fresh(first),
    ]
}

fn of_motors(first: u8, second: u8) -> Vec<Action> {
    let of = |motor| move |does| Action::Motor { motor, does };
    let doings = [
        // Its next reply is lost, late, doubled; its next command refused.
        Does::Mute { for_us: 2_000 },
        Does::Late { by_us: 6_000 },
        Does::Twice,
        Does::Refuses,
        // It is cut off, has a fault, loses its power, turns on.
        Does::Deaf { for_us: 150_000 },
        Does::Faults { word: faults_of(first) },
        Does::Faults { word: 0 },
        Does::Restarts,
        Does::Disobeys { for_us: 150_000 },
        Does::Turns { speed: 90.0, for_us: 50_000 },
    ];
    let beside = [
        Does::Mute { for_us: 2_000 },
        Does::Late { by_us: 6_000 },
        Does::Twice,
        Does::Refuses,
        Does::Deaf { for_us: 150_000 },
        Does::Faults { word: faults_of(second) },
        Does::Restarts,
        Does::Disobeys { for_us: 150_000 },
        Does::Turns { speed: 90.0, for_us: 50_000 },
    ];
    doings.map(of(first)).into_iter().chain(beside.map(of(second))).collect()
}

/// A fault that a motor of this protocol can have.
fn faults_of(axis: u8) -> u16 {
    if MOTORS[usize::from(axis)].protocol == Protocol::Rmd { 4 } else { 2 }
}

fn of_bus(first: u8, second: u8) -> Vec<Action> {
    let [motor, beside] = [first, second].map(|axis| &MOTORS[usize::from(axis)]);
    let bus = motor.bus;
    let mut actions = vec![Action::Overflow { bus }];
    if beside.bus != bus && beside.bus != 2 {
        actions.extend([
            Action::Cut { bus: beside.bus, for_us: 30_000 },
            Action::Short { bus: beside.bus, for_us: 5_000 },
        ]);
    }
    if bus == LINE {
        // Half a frame, and a motor's frame that nobody asked for.
        actions.push(Action::Noise { bus, bytes: vec![0x3E, motor.node, 8] });
        actions.push(Action::Noise { bus, bytes: serial(motor, read(motor)) });
        return actions;
    }
    let load = |id, for_us| Action::Foreign { bus, id, length: 8, pause_us: 0, for_us };
    actions.extend([
        Action::Cut { bus, for_us: 30_000 },
        Action::Short { bus, for_us: 5_000 },
        Action::Stubborn { bus, for_us: 30_000 },
        // Others: below all ids of ours, between two of them, above all; one that ends at once.
        load(0x001, 5_000),
        load(between(motor, beside), 30_000),
        load(0x7F0, 30_000),
        // Frames of other nodes that look like ours.
        Action::Stray { bus, id: reply_id(beside), data: vec![0x9C, 30, 10, 0, 0x64, 0, 1, 0] },
        Action::Stray { bus, id: reply_id(motor), data: vec![0x80, 0, 0, 0, 0, 0, 0, 0] },
    ]);
    actions
}

fn of_board() -> [Action; 5] {
    [
        Action::EStopInput { open: true },
        Action::EStopInput { open: false },
        Action::Reset,
        Action::ResetWhileSaving { words: 1, garbles: true },
        Action::PowerLoss,
    ]
}

/// An id that loses to the one motor's stop and beats the other's, where there is one.
fn between(one: &Wired, other: &Wired) -> u32 {
    let (low, high) =
        (request_id(one).min(request_id(other)), request_id(one).max(request_id(other)));
    if one.bus == other.bus && high - low > 1 { low + 1 } else { request_id(one) - 1 }
}
