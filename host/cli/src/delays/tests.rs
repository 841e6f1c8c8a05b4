use std::collections::BTreeSet;

use host_protocol::{CanFrame, RawFrame, ReceivedFrame};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::recording::{Reading, day};
use super::table::COLUMNS;
use super::*;
use crate::faults::Protocols;
use crate::record::{Place, Recording, What};

/// 2026-11-24T02:46:40Z.
const LOG_NS: u64 = 1_795_488_400_000_000_000;

/// A frame as `mgw record --frames` has it.
fn received(bus: u8, frame: &str, time_us: u64) -> Value {
    let kind = if frame.contains('#') { "can" } else { "serial" };
    json!({
        "event": "frame", "bus": bus, "kind": kind, "frame": frame, "direction": "received",
        "time_us": time_us,
    })
}

fn told() -> Told {
    Told {
        bitrates: vec![(0, 1_000_000), (1, 210_526), (2, 115_200)],
        place: Some("lab-a".to_owned()),
        gateway: Some("0.1.0".to_owned()),
        ..Told::default()
    }
}

/// The table of these messages.
fn table_of(messages: &[Value], told: &Told) -> Result<String, String> {
    let mut reading = Reading::default();
    for message in messages {
        reading.take(message, LOG_NS, told)?;
    }
    reading.table(told).map(|table| table.to_string())
}

/// A request and its reply, which begins `delay_us` after the request's end and takes `wire_us`.
fn asked(bus: u8, [request, reply]: [&str; 2], at: u64, wire_us: u64, delay: u64) -> [Value; 2] {
    [received(bus, request, at), received(bus, reply, at + delay + wire_us)]
}

const VERSION: [&str; 2] = ["141#B200000000000000", "241#B20000002E893401"];
const MODEL: [&str; 2] = ["141#B500000000000000", "241#B558385332563130"];
const STATUS: [&str; 2] = ["141#9C00000000000000", "241#9C32640000000000"];
const SPEED: [&str; 2] = ["30B#51560000", "28B#5156000000000000"];
const D5_SPEED: [&str; 2] = ["00B#D50B050226000038", "00B#5D0B050226000038"];
const LINE_STATUS: [&str; 2] = ["3E01089C00000000000000F230", "3E01089C190000000000007AF1"];

#[test]
fn the_table_of_a_recording() {
    // At 1 Mbit/s a bit is 1 µs: these replies have 115, 111 and 118 bits. At 210,526 bit/s 115
    // bits are 546 µs, and 13 bytes at 115,200 bit/s 1128 µs.
    let mut messages = Vec::new();
    messages.extend(asked(0, VERSION, 1_000_000, 115, 300));
    messages.extend(asked(0, MODEL, 1_010_000, 111, 310));
    for (at, delay) in [(1_020_000, 250), (1_030_000, 249), (1_040_000, 1_000)] {
        messages.extend(asked(0, STATUS, at, 118, delay));
    }
    messages.extend(asked(0, SPEED, 1_050_000, 118, 41));
    messages.extend(asked(1, D5_SPEED, 1_060_000, 546, 700));
    messages.extend(asked(2, LINE_STATUS, 1_070_000, 1_128, 512));
    assert_eq!(
        table_of(&messages, &told()).unwrap(),
        "reply-delays 1\n\
         # protocol model firmware bus bitrate command where count min p50 p99 max when gateway \
         buckets\n\
         d5 unknown unknown can 210526 read lab-a 1 700 700 700 700 2026-11-24 0.1.0 688:1\n\
         rmd X8S2V10 20220206 can 1000000 read_model lab-a 1 310 310 310 310 2026-11-24 0.1.0 \
         304:1\n\
         rmd X8S2V10 20220206 can 1000000 read_status_2 lab-a 3 249 251 1000 1000 2026-11-24 0.1.0 \
         248:2,992:1\n\
         rmd X8S2V10 20220206 can 1000000 read_version_date lab-a 1 300 300 300 300 2026-11-24 \
         0.1.0 296:1\n\
         rmd unknown unknown rs485 115200 read_status_2 lab-a 1 512 512 512 512 2026-11-24 0.1.0 \
         512:1\n\
         thruster unknown unknown can 1000000 read_speed lab-a 1 41 41 41 41 2026-11-24 0.1.0 41:1\n"
    );
}

#[test]
fn a_file_of_a_recording_is_read_as_it_was_written() {
    let path = std::env::temp_dir().join(format!("mgw-delays-{}.mcap", std::process::id()));
    let place = Place { path: path.clone(), longest: 1 << 20, force: true };
    let recording = Recording::start(place, Protocols::default()).unwrap();
    let frame = |id, data: &[u8], time_us| What::Frame {
        bus: 0,
        frame: ReceivedFrame {
            time_us,
            frame: RawFrame::Can(CanFrame::standard(id, data).unwrap()),
        },
    };
    recording.tap().put(frame(0x141, &[0x9C, 0, 0, 0, 0, 0, 0, 0], 1_000_000));
    recording.tap().put(frame(0x241, &[0x9C, 0x32, 0x64, 0, 0, 0, 0, 0], 1_000_368));
    recording.finish().unwrap();
    let table = of_file(&path, &told(), Output::none()).unwrap();
    std::fs::remove_file(&path).unwrap();
    let [(key, entry)] = table.entries().collect::<Vec<_>>()[..] else { panic!("{table}") };
    assert_eq!((key.command.as_str(), key.place.as_str()), ("read_status_2", "lab-a"));
    assert_eq!(entry.delays, Histogram::of(250));
}

#[test]
fn what_is_no_reply_with_a_time_of_the_gateway_counts_nothing() {
    let [request, reply] = asked(0, STATUS, 1_000_000, 118, 250);
    let empty = Table::default().to_string();
    let of = |messages: &[Value]| table_of(messages, &told()).unwrap();
    assert_eq!(of(std::slice::from_ref(&reply)), empty, "nobody asked");
    let mut sent = request.clone();
    sent["direction"] = json!("sent");
    assert_eq!(of(&[sent, reply.clone()]), empty, "its time is that of the host");
    assert_eq!(of(&[request.clone(), request.clone(), reply.clone()]), empty, "which of both?");
    assert_eq!(of(&[request.clone(), received(0, STATUS[1], 1_100_369)]), empty, "too late");
    assert_eq!(of(&[request.clone(), received(0, "242#9C32640000000000", 1_000_368)]), empty);
    assert_eq!(of(&[request.clone(), received(1, STATUS[1], 1_000_368)]), empty);
    // On a line a request that is sent again is no reply.
    let line = |at| received(2, LINE_STATUS[0], at);
    assert_eq!(of(&[line(1_000_000), line(1_002_000)]), empty);
    assert!(of(&[request, reply]).contains("read_status_2"));
}

#[test]
fn a_simulation_is_labelled_and_cannot_be_passed_off_as_something_else() {
    let hello = json!({
        "event": "reply", "request": "hello",
        "body": { "board": "simulated", "firmware": "0.1.0 (x)" },
    });
    let [request, reply] = asked(0, STATUS, 1_000_000, 118, 250);
    let messages = [hello, request, reply];
    let nobody = Told { place: None, gateway: None, ..told() };
    let table = table_of(&messages, &nobody).unwrap();
    assert!(table.contains(" read_status_2 simulator 1 250 "), "{table}");
    assert!(table.contains(" 2026-11-24 0.1.0__x_ "), "{table}");
    let text = table_of(&messages, &told()).unwrap_err();
    assert_eq!(
        text,
        "the gateway of this recording is simulated, so --where can be simulator only"
    );
}

#[test]
fn what_a_person_knows_fills_in_what_a_motor_does_not_tell() {
    let known =
        Told { model: Some("RMD-X4".to_owned()), firmware: Some("v9".to_owned()), ..told() };
    let mut messages = asked(0, STATUS, 1_000_000, 118, 250).to_vec();
    messages.extend(asked(0, MODEL, 1_010_000, 111, 310));
    let table = table_of(&messages, &known).unwrap();
    assert!(table.contains("rmd X8S2V10 v9 can"), "its own word goes before: {table}");
    let nothing = Told::default();
    let text = table_of(&messages, &nothing).unwrap_err();
    assert_eq!(text, "the bitrate of bus 0 is not in a recording; add --bitrate 0=BIT_S");
}

#[test]
fn a_model_in_three_parts_is_one_word_once_all_are_heard() {
    let parts = [
        ["141#B501010000000000", "241#B50101524D442D00"],
        ["141#B501020000000000", "241#B5010258342D5033"],
        ["141#B501030000000000", "241#B50103362D333600"],
    ];
    let of = |parts: &[[&str; 2]]| {
        let times = (1_000_000..).step_by(10_000);
        let pairs = parts.iter().zip(times).map(|(pair, at)| asked(0, *pair, at, 118, 250));
        table_of(&pairs.flatten().collect::<Vec<_>>(), &told()).unwrap()
    };
    assert!(of(&parts).contains("\nrmd RMD-X4-P36-36 unknown can "), "{}", of(&parts));
    assert!(of(&parts[..2]).contains("\nrmd unknown unknown can "), "{}", of(&parts[..2]));
}

#[test]
fn days_are_those_of_the_calendar() {
    let at = |seconds: u64| day(seconds * 1_000_000_000);
    assert_eq!(at(0), "1970-01-01");
    assert_eq!(at(951_782_399), "2000-02-28");
    assert_eq!(at(951_782_400), "2000-02-29");
    assert_eq!(at(1_709_251_200), "2024-03-01");
    assert_eq!(at(1_798_761_599), "2026-12-31");
    assert_eq!(at(4_107_542_400), "2100-03-01");
}

const LINE: &str = "rmd X8 v1 can 1000000 read_status_2 lab-a 3 249 251 1000 1000 2026-11-24 0.1.0 \
                    248:2,992:1";

#[test]
fn a_malformed_line_is_refused_with_what_is_allowed() {
    let with = |from: &str, to: &str| {
        let line = LINE.replacen(from, to, 1);
        assert_ne!(line, LINE, "{from}");
        Table::parse(&format!("{}\n# a comment\n\n{line}\n", table::HEADER)).unwrap_err()
    };
    for (from, to, wanted) in [
        ("rmd", "RMD", "protocol `RMD` is none of rmd, thruster, d5"),
        ("X8", "X/8", "model `X/8` may have letters, digits and . _ - + only, 1 to 64 of them"),
        ("can", "lin", "bus `lin` is none of can, rs485"),
        ("1000000", "1e6", "bitrate `1e6` is no whole number, or too large"),
        ("1000000", "01000000", "bitrate `01000000` is no whole number, or too large"),
        ("1000000", "5000000000", "bitrate `5000000000` is no whole number, or too large"),
        (" 3 ", " 4 ", "count is 4, and the buckets say 3"),
        (" 251 ", " 250 ", "p50 is 250, and the buckets say 251"),
        ("249", "252", "min 252 and max 1000 are not in the first bucket, 248 to 251"),
        ("2026-11-24", "24.11.2026", "when `24.11.2026` is wrong; it takes days, as 2026-11-24"),
        ("0.1.0", "0.2.0,0.1.0", "gateway `0.2.0,0.1.0` is not in order, each once"),
        ("248:2", "250:2", "250 begins no bucket; it is in that of 248"),
        ("248:2", "248:0", "a bucket counts 0"),
        ("248:2,992:1", "992:1,248:2", "bucket 248 is not in order"),
        ("248:2", "248", "bucket `248` is not BUCKET:COUNT"),
        (" lab-a", "", "14 columns; a line has 15, one space between: protocol model firmware"),
        ("X8 ", "X8  ", "16 columns"),
    ] {
        let text = with(from, to);
        assert!(text.starts_with("line 4: ") && text.contains(wanted), "{from} {to}: {text}");
    }
    let text = Table::parse("delays\n").unwrap_err();
    assert_eq!(text, "line 1: `delays` is not `reply-delays 1`, which comes first");
    let text = Table::parse("# nothing\n").unwrap_err();
    assert_eq!(text, "line 1: it is empty; the first line is `reply-delays 1`");
    let twice = format!("{}\n{LINE}\n{LINE}\n", table::HEADER);
    let text = Table::parse(&twice).unwrap_err();
    assert_eq!(text, "line 3: a line above is about the same; merge them with `mgw delays`");
}

/// The table that the project keeps is one, as it would be written, and says which columns it has;
/// the page that describes it has a row for each.
#[test]
fn the_tables_file_and_its_page_are_as_the_code_has_them() {
    let file = include_str!("../../../../docs/reply-delays.txt");
    let table = Table::parse(file).unwrap();
    let said = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| !line.starts_with('#'));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(said(file), said(&table.to_string()));
    assert!(file.contains(&format!("# {}\n", COLUMNS.join(" "))));
    let measured = table.entries().filter(|(key, _)| key.place != SIMULATOR);
    assert_eq!(
        measured.count(),
        0,
        "no hardware has been measured yet: change this with the first"
    );
    let page = include_str!("../../../../docs/reply-delays.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    let rows: Vec<&str> =
        rows.map(|(name, _)| name).filter(|name| COLUMNS.contains(name)).collect();
    assert_eq!(rows, COLUMNS);
    assert!(page.contains(&format!("`{}`", table::HEADER)));
}

fn a_key() -> impl Strategy<Value = Key> {
    let word = || "[A-Za-z0-9._+-]{1,8}";
    let kind = prop_oneof![Just("can"), Just("rs485")];
    let protocol = prop_oneof![Just("rmd"), Just("thruster"), Just("d5")];
    let few = prop_oneof![Just("a".to_owned()), word().prop_map(String::from)];
    (protocol, few, word(), kind, 1_000..20_000_000_u32, word(), word()).prop_map(
        |(protocol, model, firmware, bus, bitrate, command, place)| Key {
            protocol: protocol.to_owned(),
            model,
            firmware,
            bus: bus.to_owned(),
            bitrate,
            command,
            place,
        },
    )
}

/// Delays of one of a few keys, as they are measured one by one.
fn measurements(keys: usize) -> impl Strategy<Value = Vec<(usize, u32, u8)>> {
    proptest::collection::vec((0..keys, 0..=LONGEST_US, 0..5_u8), 0..40)
}

fn table_with(keys: &[Key], measured: &[(usize, u32, u8)]) -> Table {
    let mut table = Table::default();
    for (key, delay, day) in measured {
        let days = BTreeSet::from([format!("2026-11-{:02}", day + 1)]);
        let gateways = BTreeSet::from([format!("0.{day}.0")]);
        let entry = Entry { delays: Histogram::of(*delay), days, gateways };
        table.add(keys[*key].clone(), entry);
    }
    table
}

fn merged(one: &Table, other: &Table) -> Table {
    let mut table = one.clone();
    table.merge(other.clone());
    table
}

proptest! {
    #[test]
    fn merging_is_as_measuring_both_and_its_order_does_not_matter(
        keys in proptest::collection::vec(a_key(), 3),
        a in measurements(3), b in measurements(3), c in measurements(3),
    ) {
        let [ta, tb, tc] = [&a, &b, &c].map(|measured| table_with(&keys, measured));
        let both: Vec<_> = a.iter().chain(&b).copied().collect();
        prop_assert_eq!(merged(&ta, &tb), table_with(&keys, &both));
        prop_assert_eq!(merged(&ta, &tb), merged(&tb, &ta));
        prop_assert_eq!(merged(&merged(&ta, &tb), &tc), merged(&ta, &merged(&tb, &tc)));
        // Also by way of the text.
        let read = |table: &Table| Table::parse(&table.to_string()).unwrap();
        prop_assert_eq!(merged(&read(&ta), &read(&tb)), merged(&ta, &tb));
    }

    #[test]
    fn a_table_is_the_same_after_it_was_text(
        keys in proptest::collection::vec(a_key(), 3), all in measurements(3),
    ) {
        let table = table_with(&keys, &all);
        let text = table.to_string();
        let again = Table::parse(&text).unwrap();
        prop_assert_eq!(&again, &table);
        prop_assert_eq!(again.to_string(), text);
    }

    #[test]
    fn no_text_makes_it_panic(text in "(reply-delays 1\n)?[ -~\n]{0,200}", cut in 0..LINE.len()) {
        let _ = Table::parse(&text);
        let shorter = format!("{}\n{}", table::HEADER, &LINE[..cut]);
        prop_assert!(Table::parse(&shorter).is_err() || cut == 0);
    }
}
