//! `mgw jog`

use std::io;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use crossterm::event::KeyCode;
use host_protocol::{Protocol, Setpoint};
use mgw_client::{Client, ClientError, Transport};

use super::drive::{Rounds, drive, nothing_to_tell};
use super::limits;
use crate::args::JogArgs;
use crate::failure::Failure;
use crate::keys::{Held, Keyboard};
use crate::session::{Session, print_events};

/// How fast unless told otherwise, rad/s.
const VELOCITY_RAD_S: f32 = 0.3;
/// The same as a fraction of a thruster's signal.
const SIGNAL: f32 = 0.05;
/// Between two looks at the keys while nothing moves.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Moves an axis while a key is held down.
pub fn run(session: &mut Session, arguments: &JogArgs) -> Result<(), Failure> {
    let axis = session.axis(&arguments.axis)?;
    session.refuse_unconfigured(&[axis], "it does not move")?;
    let forward = setpoint(session, axis, arguments)?;
    limits::check_setpoint(session, axis, forward)?;
    limits::check_setpoint(session, axis, reversed(forward))?;
    let Some(mut keyboard) = Keyboard::open().map_err(Failure::Terminal)? else {
        let text = "jog follows the keys of a terminal, and standard input is none; \
            `mgw set` moves without one";
        return Err(Failure::Usage(text.to_owned()));
    };
    session.out.aside(format!(
        "hold right or + to turn axis {axis} counter-clockwise, left or - clockwise, {}; let go \
         to stop; q ends",
        match forward {
            Setpoint::Signal { fraction } => format!("with {} % of its signal", fraction * 100.0),
            _ => format!("at {} rad/s", arguments.velocity.unwrap_or(VELOCITY_RAD_S)),
        }
    ));
    loop {
        match await_grip(session, axis, &mut keyboard) {
            Ok(Some(grip)) => {
                let setpoint = if grip.is_forward() { forward } else { reversed(forward) };
                if hold(session, axis, setpoint, grip)? == Wish::End {
                    return Ok(());
                }
            }
            Ok(None) | Err(Failure::Client(ClientError::Interrupted { .. })) => return Ok(()),
            Err(failure) => return Err(failure),
        }
    }
}

fn setpoint(session: &Session, axis: u8, arguments: &JogArgs) -> Result<Setpoint, Failure> {
    let is_thruster = session.out.motors.of(axis) == Some(Protocol::Thruster);
    let (option, value, setpoint) = match (arguments.velocity, arguments.signal) {
        (Some(velocity_rad_s), _) => {
            ("--velocity", velocity_rad_s, Setpoint::Velocity { velocity_rad_s })
        }
        (None, Some(fraction)) => ("--signal", fraction, Setpoint::Signal { fraction }),
        (None, None) if is_thruster => ("--signal", SIGNAL, Setpoint::Signal { fraction: SIGNAL }),
        (None, None) => {
            ("--velocity", VELOCITY_RAD_S, Setpoint::Velocity { velocity_rad_s: VELOCITY_RAD_S })
        }
    };
    if value > 0.0 {
        Ok(setpoint)
    } else {
        Err(Failure::Usage(format!("{option} {value}: the keys choose the direction: above 0")))
    }
}

fn reversed(setpoint: Setpoint) -> Setpoint {
    match setpoint {
        Setpoint::Signal { fraction } => Setpoint::Signal { fraction: -fraction },
        Setpoint::Velocity { velocity_rad_s } => {
            Setpoint::Velocity { velocity_rad_s: -velocity_rad_s }
        }
        other => other,
    }
}

/// The keyboard, and the key on it that moves the axis.
struct Grip<'a> {
    keyboard: &'a mut Keyboard,
    held: Held,
    code: KeyCode,
}

/// What becomes of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wish {
    GoOn,
    Stop,
    End,
}

impl Grip<'_> {
    fn is_forward(&self) -> bool {
        matches!(self.code, KeyCode::Right | KeyCode::Char('+' | '='))
    }

    /// From the keys that wait.
    fn wish(&mut self) -> io::Result<Wish> {
        while let Some(key) = self.keyboard.next()? {
            if ends(key.code) {
                return Ok(Wish::End);
            }
            if self.held.take(key, Instant::now()) != Some(self.code) {
                return Ok(Wish::Stop);
            }
        }
        let is_held = self.held.at(Instant::now()) == Some(self.code);
        Ok(if is_held { Wish::GoOn } else { Wish::Stop })
    }

    /// Arming takes its time, in which the key may have been let go: waits until it comes again.
    fn confirm(&mut self, client: &mut Client<Box<dyn Transport>>) -> Result<Wish, Failure> {
        if self.keyboard.forget_but(ends).map_err(Failure::Terminal)? {
            return Ok(Wish::End);
        }
        let since = Instant::now();
        self.held = Held::down(self.code, since);
        loop {
            match self.wish().map_err(Failure::Terminal)? {
                Wish::GoOn if self.held.came_after(since) => return Ok(Wish::GoOn),
                Wish::GoOn => client.pause(LOOK_EVERY)?,
                wish => return Ok(wish),
            }
        }
    }
}

fn moves(code: KeyCode) -> bool {
    matches!(code, KeyCode::Right | KeyCode::Left | KeyCode::Char('+' | '=' | '-'))
}

fn ends(code: KeyCode) -> bool {
    matches!(code, KeyCode::Esc | KeyCode::Char('q' | 'Q'))
}

/// Waits until a key that moves the axis is held down; `None` for the end.
fn await_grip<'a>(
    session: &mut Session,
    axis: u8,
    keyboard: &'a mut Keyboard,
) -> Result<Option<Grip<'a>>, Failure> {
    // What was pressed while the axis stopped moves nothing.
    if keyboard.forget_but(ends).map_err(Failure::Terminal)? {
        return Ok(None);
    }
    let mut held = Held::default();
    loop {
        session.client.pause(LOOK_EVERY)?;
        if let Some(tripped) = print_events(&mut session.client, &[axis], session.out)? {
            return Err(tripped);
        }
        while let Some(key) = keyboard.next().map_err(Failure::Terminal)? {
            if ends(key.code) {
                return Ok(None);
            }
            match held.take(key, Instant::now()) {
                Some(code) if moves(code) => return Ok(Some(Grip { keyboard, held, code })),
                _ => {}
            }
        }
    }
}

/// Moves the axis until its key is let go, then stops it. Whether that was the end.
fn hold(
    session: &mut Session,
    axis: u8,
    setpoint: Setpoint,
    mut grip: Grip<'_>,
) -> Result<Wish, Failure> {
    let mut wish = Ok(Wish::Stop);
    drive(session, axis, |session, armed| {
        let confirmed = grip.confirm(&mut session.client)?;
        wish = Ok(confirmed);
        if confirmed != Wish::GoOn {
            return Ok(nothing_to_tell);
        }
        let mut rounds = Rounds::new(session, &[armed]);
        let moved =
            session.client.hold_setpoints(&[armed.hold(setpoint)], Duration::MAX, |client| {
                wish = grip.wish();
                match wish {
                    Ok(Wish::GoOn) => rounds.turn(client),
                    _ => Ok(ControlFlow::Break(())),
                }
            });
        if matches!(moved, Err(ClientError::Interrupted { .. })) {
            wish = Ok(Wish::End);
        }
        rounds.end(moved)?;
        Ok(nothing_to_tell)
    })?;
    wish.map_err(Failure::Terminal)
}
