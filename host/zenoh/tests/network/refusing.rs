//! What makes no sense is refused in words, and reaches no motor.

use host_protocol::{Call, requests as wire};
use mgw_zenoh::{Commander, ask};
use serde_json::{Value, json};
use zenoh::{Session, Wait};

use crate::support::{Gateway, endpoint, mgw_zenoh, peer, run, until};

/// What a query is answered with that carries these bytes.
fn answer(session: &Session, key: &str, bytes: &[u8]) -> Value {
    let asked = session.get(key).payload(bytes).wait().unwrap();
    let reply = asked.recv().unwrap_or_else(|_| panic!("{key} is answered"));
    let error = reply.result().expect_err("it is refused");
    serde_json::from_slice(&error.payload().to_bytes()).unwrap()
}

#[test]
fn what_makes_no_sense_reaches_no_motor() {
    let gateway = Gateway::start();
    let here = endpoint();
    let _running = gateway.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let before = gateway.commands().len();
    let name = |key: &str, bytes: &[u8]| {
        let answer = answer(&session, &format!("motor-gateway/left/{key}"), bytes);
        let error = &answer["error"];
        assert!(error["message"].as_str().unwrap().len() > 20, "{answer}");
        error["name"].as_str().unwrap().to_owned()
    };
    // Without command, nothing comes even near the gateway.
    for (key, bytes, wanted) in [
        ("command/arm", &b"{"[..], "usage"),
        ("command/arm", b"\xff\xfe\x00", "usage"),
        ("command/arm", b"[[[[[[[[", "usage"),
        ("command/arm", b"{\"axis\":0}", "usage"),
        ("command/arm", br#"{"lease":"0000000000000000","axis":0}"#, "lease_over"),
        ("command/take", b"{}", "usage"),
        ("command/take", br#"{"peer":"../x"}"#, "usage"),
        ("command/take", br#"{"peer":"ghost"}"#, "no_sign_of_life"),
        ("command/fly", b"", "unknown_key"),
        ("command", b"", "unknown_key"),
        ("command/arm/0", b"", "unknown_key"),
        ("state/axis/99", b"", "unknown_key"),
        ("samples/axis/0", b"", "unknown_key"),
        ("command/stop", b"now", "usage"),
    ] {
        assert_eq!(name(key, bytes), wanted, "{key} {}", String::from_utf8_lossy(bytes));
    }
    assert_eq!(name("command/arm", &[b'['; 100_000]), "usage");
    // What is published does nothing: who asks is answered.
    for word in ["stop", "estop", "arm"] {
        session.put(format!("motor-gateway/left/command/{word}"), "{}").wait().unwrap();
    }
    ask(&session, "motor-gateway/left/state/link", None).unwrap();
    assert_eq!(gateway.commands().len(), before, "{:?}", gateway.commands());

    // In command neither arming nor a setpoint is sent.
    let mut commander = Commander::take(&session, "left", "peer").unwrap();
    let lease = commander.lease().to_owned();
    let setpoint = |more: &str| {
        let text = format!(
            r#"{{"lease":"{lease}","axis":0,"epoch":1,"expires_at_us":{},{more}}}"#,
            commander.gateway_now_us() + 1_000_000
        );
        name("command/setpoint", text.as_bytes())
    };
    for more in [
        r#""setpoint":"velocity","velocity_rad_s":NaN"#,
        r#""setpoint":"velocity","velocity_rad_s":Infinity"#,
        r#""setpoint":"velocity","velocity_rad_s":1e39"#,
        r#""setpoint":"velocity","velocity_rad_s":1e400"#,
        r#""setpoint":"velocity","velocity_rad_s":null"#,
        r#""setpoint":"velocity""#,
        r#""setpoint":"fly","velocity_rad_s":1"#,
        r#""setpoint":"position","position_rad":1"#,
        r#""setpoint":"velocity","velocity_rad_s":1,"axis":300"#,
    ] {
        assert_eq!(setpoint(more), "usage", "{more}");
    }
    for expires in ["0", "18446744073709551615", "-1", "1e9", "\"soon\""] {
        let text = format!(
            r#"{{"lease":"{lease}","axis":0,"epoch":1,"expires_at_us":{expires},
                "setpoint":"velocity","velocity_rad_s":1}}"#
        );
        let refused = name("command/setpoint", text.as_bytes());
        // The gateway has run for less than 18 minutes: 0 is a time of its past.
        assert_eq!(refused, if expires == "0" { "stale" } else { "usage" }, "{expires}");
    }
    commander.keep_alive().unwrap();
    let refused = commander.arm(40).unwrap_err();
    assert_eq!(refused.name, "unknown_axis", "{refused}");
    assert!(refused.error["number"].is_u64(), "{refused:?}");
    for number in [wire::Arm::NUMBER, wire::Setpoint::NUMBER, wire::Stop::NUMBER] {
        assert_eq!(gateway.count(number), 0, "{number:#06x} was sent");
    }
    // A setpoint of an axis that is not armed is the gateway's to refuse.
    let setpoint = host_protocol::Setpoint::Velocity { velocity_rad_s: 1.0 };
    let ttl = std::time::Duration::from_secs(1);
    assert_eq!(commander.set(0, 1, setpoint, ttl).unwrap_err().name, "not_armed");
    let state = ask(&session, "motor-gateway/left/state/axis/0", None).unwrap();
    assert_eq!(state[0].1["state"], "idle");
}

#[test]
fn a_name_is_had_by_one() {
    let (first, second) = (Gateway::start(), Gateway::start());
    let (here, there) = (endpoint(), endpoint());
    let _first = first.join("left", &["--listen", &here]);
    let session = peer(&[&here]);
    let mut commander = Commander::take(&session, "left", "peer").unwrap();
    let arguments = ["left", "--serve", &second.server, "--listen", &there, "--connect", &here];
    let (code, out, error) = run(&mut mgw_zenoh(&arguments));
    assert_eq!((code, out.as_str()), (Some(1), ""), "{error}");
    assert!(error.contains("another gateway of this network is called left"), "{error}");
    // Who has it is not disturbed.
    commander.keep_alive().unwrap();
    commander.release().unwrap();

    for bad in ["a/b", "*", "2nd", "", "all"] {
        let (code, _, error) = run(&mut mgw_zenoh(&[bad, "--listen", &there]));
        assert_eq!(code, Some(2));
        assert!(error.contains("1 to 16 letters, digits, `-` and `_`"), "{bad}: {error}");
    }
    let (code, _, error) = run(&mut mgw_zenoh(&["left", "--serve", &second.server]));
    assert_eq!(code, Some(1));
    assert!(error.contains("--listen"), "{error}");
}

#[test]
fn two_networks_that_become_one_with_a_name_twice_move_nothing() {
    let (first, second) = (Gateway::start(), Gateway::start());
    let (here, there) = (endpoint(), endpoint());
    // The second is there before the first can be reached.
    let _second = second.join("left", &["--listen", &there, "--connect", &here]);
    let session = peer(&[&there]);
    let mut commander = Commander::take(&session, "left", "peer").unwrap();
    let first = first.join("left", &["--listen", &here]);
    until("the name is seen twice", || commander.keep_alive().is_err());
    let refused = Commander::take(&session, "left", "peer").err().unwrap();
    assert_eq!(refused.name, "name_twice", "{refused}");
    // A stop is taken all the same.
    ask(&session, "motor-gateway/left/command/stop", Some(&json!({ "axis": 0 }))).unwrap();
    drop(first);
    until("the other has gone", || Commander::take(&session, "left", "peer").is_ok());
}
