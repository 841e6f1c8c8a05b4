//! A bad host cannot make the gateway forget a stop: whatever it sends between a trip and its
//! confirmation, the stop goes on, is repeated, and is confirmed.

use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};
use crate::dice::Dice;
use crate::generate;
use crate::plant::{BUS_SETUP, BUSES, LINKS, LISTENER, MOTORS};
use crate::world::World;
use host_protocol::{AxisParameter, REQUESTS, StopAction};
use promise_model::{Told, frame};

/// From one frame to the next, µs: all of them are sent before a stop that does not lead to rest
/// has failed.
const PAUSE_US: u64 = 1;
/// Within this the motors are at rest once they obey again, µs.
const CONFIRMED_WITHIN_US: u64 = 3_000_000;
/// A stop that is not confirmed is repeated; in each time of this length at least once, µs.
const REPEATED_WITHIN_US: u64 = 200_000;

/// What came of it.
#[derive(Debug, Clone, Copy)]
pub struct Outcome {
    /// Frames that were sent between the trip and the first confirmation.
    pub frames: u64,
    /// Axes whose stop went on all the time.
    pub axes: usize,
    /// Stop frames of each of these, at least.
    pub fewest_stops: u32,
}

/// Sends so many frames.
///
/// # Errors
/// The promise that was broken, or the axis whose stop was forgotten.
pub fn run(seed: u64, frames: u64) -> Result<Outcome, String> {
    let mut dice = Dice::seeded(seed);
    let mut world = World::new(1_000);
    let axes = moving(&mut world)?;
    let for_us = frames * PAUSE_US + 100_000;
    for axis in &axes {
        world.act(&Action::Motor { motor: *axis, does: Does::Disobeys { for_us } });
    }
    world.act(&Action::Ask { link: 1, ask: Ask::EStop });
    let motions = world.counts().motions;
    let mut sent = Vec::new();
    let mut stops: Vec<u32> = vec![0; axes.len()];
    let mut looked_us = world.since_start_us();
    for _ in 0..frames {
        world.run_to(world.since_start_us() + PAUSE_US);
        let action = any_frame(&mut dice, &mut sent);
        world.act(&action);
        if let Some(violation) = world.broken() {
            return Err(violation.to_string());
        }
        for axis in &axes {
            let told = world.oracle().told(*axis);
            if told != (Told::Tripped { confirmed: false }) || !world.oracle().owes_stop(*axis) {
                return Err(format!("the stop of axis {axis} is over: {told:?}, after {action:?}"));
            }
        }
        if world.since_start_us() - looked_us >= REPEATED_WITHIN_US {
            looked_us = world.since_start_us();
            for (axis, before) in axes.iter().zip(&mut stops) {
                let now = world.oracle().stops_left(*axis);
                if now <= *before {
                    return Err(format!("the stop of axis {axis} is not repeated"));
                }
                *before = now;
            }
        }
    }
    world.run_to(world.since_start_us() + CONFIRMED_WITHIN_US);
    for axis in &axes {
        if world.oracle().told(*axis) != (Told::Tripped { confirmed: true }) {
            return Err(format!(
                "the stop of axis {axis} is not confirmed: {:?}",
                world.oracle().told(*axis)
            ));
        }
    }
    if world.counts().motions != motions {
        return Err("a motor was moved".into());
    }
    let fewest_stops = stops.into_iter().min().unwrap_or(0);
    world
        .broken()
        .map_or(Ok(Outcome { frames, axes: axes.len(), fewest_stops }), |v| Err(v.to_string()))
}

/// Arms and moves the axes whose stop needs more than an acknowledgement.
fn moving(world: &mut World) -> Result<Vec<u8>, String> {
    let mut steps: Vec<Ask> = vec![Ask::Hello];
    steps.extend((0..BUSES).map(|bus| Ask::Bus {
        bus,
        window_us: 3_000,
        protocols: BUS_SETUP[usize::from(bus)].1,
        exclusive: false,
    }));
    let mut axes = Vec::new();
    for (axis, motor) in (0u8..).zip(&MOTORS) {
        let mut set = |parameter: AxisParameter, value| {
            steps.push(Ask::Set { axis, parameter: parameter.number(), value });
        };
        set(AxisParameter::Bus, Number::Unsigned(motor.bus.into()));
        set(AxisParameter::Protocol, Number::Unsigned(motor.protocol.number().into()));
        set(AxisParameter::Node, Number::Unsigned(motor.node.into()));
        set(AxisParameter::StopAction, Number::Unsigned(motor.stop.number().into()));
        if motor.stop == StopAction::Brake {
            set(AxisParameter::ReleaseBrakeWhenArming, Number::Bool(true));
        }
        set(AxisParameter::AllowUnknownMotorTimeout, Number::Bool(true));
        set(AxisParameter::StopsBeforeUnreachable, Number::Unsigned(100));
        if motor.stop != StopAction::Coast {
            axes.push(axis);
        }
    }
    steps.extend(axes.iter().map(|axis| Ask::Arm { axis: *axis }));
    for ask in steps {
        let at_us = world.since_start_us() + 5_000;
        world.step(&Step { at_us, action: Action::Ask { link: 0, ask } });
    }
    world.run_to(world.since_start_us() + 50_000);
    for axis in &axes {
        let permit = Permit { axis: *axis, epoch: 0, lead_us: 90_000 };
        world.act(&Action::Ask {
            link: 0,
            ask: Ask::Setpoint { permit, goal: Goal::Velocity(2.0) },
        });
    }
    world.run_to(world.since_start_us() + 60_000);
    match axes.iter().find(|axis| world.oracle().told(**axis) != Told::Active) {
        Some(axis) => Err(format!("axis {axis} does not move: {:?}", world.oracle().told(*axis))),
        None => Ok(axes),
    }
}

/// Anything that a bad host may send, on any link.
pub(crate) fn any_frame(dice: &mut Dice, sent: &mut Vec<Vec<u8>>) -> Action {
    /// Frames that may be replayed.
    const KEPT: usize = 64;
    let link = dice.byte() % LINKS;
    let sequence = u16::from_le_bytes([dice.byte(), dice.byte()]);
    let bytes = match dice.below(10) {
        0 => dice.bytes(60),
        1..3 if !sent.is_empty() => dice.pick(sent),
        3..7 => {
            // A request of the table with a body that may be one of its own; an axis or a bus comes
            // first in most.
            let number = dice.pick(REQUESTS).number;
            let mut body = dice.bytes(20);
            if let Some(first) = body.first_mut() {
                *first %= 10;
            }
            frame(dice.pick(&[1, 1, 1, 5]), sequence, number, &body)
        }
        _ => return Action::Ask { link, ask: generate::any_ask(dice) },
    };
    // A new session on the listening link would drop its events, and nobody would tell the model.
    if link == LISTENER && bytes.get(5) == Some(&1) {
        return Action::Ask { link, ask: Ask::Ping };
    }
    if sent.len() < KEPT {
        sent.push(bytes.clone());
    } else {
        let place = usize::from(dice.byte()) % KEPT;
        sent[place].clone_from(&bytes);
    }
    Action::Bytes { link, bytes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_thousand_frames_change_nothing() {
        let outcome = run(1, 20_000).unwrap();
        assert!(outcome.axes >= 5, "{outcome:?}");
    }
}
