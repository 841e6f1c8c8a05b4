use super::*;
use crate::config::board::BoardPorts;
use crate::config::check::{check, check_without_board};
use crate::config::file::File;
use host_protocol::BusKind;
use serde_json::Value as Json;

const FOUR_MOTORS: &str = include_str!("../../examples/four-motors.toml");
const D5_ON_RS485: &str = include_str!("../../examples/d5-on-rs485.toml");

fn read(text: &str) -> File {
    parse(&Source { path: "a.toml".to_owned(), text: text.to_owned() }, &Configuration::default())
}

/// What a file makes of an empty configuration.
fn whole(text: &str) -> Configuration {
    let file = read(text);
    let configuration = file.onto(Configuration::default());
    assert_eq!(check_without_board(&file, &configuration), [], "{text}");
    configuration
}

/// What is wrong with a file, a line for each.
fn wrong(text: &str) -> Vec<String> {
    let file = read(text);
    let findings = check_without_board(&file, &file.onto(Configuration::default()));
    let failure = Failure::Configuration { path: "a.toml".to_owned(), findings };
    failure.to_string().lines().map(str::to_owned).collect()
}

#[test]
fn a_file_becomes_a_configuration() {
    let configuration = whole(
        "[gateway]\nlink_silence_us = 200000\n\
         [[bus]]\nbus = 1\nbitrate = 210_526\nprotocols = [\"d5\"]\n\
         [[axis]]\naxis = 2\nstop_action = \"hold\"\nbus = 1\nprotocol = \"d5\"\nnode = 0x0B\n\
         velocity_limit_rad_s = 12\nmotor_timeout_ms = 1\n",
    );
    let silence = (GatewayParameter::LinkSilenceUs, Value::Unsigned(200_000));
    assert_eq!(configuration.gateway, [silence].into());
    let bus = BusConfig {
        bitrate: 210_526,
        protocols: ProtocolSet::of(&[Protocol::D5]),
        exclusive: false,
        reply_window_us: 5_000,
    };
    assert_eq!(configuration.buses, [(1, bus)].into());
    let parameters = [
        (AxisParameter::Bus, Value::Unsigned(1)),
        (AxisParameter::Protocol, Value::Unsigned(3)),
        (AxisParameter::Node, Value::Unsigned(11)),
        (AxisParameter::StopAction, Value::Unsigned(2)),
        (AxisParameter::VelocityLimitRadS, Value::Float(12.0)),
    ];
    assert_eq!(configuration.axes, [(2, parameters.into())].into());
    assert_eq!(configuration.motor_timeouts, [(2, 1)].into());
}

/// Each slip has its line, its key and what is allowed; one hides no other.
/// One lost reply costs two reply windows, and the motor would let go meanwhile.
#[test]
fn a_motor_timeout_that_is_shorter_than_its_bus_waits_is_told() {
    let with = |window_us: u32, timeout_ms: u32| {
        format!(
            "[[bus]]\nbus = 0\nbitrate = 1_000_000\nprotocols = [\"rmd\"]\n\
             reply_window_us = {window_us}\n\
             [[axis]]\naxis = 0\nbus = 0\nprotocol = \"rmd\"\nnode = 1\n\
             stop_action = \"hold\"\nmotor_timeout_ms = {timeout_ms}\n"
        )
    };
    assert_eq!(
        wrong(&with(200_000, 650)),
        [
            "a.toml: line 12, axis 0: the motor of axis 0 lets go after 650 ms, and its bus may keep \
             it waiting for so long: the stops of all others there go first, and a lost reply takes \
             two reply windows; 651 ms and more outlast that"
        ]
    );
    for (window_us, timeout_ms) in [(200_000, 651), (5_000, 20), (200_000, 0)] {
        assert!(wrong(&with(window_us, timeout_ms)).is_empty());
    }
}

#[test]
fn all_errors_of_a_file_are_told_at_once() {
    let text = "\
[gateway]
link_silence_us = 49999
speed = 1

[[bus]]
bus = 0
bitrate = 1_000_000
protocols = [\"rmd\", \"can\"]

[[bus]]
bus = 1
protocols = [\"thruster\"]
reply_window_us = 99

[[axis]]
axis = 0
bus = 0
protocol = \"rmd\"
node = 1
stop_action = \"halt\"
ttl_us = 1
unsafe = true

[[axis]]
axis = 1
bus = 0
protocol = \"rmd\"
node = 1
signal_limit = 0.5
position_device = true

[[axis]]
axis = 1
node = 2

[[axis]]
axis = 2
bus = 3
protocol = \"rmd\"
node = 1
stop_action = \"hold\"
motor_timeout_ms = -1

[[motor]]
[[axis]]
node = 3
";
    let found = wrong(text);
    let expected = [
        "a.toml: line 2, gateway: link_silence_us 49999 µs is out of range",
        "a.toml: line 3, gateway: the gateway has no parameter `speed`. There are: link_silence_us, name",
        "a.toml: line 8, bus 0: protocols: `can` is no protocol. There are: rmd, thruster, d5",
        "a.toml: line 11, bus 1: lacks bitrate; for example bitrate = 1_000_000",
        "a.toml: line 13, bus 1: `99` is no value for reply_window_us of a bus. It takes 100 to",
        "a.toml: line 20, axis 0: `halt` is no value for stop_action. It takes coast, hold, brake",
        "a.toml: line 21, axis 0: ttl_us 1 µs is out of range; allowed are 5000 µs to 60000000 µs",
        "a.toml: line 22, axis 0: an axis has no parameter `unsafe`. There are: bus, protocol",
        "a.toml: line 25, axis 1: lacks stop_action; it takes coast, hold, brake",
        "a.toml: line 28, axis 1: axis 0 has this bus and node; choose another node",
        "a.toml: line 33, axis 1: is there already, in line 25",
        "a.toml: line 38, axis 2: bus 3 is not configured; add [[bus]] with bus = 3",
        "a.toml: line 42, axis 2: motor_timeout_ms takes a whole number from 0 on",
        "a.toml: line 44, there is no `motor`. There are: [gateway], [[bus]], [[axis]]",
        "a.toml: line 45, axis: lacks its number: axis = 0",
    ];
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.starts_with(expected), "{found}\n{expected}");
    }
}

#[test]
fn a_number_or_a_switch_in_quotes_is_refused() {
    let text = "\
[gateway]
link_silence_us = \"200000\"

[[bus]]
bus = 0
bitrate = 1000000
protocols = [\"rmd\"]
exclusive = \"false\"

[[axis]]
axis = 0
bus = 0
protocol = \"rmd\"
node = \"1\"
stop_action = \"hold\"
velocity_limit_rad_s = \"5\"
allow_unknown_motor_timeout = \"true\"
";
    assert_eq!(
        wrong(text),
        [
            "a.toml: line 2, gateway: link_silence_us takes 50000 to 10000000 µs, without quotes",
            "a.toml: line 8, bus 0: exclusive takes true or false, without quotes",
            "a.toml: line 14, axis 0: node takes 1 to 253, without quotes",
            "a.toml: line 16, axis 0: velocity_limit_rad_s takes 0 to 10000 rad/s, without quotes",
            "a.toml: line 17, axis 0: allow_unknown_motor_timeout takes true or false, without quotes",
        ]
    );
}

#[test]
fn a_bitrate_of_zero_is_answered_with_those_that_there_are() {
    assert_eq!(
        wrong("[[bus]]\nbus = 0\nbitrate = 0\nprotocols = [\"rmd\"]\n"),
        ["a.toml: line 3, bus 0: `0` is no value for bitrate of a bus. It takes bit/s above 0, \
             as a rule 1000000, 500000, 250000, 210526 on CAN, or 115200, 500000, 1000000, \
             1500000, 2000000 on RS485"]
    );
}

/// A name is told to be wrong with its line; of two rows of a kind with one name the second.
#[test]
fn names_that_cannot_be_are_told_with_their_lines() {
    let text = "\
[gateway]
name = \"2nd\"

[[bus]]
bus = 0
name = \"left\"
bitrate = 1_000_000
protocols = [\"rmd\"]

[[axis]]
axis = 0
name = \"left\"
bus = 0
protocol = \"rmd\"
node = 1
stop_action = \"hold\"

[[axis]]
axis = 1
name = \"left\"
bus = 0
protocol = \"rmd\"
node = 1
stop_action = \"hold\"

[[axis]]
axis = 2
name = \"all\"
bus = 0
protocol = \"rmd\"
node = 2
stop_action = \"hold\"

[[axis]]
axis = 3
name = [\"a\"]
bus = 0
protocol = \"rmd\"
node = 3
stop_action = \"hold\"
";
    let found = wrong(text);
    let allowed =
        "is 1 to 16 letters, digits, - and _, begins with a letter, and is not `all` or `gateway`";
    let expected = [
        &format!("a.toml: line 2, gateway: `2nd`: the name of the gateway {allowed}"),
        "a.toml: line 20, axis 1: axis 0 has the name that axis 1 is given; choose another, or give axis 0 another",
        "a.toml: line 23, axis 1: axis 0 has this bus and node",
        &format!("a.toml: line 28, axis 2: `all`: the name of axis 2 {allowed}"),
        "a.toml: line 36, axis 3: name takes a single value",
    ];
    assert_eq!(found.len(), expected.len(), "{found:#?}");
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.starts_with(expected), "{found}\n{expected}");
    }
}

/// A bus by its name, wherever that stands in the file; a template keeps it.
#[test]
fn a_bus_is_named_where_its_number_could_stand() {
    let text = "\
[[axis]]
axis = 4
bus = \"arm\"
protocol = \"rmd\"
node = 1
stop_action = \"hold\"

[[bus]]
bus = 1
name = \"arm\"
bitrate = 1_000_000
protocols = [\"rmd\"]
";
    let named = whole(text);
    assert_eq!(named.bus_of(4), Some(1));
    assert_eq!(named, whole(&text.replace("bus = \"arm\"", "bus = 1")));
    assert_eq!(dump_like(text, &named).unwrap(), text);
    let mut moved = named.clone();
    moved.set(&Entry::Axis(4, AxisParameter::Node, Value::Unsigned(2)));
    assert_eq!(dump_like(text, &moved).unwrap(), text.replace("node = 1", "node = 2"));
    assert_eq!(
        wrong(&text.replace("\"arm\"\np", "\"amr\"\np")),
        ["a.toml: line 3, axis 4: no bus is called `amr`; there are: arm (1)"]
    );
    assert_eq!(
        wrong(&text.replace("bus = \"arm\"", "bus = \"1\"")),
        ["a.toml: line 3, axis 4: bus takes 0 to 7, without quotes"]
    );
    let row = text.replace("bus = 1", "bus = \"other\"");
    assert_eq!(
        wrong(&row),
        [
            "a.toml: line 3, axis 4: no bus is called `arm`; no bus has a name; give its number",
            "a.toml: line 9, no bus is called `other`; no bus has a name; give its number",
        ]
    );
    // What is merged names what the gateway has.
    let merged = "[[axis]]\naxis = \"left\"\nbus = \"other\"\n";
    let mut base = named.clone();
    base.set(&Entry::Name(Subject::Axis(4), Text::try_from("left").unwrap()));
    base.set(&Entry::Name(Subject::Bus(0), Text::try_from("other").unwrap()));
    let source = Source { path: "a.toml".to_owned(), text: merged.to_owned() };
    let file = parse(&source, &base);
    assert_eq!(file.findings, []);
    assert_eq!(file.onto(base).bus_of(4), Some(0));
}

/// Names change by themselves, and go with what they name.
#[test]
fn names_are_changes_of_their_rows() {
    let before = whole(&FOUR_MOTORS.replace("axis = 3\n", "axis = 3\nname = \"left\"\n"));
    let name = |text: &str| Text::<MAX_NAME>::try_from(text).unwrap();
    assert_eq!(before.names, [(Subject::Axis(3), name("left"))].into());
    let mut after = before.clone();
    after.names = [(Subject::Axis(3), name("right")), (Subject::Gateway, name("arm"))].into();
    let changes = before.changes_to(&after);
    let shown: Vec<String> = changes.iter().map(|change| before.shown(change)).collect();
    assert_eq!(shown, ["gateway: name not set -> arm", "axis 3: name left -> right"]);
    let json: Vec<Json> = changes.iter().map(change_to_json).collect();
    assert_eq!(json[0], serde_json::json!({ "parameter": "name", "value": "arm" }));
    assert_eq!(json[1], serde_json::json!({ "axis": 3, "parameter": "name", "value": "right" }));
    let is_name = |change: &Change| matches!(change, Change::Name { .. });
    after.unset(Subject::Axis(3), "name").unwrap();
    assert_eq!(after.changes_to(&before).iter().filter(|change| is_name(change)).count(), 2);
    after.axes.remove(&3);
    assert_eq!(before.changes_to(&after).iter().filter(|change| is_name(change)).count(), 1);
    // An axis that was there for a while without it gets it back.
    let mut without = before.clone();
    without.axes.remove(&3);
    assert!(without.changes_to(&before).iter().any(is_name));
    assert!(!before.changes_to(&without).iter().any(is_name));
}

#[test]
fn a_board_refuses_what_it_has_not() {
    let file = read(FOUR_MOTORS);
    let configuration = file.onto(Configuration::default());
    let ports = vec![
        (BusKind::Can, vec![1_000_000]),
        (BusKind::Can, vec![500_000]),
        (BusKind::Rs485, vec![115_200]),
    ];
    let board = BoardPorts { ports, max_axes: 32 };
    let found = check(&file, &configuration, &board);
    let [Finding { name: "BitrateNotOffered", line: Some(line), .. }] = found[..] else {
        panic!("{found:#?}")
    };
    assert!(FOUR_MOTORS.lines().nth(line - 1).unwrap().starts_with("bitrate = 210_526"));
    assert_eq!(check_without_board(&file, &configuration), []);
}

#[test]
fn what_is_dumped_is_the_same_configuration() {
    let examples = [FOUR_MOTORS, D5_ON_RS485].join("\n");
    let axis = "[[axis]]\naxis = 31\nbus = 1\nprotocol = \"d5\"\nnode = 0x0C\nstop_action = \"hold\"\n\
        d5_request_id = \"extended:0x12345678\"\nd5_reply_id = 0x7FF\ndirection = -1\n\
        limit_margin = 0.3333333\nposition_min_rad = -3e2\nallow_uncommanded = true\n\
        motor_timeout_ms = 0\nname = \"a-name_of-16-bts\"\n";
    let configuration = whole(&(examples + "\n" + axis));
    let text = dump(&configuration);
    assert_eq!(whole(&text), configuration, "{text}");
    assert_eq!(dump(&whole(&text)), text);
    assert_eq!(configuration.changes_to(&whole(&text)), []);
}

/// Comments, order and the way to write numbers are those of the template.
#[test]
fn a_template_keeps_its_comments_and_only_what_differs_is_written() {
    let examples = [FOUR_MOTORS, D5_ON_RS485].join("\n");
    let configuration = whole(&examples);
    assert_eq!(dump_like(&examples, &configuration).unwrap(), examples);
    let mut other = configuration.clone();
    other.axes.get_mut(&3).unwrap().insert(AxisParameter::TtlUs, Value::Unsigned(60_000));
    let expected = examples.replace("ttl_us = 500_000", "ttl_us = 60000");
    assert_eq!(dump_like(&examples, &other).unwrap(), expected);
    other.axes.get_mut(&1).unwrap().remove(&AxisParameter::SignalLimit);
    other.buses.get_mut(&2).unwrap().exclusive = true;
    other.axes.remove(&4);
    other.motor_timeouts.remove(&0);
    let sixth =
        [(AxisParameter::Bus, Value::Unsigned(0)), (AxisParameter::Node, Value::Unsigned(9))];
    other.axes.insert(6, sixth.into());
    let text = dump_like(&examples, &other).unwrap();
    assert_eq!(read(&text).onto(Configuration::default()), other, "{text}");
    assert!(text.contains("# A thruster on the same CAN bus.") && !text.contains("signal_limit"));
    assert_eq!(dump_like(&text, &other).unwrap(), text);
    assert_eq!(read(&dump_like("", &other).unwrap()).onto(Configuration::default()), {
        // What has its default need not be written.
        let mut bare = other.clone();
        bare.gateway.clear();
        bare
    });
    assert!(dump_like("[axis", &other).is_err());
}

#[test]
fn a_template_may_write_its_sections_within_one_line() {
    let text = "gateway = { link_silence_us = 300000 }\n\
        bus = [{ bus = 0, bitrate = 1000000, protocols = [\"rmd\"] }]\n\
        axis = [{ axis = 0, bus = 0, protocol = \"rmd\", node = 1, stop_action = \"coast\" }]\n";
    let template = read(text).onto(Configuration::default());
    let other = read(&text.replace("node = 1", "node = 2").replace("300000", "400000"))
        .onto(Configuration::default());
    for configuration in [&template, &other, &Configuration::default()] {
        let written = dump_like(text, configuration).unwrap();
        assert_eq!(read(&written).onto(Configuration::default()), *configuration, "{written}");
    }
}

#[test]
fn what_a_file_does_not_name_has_its_default_unless_it_is_merged() {
    let before = whole(FOUR_MOTORS);
    let text = "[[bus]]\nbus = 0\nexclusive = true\n[[axis]]\naxis = 3\nttl_us = 60_000\n";
    let merged = read(text).onto(before.clone());
    let mut expected = before.clone();
    expected.buses.get_mut(&0).unwrap().exclusive = true;
    expected.axes.get_mut(&3).unwrap().insert(AxisParameter::TtlUs, Value::Unsigned(60_000));
    assert_eq!(merged, expected);
    assert_eq!(before.changes_to(&merged).len(), 2);
    let replaced = before.changes_to(&Configuration::default());
    let axis_3 = |change: &&Change| matches!(change, Change::Axis { axis: 3, value: None, .. });
    assert_eq!(replaced.iter().filter(axis_3).count(), before.axes[&3].len());
    assert_eq!(
        before.shown(&Change::Axis { axis: 3, parameter: 6, value: None }),
        "axis 3: ttl_us 500000 µs -> not set"
    );
}

#[test]
fn a_key_is_unset_and_a_required_one_of_a_bus_is_not() {
    let mut configuration = whole(FOUR_MOTORS);
    configuration.unset(Subject::Axis(3), "ttl_us").unwrap();
    assert!(!configuration.axes[&3].contains_key(&AxisParameter::TtlUs));
    assert!(configuration.unset(Subject::Bus(0), "bitrate").is_err());
    let error = configuration.unset(Subject::Axis(3), "ttl").unwrap_err().to_string();
    assert!(error.contains("no parameter `ttl`. There are: bus"), "{error}");
}

#[test]
fn the_schema_knows_every_key() {
    let schema = schema();
    let axis = &schema["properties"]["axis"]["items"];
    for parameter in AxisParameter::ALL {
        let key = &axis["properties"][parameter.text().name];
        let doc = parameter.text().doc;
        assert!(key["description"].as_str().is_some_and(|text| text.starts_with(doc)), "{key}");
    }
    assert_eq!(axis["properties"]["ttl_us"]["maximum"], 60_000_000);
    assert_eq!(axis["properties"]["stop_action"]["enum"][1], "hold");
    assert_eq!(axis["properties"]["rmd_dialect"]["enum"][6], "v4_4");
    assert_eq!(
        axis["anyOf"][0]["required"],
        serde_json::json!(["bus", "protocol", "node", "stop_action"])
    );
    for key in BUS_KEYS {
        assert!(schema["properties"]["bus"]["items"]["properties"][key].is_object(), "{key}");
    }
    assert_eq!(axis["additionalProperties"], false);
}

/// One refusal hides no other: not that of a stop action, which every axis needs.
#[test]
fn an_axis_whose_stop_action_is_refused_is_looked_at_further() {
    let text = "[[bus]]\nbus = 0\nbitrate = 1_000_000\nprotocols = [\"rmd\", \"thruster\"]\n\n\
                [[axis]]\naxis = 1\nbus = 0\nprotocol = \"thruster\"\nnode = 11\n\
                stop_action = \"hold\"\nrelease_brake_when_arming = true\n\n\
                [[axis]]\naxis = 3\nbus = 0\nprotocol = \"thruster\"\nnode = 11\n\
                stop_action = \"coast\"\n";
    let found = wrong(text).join("\n");
    for said in ["line 11, axis 1", "line 12, axis 1: release_brake", "line 18, axis 3"] {
        assert!(found.contains(said), "{said}: {found}");
    }
}
