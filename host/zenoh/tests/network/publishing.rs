//! What everybody sees.

use std::collections::BTreeSet;
use std::time::Duration;

use mgw_zenoh::ask;
use serde_json::Value;

use crate::support::{Gateway, endpoint, peer, subscribe, until, wait_for};

/// Without what is different each time, or for each program: ages, and what was dropped on the way
/// to it.
fn without_ages(value: &Value) -> Value {
    match value {
        Value::Object(fields) => fields
            .iter()
            .filter(|(name, _)| !name.ends_with("age_us") && *name != "dropped")
            .map(|(name, value)| (name.clone(), without_ages(value)))
            .collect(),
        Value::Array(items) => items.iter().map(without_ages).collect(),
        value => value.clone(),
    }
}

#[test]
fn two_gateways_are_one_key_space() {
    let (left, right) = (Gateway::start(), Gateway::start());
    let (here, there) = (endpoint(), endpoint());
    let _left = left.join("left", &["--listen", &here]);
    let _right = right.join("right", &["--listen", &there, "--connect", &here]);
    // A peer that knows one of them hears of the other.
    let session = peer(&[&here]);
    let samples = subscribe(&session, "motor-gateway/*/samples/axis/*");
    let mut seen = BTreeSet::new();
    until("samples of four axes of both", || {
        seen.extend(samples.try_iter().map(|(key, value)| {
            assert_eq!(value["event"], "sample");
            assert_eq!(key.rsplit('/').next().unwrap(), value["axis"].to_string());
            key
        }));
        seen.len() == 8
    });
    let states = ask(&session, "motor-gateway/*/state/axis/0", None).unwrap();
    let keys: BTreeSet<&str> = states.iter().map(|(key, _)| key.as_str()).collect();
    let wanted = ["motor-gateway/left/state/axis/0", "motor-gateway/right/state/axis/0"];
    assert_eq!(keys, BTreeSet::from(wanted));
    let all = ask(&session, "motor-gateway/**", None).unwrap();
    assert!(all.len() >= 2 * (4 + 2), "gateway, link, buses and axes of both: {}", all.len());
}

#[test]
fn what_is_published_is_what_mgw_prints() {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let samples = subscribe(&session, "motor-gateway/left/samples/axis/0");
    let events = subscribe(&session, "motor-gateway/left/events");

    // States, when asked for and as they are published.
    let printed = &gateway.mgw(&["state", "0"])[0]["axes"][0];
    let asked = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap();
    assert_eq!(without_ages(&asked[0].1), without_ages(printed));
    let states = subscribe(&session, "motor-gateway/left/state/**");
    let published = wait_for(&states, "state", |key, _| key.ends_with("/state/axis/0"));
    assert_eq!(without_ages(&published), without_ages(printed));
    let printed = &gateway.mgw(&["bus", "0"])[0]["buses"][0];
    let published = wait_for(&states, "bus", |key, _| key.ends_with("/state/bus/0"));
    let names = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&published), names(printed));

    // Samples and events, both taken while an axis is armed and stopped.
    let watched = std::thread::scope(|scope| {
        let watched =
            scope.spawn(|| gateway.mgw(&["watch", "0", "--period", "20", "--count", "100"]));
        std::thread::sleep(Duration::from_millis(500));
        gateway.mgw(&["set", "0", "velocity", "1", "--for", "0.5"]);
        watched.join().unwrap()
    });
    let of = |name: &'static str| {
        watched.iter().filter(move |line| (line["event"] == "sample") == (name == "sample"))
    };
    let told: Vec<Value> = events.try_iter().map(|(_, value)| without_ages(&value)).collect();
    let of_gateway: Vec<&Value> = of("event").filter(|line| line["time_us"].is_u64()).collect();
    assert!(of_gateway.iter().any(|line| line["event"] == "state_changed"), "{watched:?}");
    for line in of_gateway {
        assert!(told.contains(&without_ages(line)), "{line} is not among {told:?}");
    }
    // Each program gets samples of its own: all the same fields, and no other value for one time.
    let published: Vec<Value> = samples.try_iter().map(|(_, value)| value).collect();
    let mut same = 0;
    for line in of("sample") {
        for value in &published {
            assert_eq!(names(value), names(line));
            if value["time_us"] == line["time_us"] {
                assert_eq!(without_ages(value), without_ages(line));
                same += 1;
            }
        }
    }
    println!("{same} samples of the same time");
}
