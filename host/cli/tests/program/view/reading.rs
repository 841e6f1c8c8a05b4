//! What readers are told: as a recording has it, and of a flood what they draw.

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Instant;

use serde_json::{Value, json};
use tungstenite::Message;

use super::{Page, View, motor_is_stopped};
use crate::flood::Flood;
use crate::support::{LIMIT, Sim, file, json, mgw};

#[test]
fn foxglove_reads_what_a_recording_has() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &["--allow-origin", "https://app.foxglove.dev"]);
    let query = format!("/?token={}", view.token);
    for (name, headers) in [
        ("foxglove.sdk.v1", vec![("Origin", "https://app.foxglove.dev")]),
        ("foxglove.websocket.v1", vec![]),
    ] {
        let headers = [headers, vec![("Sec-WebSocket-Protocol", name)]].concat();
        assert_eq!(view.open_as(&view.address, "/", &headers).err(), Some(401), "no token");
        let mut page = view.open_as(&view.address, &query, &headers).unwrap();
        let read = |page: &mut Page| loop {
            match page.0.read() {
                Ok(message) => return message,
                Err(tungstenite::Error::Io(_)) => {}
                Err(error) => panic!("{error}"),
            }
        };
        let text =
            |message: Message| -> Value { serde_json::from_str(&message.to_string()).unwrap() };
        assert_eq!(text(read(&mut page))["op"], "serverInfo");
        let mut advertised = text(read(&mut page));
        while advertised["channels"].as_array().is_none_or(Vec::is_empty) {
            advertised = text(read(&mut page));
        }
        let channels = advertised["channels"].as_array().unwrap();
        let topics: Vec<_> = channels.iter().map(|of| of["topic"].as_str().unwrap()).collect();
        let samples = ["/axis/0/sample", "/axis/1/sample", "/axis/2/sample", "/axis/3/sample"];
        assert_eq!(topics, [&samples[..], &["/event", "/cycle"]].concat());
        let schema: Value = serde_json::from_str(channels[0]["schema"].as_str().unwrap()).unwrap();
        assert_eq!(schema["properties"]["velocity_rad_s"]["type"], "object");
        page.say(json!({ "op": "setParameters", "parameters": [] }));
        let id = channels[0]["id"].as_u64().unwrap();
        let subscription = json!({ "id": 7, "channelId": id });
        page.say(json!({ "op": "subscribe", "subscriptions": [subscription] }));
        let status = text(read(&mut page));
        assert_eq!((&status["op"], &status["level"]), (&json!("status"), &json!(2)));
        let Message::Binary(data) = read(&mut page) else { panic!("no data") };
        assert_eq!(data[..5], [1, 7, 0, 0, 0], "message data of subscription 7");
        let sample: Value = serde_json::from_slice(&data[13..]).unwrap();
        assert_eq!(sample["axis"], 0, "{sample}");
        assert!(sample["time_us"].is_u64(), "{sample}");
    }
}

#[test]
fn a_flood_holds_up_no_stop_and_what_is_not_recorded_is_counted() {
    let mut sim = Sim::patient();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let cable = format!("tcp:{}", listener.local_addr().unwrap());
    let flood = Arc::new(Flood::default());
    let (served, gateway) = (flood.clone(), sim.port.trim_start_matches("tcp:").to_owned());
    thread::spawn(move || served.serve(&listener, &gateway, 8_000));
    let path = file("view.mcap");
    let mut view = View::start(&cable, &["--view-period", "1", "--record", &path, "--force"]);
    // One reads and draws nothing, and one does.
    let mut slow = view.page();
    let mut page = view.page();
    page.turn(0);
    flood.on.store(true, Ordering::Relaxed);
    page.wait_for("a flood", |message| {
        let of = message["axes"].as_array()?.iter().find(|of| of["axis"] == 0)?;
        of["samples"].as_u64().filter(|count| *count > 20)
    });
    slow.say(json!({ "ask": "stop" }));
    motor_is_stopped(&sim);
    // It is spared what it does not draw, and told how much that was.
    let now = page.wait_for("a picture", |message| message["tick"].as_u64());
    page.wait_for("40 more", |message| message["tick"].as_u64().filter(|tick| *tick > now + 40));
    let before = slow.wait_for("pictures", |message| message["tick"].as_u64());
    let left_out = slow.wait_for("what was left out", |message| {
        let after = message["tick"].as_u64()?;
        message["left_out"].as_u64().filter(|count| after > before && *count > 0)
    });
    assert!(left_out < 10_000, "{left_out}");
    flood.on.store(false, Ordering::Relaxed);
    let sent = flood.sent.load(Ordering::Relaxed);
    assert!(sent > 8_000, "{sent}");
    // What is answered by the gateway now comes behind all of that.
    page.say(json!({ "ask": "stop" }));
    page.wait_for("the end of the flood", |message| {
        (message["event"] == "stop" && message["phase"] == "report").then_some(())
    });
    drop((slow, page));
    // The gateway's own samples end, too, or the recording grows while it is read.
    sim.process.kill();
    let play = |topic| mgw(&["--json", "play", &path, "--topic", topic]).stdout;
    let lost = || {
        // Behind the messages it is told that the file has no end yet.
        let told = play("/recording").lines().map(json).rfind(|line| line["message"].is_object());
        let Some(told) = told else { return 0 };
        let count = |name| told["message"][name].as_u64().expect("a number");
        let unwritten = count("lost_unwritten");
        assert!(count("lost_on_the_way") <= unwritten, "no other number is missing: {told}");
        unwritten
    };
    // The thread that writes may be behind; what it has is in the file each second.
    let end = Instant::now() + LIMIT;
    loop {
        let recorded = play("/axis/").lines().count() as u64;
        // Only a machine that is busy with other things writes too slowly.
        let lost = if recorded < sent { lost() } else { 0 };
        if recorded + lost >= sent {
            break;
        }
        assert!(Instant::now() < end, "{recorded} of {sent} are recorded, and {lost} not");
    }
    assert_eq!(view.server.process.interrupt(), Some(0));
    lost();
}
