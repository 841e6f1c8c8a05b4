//! Another firmware for a simulated gateway, typed as a user would.

use std::fs;
use std::process::Stdio;
use std::time::Instant;

use firmware_image::{FirmwareVersion, Header, NO_KEY};
use mgw_sim::images::image;
use salty::{Keypair, Sha512};
use serde_json::{Value, json};

use crate::server::Server;
use crate::support::{LIMIT, Outcome, Process, Sim, file, json, mgw, mgw_cut_short};

fn put(name: &str, bytes: &[u8]) -> String {
    let path = file(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// An image of the simulated board: version 0.minor.0.
fn image_file(minor: u16, key: [u8; 32]) -> (String, Vec<u8>) {
    let bytes = image(&header(minor, "simulated", key), &[0x5A; 5_000]);
    (put(&format!("0.{minor}.bin"), &bytes), bytes)
}

fn header(minor: u16, board: &str, key: [u8; 32]) -> Header {
    Header::new(FirmwareVersion { major: 0, minor, patch: 0 }, board, key)
}

/// What `info` says of the image that runs.
fn runs(sim: &Sim) -> Value {
    json(sim.mgw(&["--json", "info"]).success().trim())["image"].take()
}

fn kept(version: &str, needs_signature: bool) -> Value {
    json!({
        "version": version, "room_bytes": 524_288, "needs_signature": needs_signature,
        "state": "kept", "left_ms": null,
    })
}

/// Lets the RMD motors go, which hold by what the gateway sends, after a start too.
fn let_go(sim: &Sim) {
    let are_idle = |sim: &Sim| {
        let states = json(sim.mgw(&["--json", "state"]).success().trim());
        [0, 3].iter().all(|axis| states["axes"][axis]["state"] == "idle")
    };
    let end = Instant::now() + LIMIT;
    while !are_idle(sim) {
        assert!(Instant::now() < end, "an axis does not become idle");
        for axis in ["0", "3"] {
            sim.mgw_once_in_command(&["clear", axis]);
            sim.mgw_once_in_command(&["output-off", axis]);
        }
    }
}

/// Sends a firmware when no motor holds any more.
fn update(sim: &Sim, arguments: &[&str]) -> Outcome {
    let_go(sim);
    sim.mgw_once_in_command(&[&["update"], arguments].concat())
}

#[test]
fn a_newer_firmware_is_sent_started_and_kept() {
    let sim = Sim::start();
    let (file, bytes) = image_file(2, NO_KEY);
    assert_eq!(runs(&sim), kept("0.1.0", false));
    let_go(&sim);
    let told = sim.mgw_once_in_command(&["--json", "update", &file]).json_lines();
    let events: Vec<&str> = told.iter().map(|line| line["event"].as_str().unwrap()).collect();
    let written = events.iter().filter(|event| **event == "written").count();
    assert_eq!(written, 10, "{events:?}");
    assert_eq!(events[10..], ["restarting", "confirmed"]);
    assert_eq!(
        told[9],
        json!({ "event": "written", "bytes": bytes.len(), "of_bytes": bytes.len() })
    );
    assert_eq!(told[11]["version"], "0.2.0");
    assert_eq!(runs(&sim), kept("0.2.0", false));
    // Its configuration has stayed, and it arms.
    let_go(&sim);
    sim.mgw_once_in_command(&["arm", "0", "--for", "0.1"]).success();

    let text = sim.mgw(&["update", &image_file(1, NO_KEY).0]).failure(1);
    assert!(text.contains("the image is version 0.1.0, older than 0.2.0, which runs"), "{text}");
    let text = update(&sim, &[&image_file(1, NO_KEY).0, "--allow-older"]).success();
    assert!(text.ends_with("confirmed version 0.1.0 runs, and is kept\n"), "{text}");
}

#[test]
fn what_no_gateway_would_take_is_refused_before_anything_is_sent() {
    let sim = Sim::start();
    let (file, bytes) = image_file(2, NO_KEY);
    let other = put("other", &image(&header(2, "nucleo-h743zi", NO_KEY), &[]));
    let long = put("long", &image(&header(2, "simulated", NO_KEY), &vec![0; 512 << 10]));
    let none = put("none", &bytes[1..]);
    let short = put("short.sig", &[0; 63]);
    // It holds from then on.
    sim.mgw_once_in_command(&["arm", "0", "--for", "0.1"]).success();
    for (arguments, code, expected) in [
        (
            &["update", &other][..],
            1,
            "the image is for a nucleo-h743zi, and the gateway is a simulated",
        ),
        (&["update", &long], 1, "bytes, and there is room for 524288"),
        (&["update", &none], 2, "is no image: it has no header of the gateway's firmware"),
        (&["update", &file, "--signature", &short], 2, "it has 63 bytes, and a signature has 64"),
        (&["update", "no-such-file"], 2, "no-such-file"),
        (&["update"], 2, "required"),
        (&["update", &file, "--confirm"], 2, "cannot be used with"),
        (&["update", "--confirm", "--check"], 2, "cannot be used with"),
        (&["update", "--confirm", "--allow-older"], 2, "cannot be used with"),
        (&["update", "--confirm", "--signature", &short], 2, "cannot be used with"),
        (&["update", &file, "--check"], 1, "axis 0 (holding) is not"),
        (&["update", "/dev/zero"], 2, "/dev/zero is longer than 256 MiB"),
    ] {
        let text = sim.mgw(arguments).failure(code);
        assert!(text.contains(expected), "{arguments:?}: {text}");
    }
    let_go(&sim);
    let text = sim.mgw(&["update", &file, "--check"]).success();
    assert_eq!(text, "the gateway would take it: 0.2.0 instead of 0.1.0\n");
    assert_eq!(runs(&sim), kept("0.1.0", false));
}

#[test]
fn a_gateway_with_a_key_takes_only_what_is_signed() {
    let sim = Sim::start();
    let pair = Keypair::from(&[7; 32]);
    let key = *pair.public.as_bytes();
    let (plain, _) = image_file(2, NO_KEY);
    // DER as openssl writes it.
    let der = [b"\x30\x2a\x30\x05\x06\x03\x2b\x65\x70\x03\x21\x00".as_slice(), &key].concat();
    let (der, raw) = (put("key.der", &der), put("key", &key));
    let keyed = file("keyed.bin");
    let said = mgw(&["image", &plain, "--output", &keyed, "--key", &der]).success();
    assert!(said.contains("takes only images signed with its key"), "{said}");
    let same = file("same.bin");
    mgw(&["image", &plain, "--output", &same, "--key", &raw]).success();
    assert_eq!(fs::read(&keyed).unwrap(), fs::read(&same).unwrap());
    let text_of = mgw(&["image", &plain, "--output", &same, "--key", &plain]).failure(2);
    assert!(text_of.contains("is no Ed25519 public key"), "{text_of}");
    let zeros = put("zeros.key", &[0; 32]);
    let text_of = mgw(&["image", &plain, "--output", &same, "--key", &zeros]).failure(2);
    assert!(text_of.contains("zeros stand for no key"), "{text_of}");
    let pem = put("key.pem", b"-----BEGIN PUBLIC KEY-----\n");
    let text_of = mgw(&["image", &plain, "--output", &same, "--key", &pem]).failure(2);
    assert!(text_of.contains("it is PEM, and DER is wanted"), "{text_of}");
    // Whoever puts a key into a board has its other half.
    let signed = |name: &str, bytes: &[u8]| {
        let mut hash = Sha512::new();
        hash.update(bytes);
        put(name, &pair.sign(&hash.finalize()).to_bytes())
    };
    let text = sim.mgw(&["update", &keyed]).failure(1);
    assert!(text.contains("must be signed with its other half"), "{text}");
    let other = signed("other.sig", b"another image");
    let text = sim.mgw(&["update", &keyed, "--signature", &other]).failure(1);
    assert!(text.contains("the signature is none of this image"), "{text}");
    let signature = signed("keyed.sig", &fs::read(&keyed).unwrap());
    let told = update(&sim, &[&plain, "--signature", &signature, "--check"]).success();
    assert!(told.starts_with("nobody looks at the signature"), "{told}");
    let_go(&sim);
    let unread = ["--port", &sim.port, "update", &plain, "--signature", &signature];
    assert_eq!(mgw_cut_short(&unread, Stdio::null(), 0).code, Some(0), "nobody reads that");
    assert_eq!(runs(&sim), kept("0.2.0", false));
    update(&sim, &[&keyed, "--signature", &signature]).success();
    assert_eq!(runs(&sim), kept("0.2.0", true));

    let (next, bytes) = image_file(3, key);
    let text = sim.mgw(&["update", &next]).failure(1);
    assert!(text.contains("takes only signed images: --signature FILE"), "{text}");
    let forged = put("forged.sig", &[9; 64]);
    let text = update(&sim, &[&next, "--signature", &forged]).failure(1);
    assert!(text.contains("this signature is none of that key"), "{text}");
    assert_eq!(runs(&sim), kept("0.2.0", true));
    let signature = signed("good.sig", &bytes);
    let told = update(&sim, &[&next, "--signature", &signature]).success();
    assert!(told.starts_with("the gateway alone knows its key"), "{told}");
    assert_eq!(runs(&sim), kept("0.3.0", true));
}

#[test]
fn an_update_that_is_killed_halfway_changes_nothing() {
    let sim = Sim::start();
    let bytes = image(&header(2, "simulated", NO_KEY), &vec![0xA7; 400_000]);
    let file = put("large.bin", &bytes);
    let_go(&sim);
    let mut killed = Process::start(&["--port", &sim.port, "update", &file]);
    killed.wait_for("a part", |line| line.starts_with("written").then_some(()));
    killed.kill();
    assert_eq!(runs(&sim), kept("0.1.0", false));
    update(&sim, &[&file]).success();
    assert_eq!(runs(&sim), kept("0.2.0", false));
    let text = sim.mgw(&["update", "--confirm"]).success();
    assert_eq!(text, "version 0.2.0 runs and is kept: nothing is on trial\n");
}

/// A command that only reads has axes carry something out for it, beside which nothing is written.
#[test]
fn an_update_goes_on_while_another_program_reads() {
    let sim = Sim::start();
    let file = put("long.bin", &image(&header(2, "simulated", NO_KEY), &vec![1; 100_000]));
    let_go(&sim);
    let update = Process::start(&["--port", &sim.port, "update", &file]);
    update.wait_for("a part", |line| line.starts_with("written").then_some(()));
    for _ in 0..3 {
        sim.mgw(&["state"]).success();
    }
    let is_confirmed = |line: &str| line.starts_with("confirmed").then_some(());
    update.wait_for("its end", is_confirmed);
    assert_eq!(runs(&sim), kept("0.2.0", false));
}

#[test]
fn nothing_is_sent_while_an_axis_is_armed() {
    let sim = Sim::patient();
    let (file, _) = image_file(2, NO_KEY);
    sim.mgw_beside(&["arm", "0", "--for", "2"], "0", &["armed"], || {
        let text = sim.mgw(&["update", &file]).failure(1);
        assert!(text.contains("axis 0 (armed) is not"), "{text}");
    });
    assert_eq!(runs(&sim), kept("0.1.0", false));
}

#[test]
fn an_update_passes_a_server_which_tells_of_it() {
    let sim = Sim::start();
    let (file, _) = image_file(2, NO_KEY);
    let_go(&sim);
    let server = Server::start(&sim.port, &[]);
    let text = mgw(&["--port", &server.port, "update", &file]).success();
    assert!(text.ends_with("confirmed version 0.2.0 runs, and is kept\n"), "{text}");
    let gone = |line: &str| line.starts_with("gateway lost: it has started anew").then_some(());
    server.process.wait_for("the start", gone);
    let back = |line: &str| (line == "gateway: simulated, 0.2.0").then_some(());
    server.process.wait_for("the new firmware", back);
    assert_eq!(runs(&sim), kept("0.2.0", false));
}
