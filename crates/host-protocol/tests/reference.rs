//! PROTOCOL.md against the code: numbers, names and fields of every table, in both directions.
//!
//! The fields come from the golden vectors, whose printed values name them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

use host_protocol::{
    AxisParameter, ERRORS, EVENTS, FrameError, GatewayParameter, MAX_BODY, MAX_FRAME, MAX_MESSAGE,
    MessageInfo, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParameterInfo, ParameterText, Protocol, REQUESTS,
    Request, StateField, class, requests::Ping,
};
use serde::de::DeserializeOwned;

const REFERENCE: &str = include_str!("../../../PROTOCOL.md");
const VECTORS: &str = include_str!("../../../host-tests/vectors/host-protocol.txt");

/// The cells of the rows under a heading, the backquotes taken off.
fn rows(heading: &str) -> Vec<Vec<String>> {
    let plain = |row: &str| row.split('|').map(|cell| cell.trim().replace('`', "")).collect();
    raw_rows(heading).into_iter().map(plain).collect()
}

/// The rows of the tables under a heading as they stand, without the two of each table's head.
fn raw_rows(heading: &str) -> Vec<&'static str> {
    let mut lines =
        REFERENCE.lines().skip_while(|line| line.trim_start_matches('#').trim() != heading);
    lines.next().unwrap_or_else(|| panic!("no heading {heading}"));
    let section = lines.take_while(|line| !line.starts_with('#'));
    let lines: Vec<_> = section.collect();
    let tables = lines.split(|line| !line.starts_with('|'));
    let rows = tables.flat_map(|table| table.iter().skip(2));
    rows.filter_map(|line| line.strip_prefix('|')?.strip_suffix('|')).collect()
}

/// Variant names of `T` in the order of their positions: each is decoded with zeros for its fields.
fn variants<T: DeserializeOwned + Debug>() -> Vec<String> {
    let decode = |position| {
        let mut body = [0; 64];
        body[0] = position;
        postcard::take_from_bytes::<T>(&body).ok().map(|(value, _)| value)
    };
    (0..)
        .map_while(decode)
        .map(|value| printed_fields(&format!("{value:?}")).0.to_string())
        .collect()
}

/// Field names of the struct `T`, which is decoded from zeros.
fn struct_fields<T: DeserializeOwned + Debug>() -> Vec<String> {
    let (value, _) = postcard::take_from_bytes::<T>(&[0; 64]).unwrap();
    printed_fields(&format!("{value:?}")).1.into_iter().map(str::to_string).collect()
}

/// The first words of a list of fields.
fn fields(cell: &str) -> Vec<&str> {
    cell.split(", ")
        .filter_map(|field| field.split(' ').next())
        .filter(|field| !field.is_empty())
        .collect()
}

/// Type and fields of a printed struct: `Name { field: …, field: … }`.
fn printed_fields(debug: &str) -> (&str, Vec<&str>) {
    let end = debug.find(|c: char| !c.is_alphanumeric()).unwrap_or(debug.len());
    let (name, rest) = debug.split_at(end);
    let mut depth = 0;
    let mut fields = Vec::new();
    let mut start = 0;
    for (at, character) in rest.char_indices() {
        match character {
            '{' | '[' | '(' => depth += 1,
            '}' | ']' | ')' if depth == 1 => break,
            '}' | ']' | ')' => depth -= 1,
            ':' if depth == 1 => fields.push(rest[start..at].trim()),
            _ => {}
        }
        if matches!(character, '{' | ',') {
            start = at + 1;
        }
    }
    (name, fields)
}

/// What the vectors print of the messages under a comment that begins with `part`.
fn printed(part: &str) -> impl Iterator<Item = &'static str> {
    let lines = VECTORS.lines().skip_while(move |line| {
        !line.strip_prefix("# ").is_some_and(|text| text.starts_with(part))
    });
    lines
        .skip(1)
        .take_while(|line| !line.starts_with('#'))
        .filter_map(|line| line.splitn(3, '|').nth(2))
        .map(str::trim)
}

/// The inside of `Outer(inside)`.
fn inside(debug: &str) -> &str {
    debug.split_once('(').and_then(|(_, inside)| inside.strip_suffix(')')).unwrap()
}

fn numbers(table: &[MessageInfo]) -> BTreeMap<String, u16> {
    table.iter().map(|info| (info.name.to_string(), info.number)).collect()
}

fn parse(number: &str) -> u16 {
    match number.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16).unwrap(),
        None => number.parse().unwrap(),
    }
}

fn assert_numbers(heading: &str, table: &[MessageInfo]) {
    let rows = rows(heading);
    let documented: BTreeMap<_, _> =
        rows.iter().map(|row| (row[1].clone(), parse(&row[0]))).collect();
    assert_eq!(documented, numbers(table), "{heading}");
    assert_eq!(rows.len(), table.len(), "{heading}: a row comes twice");
}

/// Compares the fields of the rows under `heading` with printed structs of the same names.
fn assert_fields<'a>(heading: &str, name: usize, printed: impl Iterator<Item = &'a str>) {
    let rows = rows(heading);
    let documented: BTreeMap<_, _> =
        rows.iter().map(|row| (row[name].as_str(), fields(&row[name + 1]))).collect();
    let mut seen = BTreeSet::new();
    for debug in printed {
        let (message, fields) = printed_fields(debug);
        assert_eq!(documented.get(message), Some(&fields), "{heading}: {message}");
        seen.insert(message);
    }
    assert!(documented.keys().copied().eq(seen), "{heading}: a row that nothing belongs to");
}

#[test]
fn requests_are_those_of_the_code() {
    assert_numbers("Requests", REQUESTS);
    assert_fields("Requests", 1, printed("Requests").map(inside));
}

#[test]
fn the_requests_that_take_authority_are_those_of_the_code() {
    let told = rows("Requests").into_iter().filter(|row| row[4] == "takes");
    let takes = |info: &&MessageInfo| Request::classes(info.number) & class::COMMANDS != 0;
    let meant = REQUESTS.iter().filter(takes).map(|info| info.name.to_string());
    assert_eq!(told.map(|row| row[1].clone()).collect::<BTreeSet<_>>(), meant.collect());
}

#[test]
fn replies_are_those_of_the_code() {
    assert_fields("Replies", 0, printed("Replies").map(inside));
    let of_request: BTreeMap<_, _> =
        rows("Requests").iter().map(|row| (row[1].clone(), row[3].clone())).collect();
    for debug in printed("Replies") {
        let (request, reply) = (printed_fields(debug).0, printed_fields(inside(debug)).0);
        assert_eq!(of_request[request], reply, "{request}");
    }
}

#[test]
fn errors_are_those_of_the_code() {
    assert_numbers("Errors", ERRORS);
    assert_fields("Errors", 1, printed("Errors"));
}

#[test]
fn events_are_those_of_the_code() {
    assert_numbers("Events", EVENTS);
    assert_fields(
        "Events",
        1,
        printed("Events").map(|debug| {
            let event = debug.split_once("event: ").unwrap().1;
            event.strip_suffix('}').unwrap().trim_end()
        }),
    );
}

#[test]
fn types_are_those_of_the_code() {
    let rows = raw_rows("Types");
    let mut documented: BTreeMap<_, _> = rows
        .iter()
        .map(|row| {
            row.split_once('|').map(|(name, text)| (name.trim().trim_matches('`'), text)).unwrap()
        })
        .collect();
    let mut text_of = |name| documented.remove(name).unwrap_or_else(|| panic!("no row for {name}"));

    macro_rules! enums {
        ($($name:ident),+) => { $(
            let quoted: Vec<_> = text_of(stringify!($name)).split('`').skip(1).step_by(2).collect();
            assert_eq!(quoted, variants::<host_protocol::$name>(), stringify!($name));
        )+ };
    }
    enums!(
        Value,
        Change,
        Subject,
        ImageState,
        AxisState,
        Setpoint,
        StopTarget,
        ClearTarget,
        RawFrame,
        BusKind,
        BusLimit,
        BusMode,
        BusState,
        BootReason,
        Incident,
        MotorTimeout,
        Agreement,
        TripReason,
        NoReplyHint,
        TogetherBar,
        AuthorityLossReason,
        Quantity,
        StoredState
    );

    macro_rules! structs {
        ($($name:ident),+) => { $(
            let text = text_of(stringify!($name)).trim();
            assert_eq!(fields(text), struct_fields::<host_protocol::$name>(), stringify!($name));
        )+ };
    }
    structs!(
        ReceivedFrame,
        BusCapability,
        BusConfig,
        BusCounters,
        AxisSummary,
        Trip,
        Reading,
        FaultReading,
        Setting,
        Named,
        FirmwareVersion,
        Member,
        VersionAnswer
    );

    for (protocol, bit) in Protocol::ALL.iter().zip(0..) {
        let number = format!("{} {}", protocol.number(), protocol.name());
        assert!(documented["Protocol"].contains(&number), "{number}");
        let bit = format!("bit {bit} {}", protocol.name());
        assert!(documented["ProtocolSet"].contains(&bit), "{bit}");
    }
    for (field, bit) in StateField::ALL.iter().zip(0..) {
        let bit = format!("bit {bit} {}", field.name());
        assert!(documented["StateFields"].contains(&bit), "{bit}");
    }
    assert!(
        documented.keys().eq(&["CanFrame", "CanId", "Protocol", "ProtocolSet", "StateFields"]),
        "{documented:?}"
    );
}

#[test]
fn parameters_are_those_of_the_code() {
    let axis: Vec<_> = AxisParameter::ALL
        .iter()
        .map(|parameter| row(parameter.info(), parameter.text()))
        .collect();
    assert_eq!(rows("Axis parameters"), axis);
    let gateway: Vec<_> = GatewayParameter::ALL
        .iter()
        .map(|parameter| row(parameter.info(), parameter.text()))
        .collect();
    assert_eq!(rows("Gateway parameters"), gateway);
}

/// A parameter's row as it has to stand in the reference.
fn row(info: &ParameterInfo, text: &ParameterText) -> Vec<String> {
    let default = match info.default {
        Some(value) => value.to_string(),
        None => if info.required { "required" } else { "none" }.to_string(),
    };
    let range = format!("{} to {}", info.min, info.max);
    let number = info.number.to_string();
    let (name, kind, unit, meaning) = (
        text.name.to_string(),
        info.kind.name().to_string(),
        text.unit.to_string(),
        text.doc.to_string(),
    );
    vec![number, name, kind, unit, range, default, meaning]
}

#[test]
fn reasons_of_rejected_frames_are_those_of_the_code() {
    let documented: Vec<_> = rows("Reasons of FrameRejected")
        .iter()
        .map(|row| (parse(&row[0]), row[1].clone()))
        .collect();
    let table: Vec<_> = FrameError::ALL
        .iter()
        .map(|(number, name)| (u16::from(*number), (*name).to_string()))
        .collect();
    assert_eq!(documented, table);
}

#[test]
fn version_limits_and_example_are_those_of_the_code() {
    assert!(
        REFERENCE.starts_with(&format!(
            "# The host protocol, version {PROTOCOL_MAJOR}.{PROTOCOL_MINOR}\n"
        ))
    );
    let unwrapped = REFERENCE.split_whitespace().collect::<Vec<_>>().join(" ");
    for text in [
        format!("has at most {MAX_MESSAGE} bytes"),
        format!("both delimiters at most {MAX_FRAME}"),
        format!("| 0 to {MAX_BODY} |"),
    ] {
        assert!(unwrapped.contains(&text), "{text}");
    }
    let mut out = [0; MAX_FRAME];
    let length = Request::from(Ping {}).encode_frame(1, &mut out).unwrap();
    let hex: Vec<_> = out[..length].iter().map(|byte| format!("{byte:02X}")).collect();
    assert!(REFERENCE.contains(&format!("\n{}\n", hex.join(" "))));
}
