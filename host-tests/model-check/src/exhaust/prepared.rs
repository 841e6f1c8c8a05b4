//! The states from which sequences begin.

use super::alphabet::fresh;
use super::pairs::Pair;
use crate::action::{Action, Ask, Does, Number, Step};
use crate::plant::{BUS_SETUP, BUSES, LINE, MOTORS};
use crate::world::World;
use host_protocol::{AxisParameter, Protocol, StopAction};
use promise_model::Told;

/// A state that the first axis of a pair is in; what the second is in with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prepared {
    /// Both are idle.
    Idle,
    /// Both are idle and watched; a poll of the first is on its way and comes to nothing.
    Watched,
    /// Both are armed.
    Armed,
    /// Both move.
    Active,
    /// The first is being stopped, the second moves.
    Stopping,
    /// The first has tripped, its stop is confirmed; the second is armed.
    Tripped,
}

impl Prepared {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Idle, Self::Watched, Self::Armed, Self::Active, Self::Stopping, Self::Tripped];
}

/// Between two requests of the preparation, µs.
const REQUEST_US: u64 = 60;
/// How often the host looks, and how long, µs.
const LOOK_US: u64 = 5_000;
const LOOKS: u32 = 200;
/// How often a host is told what it watches, µs.
const PERIOD_US: u32 = 5_000;
/// For so long a cable is cut, µs: idle motors that are watched are polled every 50 ms.
const CUT_US: u64 = 100_000;
/// And for so long still when the poll is on its way, µs: less than a frame may stay in a
/// controller.
const STILL_CUT_US: u64 = 10_000;
/// The motors' own timeout, ms.
const MOTOR_TIMEOUT_MS: u32 = 200;
/// Reply window of the buses, µs.
pub(super) const WINDOW_US: u32 = 2_000;
/// How long both move before a sequence begins, µs: each motor has had its setpoint and has
/// answered.
const MOVING_US: u64 = 3_000;

/// A world that is being prepared, and how.
struct Preparation {
    world: World,
    steps: Vec<Step>,
}

/// The world in a prepared state, and the steps that lead there.
///
/// # Errors
/// The axis that does not come into the state.
pub fn prepare(
    start_us: u64,
    pair: &Pair,
    prepared: Prepared,
) -> Result<(World, Vec<Step>), String> {
    let mut preparation = Preparation { world: World::new(start_us), steps: Vec::new() };
    preparation.configure(pair);
    let [first, second] = pair.axes;
    if !matches!(prepared, Prepared::Idle | Prepared::Watched) {
        for axis in pair.axes {
            preparation.ask(Ask::Arm { axis });
            preparation.until(axis, Told::Armed)?;
        }
    }
    let moving: &[u8] = match prepared {
        Prepared::Idle | Prepared::Watched | Prepared::Armed => &[],
        Prepared::Active | Prepared::Stopping => &pair.axes,
        Prepared::Tripped => &[first],
    };
    for axis in moving {
        preparation.ask(fresh(*axis));
    }
    preparation.wait(if moving.is_empty() { 0 } else { MOVING_US });
    match prepared {
        Prepared::Stopping => preparation.ask(Ask::Stop { axis: first }),
        // Its setpoint is not renewed.
        Prepared::Tripped => {
            preparation.until(first, Told::Tripped { confirmed: true })?;
            preparation.until(second, Told::Armed)?;
        }
        Prepared::Watched => preparation.watch(first)?,
        Prepared::Idle | Prepared::Armed | Prepared::Active => {}
    }
    match preparation.world.broken() {
        Some(violation) => Err(format!("{}, {prepared:?}: {violation}", pair.name)),
        None => Ok((preparation.world, preparation.steps)),
    }
}

impl Preparation {
    fn ask(&mut self, ask: Ask) {
        let step = Step {
            at_us: self.world.since_start_us() + REQUEST_US,
            action: Action::Ask { link: 0, ask },
        };
        self.world.step(&step);
        self.steps.push(step);
    }

    /// Has the axes polled, and cuts the cable of one of them, or its motor off, from before its
    /// poll until a little later.
    fn watch(&mut self, axis: u8) -> Result<(), String> {
        self.ask(Ask::Subscribe { axes: u32::MAX, period_us: PERIOD_US });
        self.cut(axis, CUT_US);
        let end = self.world.since_start_us() + CUT_US;
        while !self.world.oracle().is_held(axis) {
            self.world.run_to_next();
            if self.world.since_start_us() > end {
                return Err(format!("axis {axis} is not polled"));
            }
        }
        self.cut(axis, STILL_CUT_US);
        Ok(())
    }

    fn cut(&mut self, axis: u8, for_us: u64) {
        let bus = MOTORS[usize::from(axis)].bus;
        let action = match bus != LINE {
            true => Action::Cut { bus, for_us },
            false => Action::Motor { motor: axis, does: Does::Deaf { for_us } },
        };
        let step = Step { at_us: self.world.since_start_us(), action };
        self.world.step(&step);
        self.steps.push(step);
    }

    fn wait(&mut self, us: u64) {
        self.world.run_to(self.world.since_start_us() + us);
    }

    /// Waits for a state, while the host shows that it is there.
    fn until(&mut self, axis: u8, state: Told) -> Result<(), String> {
        for _ in 0..LOOKS {
            if self.world.oracle().told(axis) == state {
                return Ok(());
            }
            self.wait(LOOK_US);
            self.ask(Ask::Ping);
        }
        Err(format!("axis {axis} is {:?}, not {state:?}", self.world.oracle().told(axis)))
    }

    fn configure(&mut self, pair: &Pair) {
        self.ask(Ask::Hello);
        let hello = Step {
            at_us: self.world.since_start_us() + REQUEST_US,
            action: Action::Ask { link: 1, ask: Ask::Hello },
        };
        self.world.step(&hello);
        self.steps.push(hello);
        for bus in 0..BUSES {
            let protocols = BUS_SETUP[usize::from(bus)].1;
            self.ask(Ask::Bus { bus, window_us: WINDOW_US, protocols, exclusive: false });
        }
        for axis in pair.axes {
            let motor = &MOTORS[usize::from(axis)];
            for (parameter, value) in [
                (AxisParameter::Bus, motor.bus),
                (AxisParameter::Protocol, motor.protocol.number()),
                (AxisParameter::Node, motor.node),
                (AxisParameter::StopAction, motor.stop.number()),
            ] {
                let value = Number::Unsigned(value.into());
                self.ask(Ask::Set { axis, parameter: parameter.number(), value });
            }
            if motor.stop == StopAction::Brake {
                let parameter = AxisParameter::ReleaseBrakeWhenArming.number();
                self.ask(Ask::Set { axis, parameter, value: Number::Bool(true) });
            }
            if motor.protocol != Protocol::D5 {
                self.ask(Ask::Provision { axis, timeout_ms: MOTOR_TIMEOUT_MS });
                self.wait(LOOK_US);
            }
        }
    }
}
