//! Who commands, and who stops.

use std::time::Duration;

use host_protocol::{Call, ClearTarget, Setpoint, requests as wire};
use mgw_zenoh::{Commander, ask};
use serde_json::json;

use crate::support::{Gateway, endpoint, peer, subscribe, until, wait_for};

const VELOCITY: Setpoint = Setpoint::Velocity { velocity_rad_s: 1.0 };
const TTL: Duration = Duration::from_secs(2);

#[test]
fn one_peer_commands_and_anybody_stops() {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let (mine, other) = (peer(&[&here]), peer(&[&here]));
    let events = subscribe(&other, "motor-gateway/left/events");

    let mut commander = Commander::take(&mine, "left", "first").unwrap();
    let armed = commander.arm(0).unwrap();
    assert_eq!(armed.ttl, TTL);
    commander.set(0, armed.epoch, VELOCITY, TTL / 2).unwrap();
    wait_for(&events, "the axis active", |_, event| {
        event["event"] == "state_changed" && event["state"] == "active"
    });

    // Another does not command, and is told who does.
    let refused = Commander::take(&other, "left", "second").err().unwrap();
    assert_eq!(refused.name, "not_in_command");
    assert!(refused.message.contains("peer first"), "{refused}");
    let made_up = json!({ "lease": "0123456789abcdef", "axis": 0 });
    let refused = ask(&other, "motor-gateway/left/command/arm", Some(&made_up)).unwrap_err();
    assert_eq!(refused.name, "lease_over");
    commander.keep_alive().unwrap();

    // It stops all the same; what the other says afterwards moves nothing.
    ask(&other, "motor-gateway/left/command/stop", Some(&json!({ "axis": 0 }))).unwrap();
    wait_for(&events, "a confirmed stop", |_, event| event["event"] == "stop_confirmed");
    let refused = commander.set(0, armed.epoch, VELOCITY, TTL / 2).unwrap_err();
    assert!(["stale_epoch", "not_armed"].contains(&refused.name.as_str()), "{refused}");

    // An e-stop likewise; who commands clears it.
    ask(&other, "motor-gateway/left/command/estop", None).unwrap();
    wait_for(&events, "the e-stop", |_, event| event["event"] == "e_stop_latched");
    assert!(commander.arm(0).is_err());
    commander.clear(ClearTarget::Gateway).unwrap();
    commander.release().unwrap();
    Commander::take(&other, "left", "second").unwrap().release().unwrap();
}

#[test]
fn one_stop_is_for_all_gateways() {
    let (left, right) = (Gateway::start(), Gateway::start());
    let (here, there) = (endpoint(), endpoint());
    let _left = left.join("left", &["--listen", &here]);
    let _right = right.join("right", &["--listen", &there]);
    let session = peer(&[&here, &there]);
    let stopped = ask(&session, "motor-gateway/*/command/stop", None).unwrap();
    let mut keys: Vec<&str> = stopped.iter().map(|(key, _)| key.as_str()).collect();
    keys.sort_unstable();
    assert_eq!(keys, ["motor-gateway/left/command/stop", "motor-gateway/right/command/stop"]);
    for gateway in [&left, &right] {
        // A busy machine may make it necessary to repeat it.
        assert!(gateway.count(wire::Stop::NUMBER) >= 1);
    }
    // Nothing else is.
    let refused = ask(&session, "motor-gateway/*/command/arm", Some(&json!({ "axis": 0 })));
    assert_eq!(refused.unwrap_err().name, "many_gateways");
}

#[test]
fn a_program_of_the_server_is_not_pushed_aside() {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let refused = std::thread::scope(|scope| {
        let moving = scope.spawn(|| gateway.mgw(&["set", "0", "velocity", "1", "--for", "3"]));
        until("it has armed the axis", || gateway.count(wire::Arm::NUMBER) > 0);
        let refused = Commander::take(&session, "left", "peer").err();
        moving.join().unwrap();
        refused
    });
    assert_eq!(refused.unwrap().name, "not_in_command");
    Commander::take(&session, "left", "peer").unwrap().release().unwrap();
}
