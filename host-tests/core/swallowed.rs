//! An RMD whose own timeout has acted answers the next command and ignores it: what it should hold
//! is held by the one behind, and what else it is told is told behind one.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::bench::{self, COAST, HOLD, arm, clear, listed, run_with_host, setpoint};
use crate::motors::Shared;
use crate::rig::Rig;
use host_protocol::{AxisParameter, AxisState, Request, Setpoint, StopAction, Value, requests};

const TIMEOUT_US: u64 = 300_000;

/// A motor that lets go by its own timeout, and can be unplugged.
#[derive(Default)]
struct Motor {
    is_unplugged: Cell<bool>,
    heard_us: Cell<u64>,
    is_deaf: Cell<bool>,
    is_on: Cell<bool>,
    obeyed: RefCell<Vec<String>>,
}

impl Motor {
    fn hear(&self, now: u64, text: &str) {
        if now - self.heard_us.replace(now) > TIMEOUT_US {
            self.is_deaf.set(true);
            self.is_on.set(false);
        }
        let reads = ["141#9", "141#B1", "141#B2", "141#B5"];
        if !reads.iter().any(|read| text.starts_with(read)) && !self.is_deaf.take() {
            self.is_on.set(text != COAST && (text == HOLD || self.is_on.get()));
            self.obeyed.borrow_mut().push(text.to_owned());
        }
    }
}

/// An RMD that holds, with such a motor.
fn held_motor() -> (Rig, Rc<Motor>, Shared) {
    let (mut rig, play) = bench::rmd_with_timeout(300);
    let motor = Rc::new(Motor::default());
    motor.heard_us.set(rig.now_us);
    let (plays, mut usual) =
        (motor.clone(), std::mem::replace(&mut rig.motor, Box::new(|_, _, _| None)));
    rig.motor = Box::new(move |now, bus, text| {
        if plays.is_unplugged.get() {
            return None;
        }
        plays.hear(now, text);
        usual(now, bus, text)
    });
    (rig, motor, play)
}

/// Runs until something is told of the axis, at most a second.
fn run_until(rig: &mut Rig, is_so: impl Fn(AxisState) -> bool) {
    for _ in 0..1_000 {
        if is_so(listed(rig, 0)) {
            return;
        }
        run_with_host(rig, 1_000);
    }
    panic!("{:?}", listed(rig, 0));
}

#[test]
fn a_trip_is_confirmed_when_the_motor_holds_again() {
    let (mut rig, motor, _) = held_motor();
    let epoch = arm(&mut rig);
    let turns = setpoint(&rig, epoch, 90_000, Setpoint::Velocity { velocity_rad_s: 0.0 });
    rig.ask(turns).unwrap();
    for silent_us in [310_000, 400_000, 1_300_000] {
        motor.is_unplugged.set(true);
        run_with_host(&mut rig, silent_us);
        motor.is_unplugged.set(false);
        // Until it is heard again.
        run_with_host(&mut rig, 50_000);
        run_until(&mut rig, |state| state == AxisState::Tripped { confirmed: true });
        assert!(motor.is_on.get(), "after {silent_us} µs");
    }
    clear(&mut rig).unwrap();
    assert_eq!(listed(&mut rig, 0), AxisState::Holding);
    assert!(motor.is_on.get());
}

#[test]
fn a_stop_that_is_not_given_up_is_confirmed_when_the_motor_holds_again() {
    for unplugged_after_us in [0, 1_000, 3_000, 8_000] {
        let (mut rig, motor, _) = held_motor();
        let patience = Value::Unsigned(100);
        bench::parameter(&mut rig, 0, AxisParameter::StopsBeforeUnreachable, patience);
        arm(&mut rig);
        bench::stop(&mut rig);
        run_with_host(&mut rig, unplugged_after_us);
        motor.is_unplugged.set(true);
        run_with_host(&mut rig, 400_000);
        motor.is_unplugged.set(false);
        run_until(&mut rig, |state| state == AxisState::Holding);
        assert!(motor.is_on.get(), "unplugged after {unplugged_after_us} µs");
    }
}

/// Keeps all from the bus for so long, µs.
type Cuts = fn(&mut Rig, u64);

/// Nothing of a stop that waits in the controller is missed, and what is read of one whose bus is
/// off is read from a motor that has let go.
#[test]
fn a_stop_under_which_the_cable_is_cut_is_confirmed_when_the_motor_holds_again() {
    let ends: [(&str, Cuts); 2] = [
        ("cut", |rig, us| {
            rig.cut();
            run_with_host(rig, us);
            rig.mend();
        }),
        ("off", |rig, us| {
            rig.shorted = true;
            rig.bus_off(0);
            run_with_host(rig, us);
            rig.shorted = false;
        }),
    ];
    for (what, end) in ends {
        for stopped_us in [500, 1_500, 3_000, 10_000, 40_000] {
            for silent_us in [350_000, 1_000_000] {
                let (mut rig, motor, play) = held_motor();
                arm(&mut rig);
                play.borrow_mut().turning = true;
                bench::stop(&mut rig);
                run_with_host(&mut rig, stopped_us);
                end(&mut rig, silent_us);
                play.borrow_mut().turning = false;
                run_until(&mut rig, |state| {
                    matches!(state, AxisState::Holding | AxisState::Tripped { confirmed: true })
                });
                assert!(
                    motor.is_on.get(),
                    "{what} {stopped_us} µs behind the stop, {silent_us} µs"
                );
            }
        }
    }
}

/// One that coasts.
fn coasting_motor() -> (Rig, Rc<Motor>) {
    let (mut rig, motor, _) = held_motor();
    let coast = Value::Unsigned(u32::from(StopAction::Coast.number()));
    bench::parameter(&mut rig, 0, AxisParameter::StopAction, coast);
    (rig, motor)
}

#[test]
fn what_a_silent_motor_is_told_goes_behind_a_command_that_it_may_ignore() {
    let (mut rig, motor) = coasting_motor();
    let acceleration = bench::native(&rig, 0, "4300000010270000");
    for silent_us in [0, 310_000, 5_000_000] {
        run_with_host(&mut rig, silent_us);
        let (since, before) = (rig.now_us, motor.obeyed.borrow().len());
        bench::answered(rig.ask(acceleration.clone()));
        assert!(
            motor.obeyed.borrow()[before..].ends_with(&["141#4300000010270000".into()]),
            "{silent_us} µs"
        );
        assert_eq!(rig.sent_since(0, since), [COAST, "141#4300000010270000"]);
    }
    run_with_host(&mut rig, 400_000);
    bench::provision(&mut rig, 300).unwrap();
    assert_eq!(motor.obeyed.borrow().last().unwrap(), "141#B30000002C010000");
    // A question goes at once.
    run_with_host(&mut rig, 400_000);
    let since = rig.now_us;
    let question = bench::native(&rig, 0, "9200000000000000");
    bench::answered(rig.ask(question));
    assert_eq!(rig.sent_since(0, since), ["141#9200000000000000"]);
}

#[test]
fn a_coasting_motor_that_was_silent_is_told_to_restart() {
    let (mut rig, motor) = coasting_motor();
    bench::parameter(&mut rig, 0, AxisParameter::StopRepeatUs, Value::Unsigned(1_000_000));
    bench::move_axis(&mut rig, bench::VELOCITY);
    run_with_host(&mut rig, 1_400_000);
    assert_eq!(listed(&mut rig, 0), AxisState::Tripped { confirmed: true });
    rig.send(&Request::ClearByRestart(requests::ClearByRestart { axis: 0 }));
    run_with_host(&mut rig, 50_000);
    assert_eq!(motor.obeyed.borrow().last().unwrap(), "141#7600000000000000");
}
