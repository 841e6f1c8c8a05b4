//! A connection that is lost is a host that is silent.

use std::thread;
use std::time::{Duration, Instant};

use mgw_zenoh::{Commander, ask};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::Value;

use crate::support::{
    Gateway, Running, SILENCE, endpoint, example, peer, subscribe, until, wait_for,
};

/// What is on its way when a signal comes.
const ON_ITS_WAY: Duration = Duration::from_millis(300);

/// Has an axis held by a process, sends that a signal, and returns the trip that follows. Checks
/// that from then on nothing is sent for it.
fn trip_after(signal: Signal) -> Value {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let events = subscribe(&session, "motor-gateway/left/events");
    let held = Running::start(example("hold").args([&here, "left", "0", "1", "60"]));
    held.line("is armed");
    wait_for(&events, "the axis active", |_, event| {
        event["event"] == "state_changed" && event["state"] == "active"
    });
    thread::sleep(Duration::from_millis(300));
    let process = Pid::from_raw(i32::try_from(held.child.id()).unwrap());
    kill(process, signal).unwrap();
    let at = Instant::now();
    let tripped = wait_for(&events, "a trip", |_, event| event["event"] == "tripped");
    assert_eq!(tripped["axis"], 0);
    thread::sleep(Duration::from_millis(500));
    let late: Vec<_> =
        gateway.commands().into_iter().filter(|asked| asked.at > at + ON_ITS_WAY).collect();
    assert_eq!(late, [], "nothing is sent for one that has gone");

    // Another may take command, and one that wakes up does not have it back.
    let mut next = None;
    until("command is free", || {
        next = Commander::take(&session, "left", "next").ok();
        next.is_some()
    });
    if signal == Signal::SIGSTOP {
        kill(process, Signal::SIGCONT).unwrap();
        let mut held = held;
        let ended = held.child.wait().unwrap();
        assert_eq!(ended.code(), Some(1), "it is refused, and says so");
        let state = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap();
        assert_eq!(state[0].1["state"], "tripped");
    }
    tripped
}

#[test]
fn an_axis_of_a_commander_that_is_killed_trips() {
    let tripped = trip_after(Signal::SIGKILL);
    let reason = tripped["trip"]["reason"].as_str().unwrap();
    assert!(["host_silent", "setpoint_expired"].contains(&reason), "{tripped}");
}

#[test]
fn an_axis_of_a_commander_that_is_halted_trips() {
    let tripped = trip_after(Signal::SIGSTOP);
    let reason = tripped["trip"]["reason"].as_str().unwrap();
    assert!(["host_silent", "setpoint_expired"].contains(&reason), "{tripped}");
}

#[test]
fn mgw_zenoh_killed_or_halted_trips_too() {
    for signal in [Signal::SIGKILL, Signal::SIGSTOP] {
        let gateway = Gateway::start();
        let here = endpoint();
        let running = gateway.join("left", &["--listen", &here]);
        let held = Running::start(example("hold").args([&here, "left", "0", "1", "60"]));
        held.line("is armed");
        thread::sleep(Duration::from_millis(300));
        kill(Pid::from_raw(i32::try_from(running.child.id()).unwrap()), signal).unwrap();
        until("the axis trips", || {
            gateway.mgw(&["state", "0"])[0]["axes"][0]["state"] == "tripped"
        });
    }
}

#[test]
fn a_commander_that_only_watches_its_lease_run_out_is_told() {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let mut commander = Commander::take(&session, "left", "peer").unwrap();
    // However often it says that it is there, that keeps nothing waiting.
    (0..200).for_each(|_| commander.keep_alive().unwrap());
    let armed = commander.arm(0).unwrap();
    assert_eq!(commander.link_silence(), SILENCE);
    // Keep-alives alone keep an axis armed.
    for _ in 0..20 {
        thread::sleep(Duration::from_millis(100));
        commander.keep_alive().unwrap();
    }
    let state = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap();
    assert_eq!(state[0].1["state"], "armed");
    thread::sleep(SILENCE + Duration::from_millis(300));
    let setpoint = host_protocol::Setpoint::Velocity { velocity_rad_s: 1.0 };
    let refused = commander.set(0, armed.epoch, setpoint, armed.ttl / 2).unwrap_err();
    assert_eq!(refused.name, "lease_over");
    until("the axis is disarmed", || {
        let state = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap();
        state[0].1["state"] != "armed"
    });
}

#[test]
fn a_gateway_that_is_gone_is_told() {
    let mut gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let links = subscribe(&session, "motor-gateway/left/state/link");
    let mut commander = Commander::take(&session, "left", "peer").unwrap();
    commander.arm(0).unwrap();
    gateway.end();
    let link = wait_for(&links, "a lost link", |_, link| link["connected"] == false);
    assert!(link["message"].as_str().unwrap().len() > 10, "{link}");
    let refused = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap_err();
    assert_eq!(refused.name, "gateway_away");
    until("command is over", || commander.arm(0).is_err());
}
