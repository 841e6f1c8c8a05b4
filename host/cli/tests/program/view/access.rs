//! Who may open the page and who may not, as a browser and whoever attacks one would ask.

use std::net::TcpStream;

use serde_json::json;

use super::View;
use crate::support::{Sim, mgw};

#[test]
fn the_page_is_served_to_its_own_name_only() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &[]);
    let (status, page) = view.get("/");
    assert_eq!(status, 200);
    for header in [
        "Content-Security-Policy: default-src 'none'; script-src 'self'",
        "frame-ancestors 'none'",
        "X-Frame-Options: DENY",
        "X-Content-Type-Options: nosniff",
        "Referrer-Policy: no-referrer",
    ] {
        assert!(page.contains(header), "{header}: {page}");
    }
    assert!(!page.contains("Access-Control"), "no other page reads it");
    assert!(!page.contains(&view.token), "it is no way to the token");
    let port = view.address.rsplit(':').next().unwrap();
    for host in [
        "evil.example",
        &format!("evil.example:{port}"),
        "127.0.0.1",
        "localhost:1",
        &format!("127.0.0.1.nip.io:{port}"),
        "",
    ] {
        let (status, text) = view.ask(&format!("GET / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        assert_eq!(status, 421, "{host}: {text}");
        assert!(text.contains(&view.address), "it says which name is ours: {text}");
    }
    assert_eq!(view.ask("GET / HTTP/1.1\r\n\r\n").0, 421);
    let (status, _) = view.ask(&format!("GET / HTTP/1.1\r\nHost: localhost:{port}\r\n\r\n"));
    assert_eq!(status, 200);
}

#[test]
fn there_are_no_other_files_and_no_endless_requests() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &[]);
    for path in [
        "/../Cargo.toml",
        "/..%2f..%2fetc/passwd",
        "//etc/passwd",
        "/view.css/../../x",
        "/%2e%2e/x",
        "/view.js%00",
        "/index.html",
    ] {
        let (status, text) = view.get(path);
        assert_eq!(status, 404, "{path}: {text}");
    }
    let host = &view.address;
    let long = format!("GET / HTTP/1.1\r\nHost: {host}\r\nX: {}\r\n\r\n", "x".repeat(10_000));
    assert_eq!(view.ask(&long).0, 431);
    let many = format!("GET / HTTP/1.1\r\nHost: {host}\r\n{}\r\n", "a: b\r\n".repeat(100));
    assert_eq!(view.ask(&many).0, 431);
    for bad in [
        "hello\r\n\r\n".to_owned(),
        format!("GET / HTTP/1.1\r\nHost: {host}\r\nHost: {host}\r\n\r\n"),
        format!("POST /stop HTTP/1.1\r\nHost: {host}\r\nContent-Length: 3\r\n\r\nabc"),
    ] {
        assert_eq!(view.ask(&bad).0, 400, "{bad}");
    }
    for method in ["PUT", "DELETE", "OPTIONS", "HEAD"] {
        let (status, _) = view.ask(&format!("{method} / HTTP/1.1\r\nHost: {host}\r\n\r\n"));
        assert_eq!(status, 405, "{method}");
    }
    assert_eq!(view.get("/live").0, 401, "no token");
}

#[test]
fn no_page_of_another_origin_and_nobody_without_the_token_gets_in() {
    let sim = Sim::start();
    let reader = "https://app.foxglove.dev";
    let view = View::start(&sim.port, &["--allow-origin", reader]);
    let own = view.own();
    for foreign in [
        "http://evil.example",
        "null",
        "http://127.0.0.1",
        "http://localhost:7480",
        "file://",
        "https://app.foxglove.dev.evil.example",
    ] {
        assert_eq!(view.open_from(foreign).err(), Some(403), "{foreign}");
    }
    // A name that points here, as DNS rebinding makes one.
    let port = view.address.rsplit(':').next().unwrap();
    let evil = format!("evil.example:{port}");
    let origin = format!("http://{evil}");
    let headers = [("Origin", &*origin), ("Sec-WebSocket-Protocol", &*view.protocols())];
    assert_eq!(view.open_as(&evil, "/live", &headers).err(), Some(421));
    for wrong in ["mgw.view.v1", "mgw.view.v1, token.", "mgw.view.v1, token.00ff", "token.zz"] {
        for origin in [own.as_str(), reader] {
            let headers = [("Origin", origin), ("Sec-WebSocket-Protocol", wrong)];
            assert_eq!(view.open(&headers).err(), Some(401), "{wrong}");
        }
    }
    // Another subprotocol, or none.
    let query = format!("/live?token={}", view.token);
    let refused = view.open_as(&view.address, &query, &[("Origin", &own)]).err();
    assert_eq!(refused, Some(426));
    view.page().event("welcome");
}

#[test]
fn an_allowed_origin_reads_and_does_not_command() {
    let sim = Sim::patient();
    let view = View::start(&sim.port, &["--allow-origin", "https://app.foxglove.dev"]);
    let mut page = view.open_from("https://app.foxglove.dev").unwrap();
    assert_eq!(page.event("welcome")["grant"], "read");
    let axes = page.event("axes");
    assert_eq!(axes["axes"].as_array().map(Vec::len), Some(4), "{axes}");
    for ask in [
        json!({ "ask": "stop" }),
        json!({ "ask": "take" }),
        json!({ "ask": "arm", "axis": 0 }),
        json!({ "ask": "jog", "axis": 0, "mode": "velocity", "value": 1.0 }),
    ] {
        page.say(ask.clone());
        let text = page.refusal();
        assert!(text.contains("may read, not command"), "{ask}: {text}");
    }
    // Nor by a POST.
    let (own, digits) = (view.own(), view.digits());
    let post = |origin: &str, token: &str| {
        let host = &view.address;
        let origin =
            if origin.is_empty() { String::new() } else { format!("Origin: {origin}\r\n") };
        let request = format!(
            "POST /stop HTTP/1.1\r\nHost: {host}\r\n{origin}Authorization: Bearer {token}\r\n\
             Content-Length: 0\r\n\r\n"
        );
        view.ask(&request).0
    };
    assert_eq!(post("https://app.foxglove.dev", &digits), 403);
    assert_eq!(post("http://evil.example", &digits), 403);
    assert_eq!(post("", &digits), 403, "a browser says the origin of a POST");
    assert_eq!(post(&own, "00"), 401);
    assert_eq!(post(&own, &digits), 200);
}

#[test]
fn beyond_this_computer_the_page_needs_a_token_that_was_given() {
    let line = ["--port", "tcp:127.0.0.1:9", "serve", "--listen", "127.0.0.1:0", "--view"];
    let text = mgw(&[&line[..], &["0.0.0.0:0"]].concat()).failure(2);
    assert!(text.contains("--token"), "{text}");
    let text = mgw(&[&line[..], &["0.0.0.0:0", "--token", "fifteen-bytes.."]].concat()).failure(2);
    assert!(text.contains("at least 16 bytes"), "{text}");
    let text = mgw(&[&line[..], &["127.0.0.1:0", "--allow-origin", "*"]].concat()).failure(2);
    assert!(text.contains("SCHEME://HOST"), "{text}");
    let alone = &line[..line.len() - 1];
    let text = mgw(&[alone, &["--allow-origin", "https://a.example"]].concat()).failure(2);
    assert!(text.contains("--view"), "{text}");
}

#[test]
fn neither_idle_connections_nor_readers_shut_the_own_page_out() {
    let sim = Sim::start();
    let view = View::start(&sim.port, &["--allow-origin", "https://reader.example"]);
    let idle: Vec<_> = (0..200).map(|_| TcpStream::connect(&view.address).unwrap()).collect();
    let readers: Vec<_> = (0..40).map(|_| view.open_from("https://reader.example")).collect();
    assert_eq!(readers.iter().filter(|reader| reader.is_ok()).count(), 16);
    assert!(readers.iter().all(|reader| !matches!(reader, Err(status) if *status != 503)));
    let mut page = view.page();
    page.wait_for("the axes", |message| (message["event"] == "axes").then_some(()));
    let (status, answer) = view.ask(&format!(
        "POST /stop HTTP/1.1\r\nHost: {0}\r\nOrigin: http://{0}\r\nAuthorization: Bearer {1}\r\n\r\n",
        view.address,
        view.digits()
    ));
    assert_eq!(status, 200, "{answer}");
    drop((idle, readers));
}
