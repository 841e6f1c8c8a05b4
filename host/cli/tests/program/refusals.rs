//! What must not work, and what is said then.

use std::io::Read;
use std::net::{TcpListener, TcpStream};
use std::thread;

use nix::sys::signal::Signal;
use serde_json::Value;

use crate::schema;
use crate::support::{FOUR, Outcome, Process, Sim, file, json, mgw, mgw_cut_short};

/// The error that `--json` prints.
fn error(outcome: Outcome, code: i32) -> Value {
    let value = json(&outcome.failure(code));
    schema::check_as("error", &value);
    value["error"].clone()
}

#[test]
fn a_port_that_does_not_exist() {
    // A port that was just free: bound to learn its number, then closed.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    drop(listener);
    let text = mgw(&["--port", &port, "info"]).failure(1);
    assert!(
        text.starts_with("mgw: no gateway at tcp:127.0.0.1:") && text.contains("mgw sim"),
        "{text}"
    );
    assert_eq!(error(mgw(&["--json", "--port", &port, "info"]), 1)["name"], "no_connection");
    let text = mgw(&["--port", "/dev/no-such-gateway", "info"]).failure(1);
    assert!(text.contains("/dev/no-such-gateway") && text.contains("plugged in"), "{text}");
}

#[test]
fn a_server_that_is_no_gateway() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    let text = mgw(&["--port", &port, "info"]).failure(1);
    assert!(text.contains("no gateway answered"), "{text}");
}

#[test]
fn an_address_is_understood_however_it_is_written() {
    let sim = Sim::start();
    let address = sim.port.strip_prefix("tcp:").unwrap();
    for port in [address.to_owned(), format!("TCP:{address}"), format!("tcp://{address}")] {
        assert!(mgw(&["--port", &port, "info"]).success().contains("simulated"), "{port}");
    }
    let text = mgw(&["--port", "127.0.0.1", "info"]).failure(2);
    assert!(text.contains("Write tcp:HOST:PORT, for example tcp:127.0.0.1:7401"), "{text}");
}

#[test]
fn no_port_at_all() {
    let text = mgw(&["info"]).failure(2);
    assert!(text.contains("--port") && text.contains("mgw sim"), "{text}");
}

#[test]
fn wrong_usage_has_exit_code_2() {
    for arguments in [
        &["fly"][..],
        &["set", "0", "velocity"],
        &["set", "0", "velocity", "fast"],
        &["stop", "some"],
        &["watch", "--period", "0"],
        &["watch", "--count", "0"],
        &["set", "0", "velocity", "1", "--for", "0"],
        &["native", "0", "9C00000000000000", "--for", "0"],
        &["config"],
        &["sim", "--listen", "here"],
        &["--port", "tcp:nowhere", "info"],
        &["--port", "/dev/ttyACM0@fast", "info"],
        &["--port", "", "info"],
    ] {
        mgw(arguments).failure(2);
    }
}

#[test]
fn the_gateway_refuses_each_bad_value_by_name() {
    let sim = Sim::start();
    let cases: [(&[&str], &str); 8] = [
        (&["state", "77"], "unknown_axis"),
        (&["bus", "9"], "unknown_bus"),
        (&["set", "0", "velocity", "nan", "--for", "1"], "not_a_number"),
        (&["set", "0", "velocity", "1000", "--for", "1"], "out_of_range"),
        (&["set", "1", "position", "1", "--speed-limit", "1", "--for", "1"], "unsupported"),
        (&["config", "axis", "0", "ttl_us=4999"], "out_of_range"),
        (&["config", "axis", "0", "node=254"], "out_of_range"),
        (&["clear", "77"], "unknown_axis"),
    ];
    for (arguments, name) in cases {
        let error = error(sim.mgw(&[&["--json"], arguments].concat()), 1);
        assert_eq!(error["name"], name, "{arguments:?}: {error}");
        assert!(
            error["number"].is_u64()
                && error["message"].as_str().is_some_and(|text| text.len() > 20),
            "{error}"
        );
    }
    // No axis was left armed or moved.
    for axis in ["0", "1"] {
        assert_eq!(sim.await_state(axis, |state| state["state"] != "stopping")["state"], "idle");
    }
}

#[test]
fn an_axis_without_a_stop_action_does_not_arm() {
    let sim = Sim::with(&["--unconfigured"]);
    sim.mgw(&["config", "bus", "0", "bitrate=1000000", "protocols=rmd"]).success();
    sim.half_configure(0, "bus = 0\nprotocol = \"rmd\"\nnode = 1\n");
    let error = error(sim.mgw(&["--json", "arm", "0"]), 1);
    assert_eq!(error["name"], "not_configured");
    let said = "axis 0 is not configured: it has no stop_action. Write it into a file, then `mgw \
                config apply FILE`";
    assert_eq!(error["message"], said);
}

#[test]
fn slips_of_the_pen_are_answered_with_what_is_allowed() {
    let sim = Sim::start();
    let text = sim.mgw(&["config", "axis", "0", "stop_action=halt"]).failure(2);
    assert!(text.contains("coast, hold, brake"), "{text}");
    let text = sim.mgw(&["config", "axis", "0", "speed=3"]).failure(2);
    assert!(text.contains("velocity_limit_rad_s"), "{text}");
    let text = sim.mgw(&["config", "bus", "3", "bitrate=115200"]).failure(2);
    assert!(text.contains("protocols="), "{text}");
    let text = sim.mgw(&["set", "0", "position", "1"]).failure(2);
    assert!(text.contains("--speed-limit"), "{text}");
    let text = sim.mgw(&["raw", "0", "send", "141"]).failure(2);
    assert!(text.contains("141#9A00000000000000"), "{text}");
    let text = sim.mgw(&["raw", "x", "listen"]).failure(2);
    assert!(text.contains("no bus is called `x`; no bus has a name; give its number"), "{text}");
}

#[test]
fn a_file_is_read_before_anything_connects_and_only_so_far() {
    let nobody = ["--port", "tcp:127.0.0.1:1", "config", "apply"];
    let text = mgw(&[&nobody[..], &["/no/such/file.toml"]].concat()).failure(2);
    assert!(text.contains("/no/such/file.toml") && text.contains("No such file"), "{text}");
    for (path, said) in [("/dev/zero", "a pipe or a device"), ("/", "a directory")] {
        let text = mgw(&[&nobody[..], &[path]].concat()).failure(2);
        assert!(text.contains(said), "{path}: {text}");
    }
    let path = &*file("some.toml");
    std::fs::write(path, " ".repeat(262_145)).unwrap();
    let text = mgw(&[&nobody[..], &[path]].concat()).failure(2);
    assert!(text.contains("more than 262144 bytes"), "{text}");
    std::fs::write(path, "[[axis]]\naxis = 0\nttl_us = 1\n").unwrap();
    let text = mgw(&[&nobody[..], &[path]].concat()).failure(1);
    assert!(text.contains("line 3, axis 0: ttl_us 1 µs is out of range"), "{text}");
    assert!(text.contains(path), "{text}");
    std::fs::write(path, "[[axis]]\naxis = 0\nspeed\u{1b}[2J = 3\n").unwrap();
    let text = mgw(&[&nobody[..], &[path]].concat()).failure(1);
    assert!(text.contains("line 3, ") && !text.contains('\u{1b}'), "{text:?}");
}

#[test]
fn a_file_that_cannot_be_read_is_wrong_usage_whatever_reads_it() {
    let sim = Sim::start();
    let (missing, four) = ("/no/such/file", FOUR);
    for (words, folder) in [
        (&["plan"][..], "it is a directory"),
        (&["plan", four, "--delays"], "it is a directory"),
        (&["config", "check"], "it is a directory"),
        (&["config", "apply"], "it is a directory"),
        (&["config", "diff"], "it is a directory"),
        (&["config", "dump", "--template"], "it is a directory"),
        (&["motor", "0", "restore"], "it is a directory"),
        (&["update"], "cannot read / (Is a directory"),
        (&["image"], "cannot read / (Is a directory"),
        (&["delays"], "cannot read / (Is a directory"),
        (&["play"], "cannot read / ("),
        (&["plot", "--output", "x.svg"], "cannot read / ("),
        (&["decode"], "cannot read / (Is a directory"),
        (&["replay"], "cannot read / (Is a directory"),
    ] {
        let text = sim.mgw(&[words, &[missing]].concat()).failure(2);
        assert!(text.contains("mgw: cannot read /no/such/file (No such file"), "{text}");
        let text = sim.mgw(&[&["--json"], words, &[missing]].concat()).failure(2);
        let told = json(text.lines().last().unwrap());
        assert_eq!(told["error"]["name"], "file", "{words:?}: {told}");
        let text = sim.mgw(&[words, &["/"]].concat()).failure(2);
        assert!(text.contains(folder), "{words:?}: {text}");
    }
}

/// Nobody writes into the pipe: it is refused and not waited for.
#[test]
fn a_pipe_is_no_configuration() {
    let path = &file("fifo");
    nix::unistd::mkfifo(path.as_str(), nix::sys::stat::Mode::S_IRWXU).unwrap();
    let text = mgw(&["--port", "tcp:127.0.0.1:1", "config", "apply", path]).failure(2);
    assert!(text.contains("a pipe or a device"), "{text}");
}

/// The gateway's own rules, before anything of the file is sent.
#[test]
fn a_file_that_the_gateway_would_refuse_changes_nothing() {
    let axis = |more: &str| {
        format!(
            "[[axis]]\naxis = 0\nbus = 0\nprotocol = \"rmd\"\nnode = 1\nstop_action = \
                \"hold\"\n{more}"
        )
    };
    let bus = "[[bus]]\nbus = 0\nbitrate = 1_000_000\nprotocols = [\"rmd\", \"thruster\"]\n";
    let second = axis("").replace("axis = 0", "axis = 1");
    let sim = Sim::with(&["--unconfigured"]);
    let path = &*file("refused.toml");
    for (text, name, said) in [
        (axis("signal_limit = 0.5\n"), "cannot_measure", "line 7, axis 0: "),
        // One refusal hides no other.
        (
            axis("signal_limit = 0.5\nreturn_mode = 1\n"),
            "configuration",
            "line 8, axis 0: return_mode means something to thruster motors only",
        ),
        (
            axis("").replace("bus = 0", "bus = 2").replace("rmd", "d5"),
            "protocol_not_on_bus",
            "line 4, axis 0: bus 2 is not configured for d5",
        ),
        (bus.replace("bus = 0", "bus = 9"), "unknown_bus", "line 2, bus 9: there is no bus 9"),
        (axis("").replace("rmd", "thruster"), "unsupported", "line 6, axis 0: "),
        (axis("").replace("node = 1", "node = 33"), "out_of_range", "allowed are 1 to 32"),
        (
            axis("")
                .replace("bus = 0", "bus = 2")
                .replace("rmd", "thruster")
                .replace("hold", "coast"),
            "wrong_bus_kind",
            "line 3, axis 0: ",
        ),
        (axis("").replace("bus = 0", "bus = 6"), "unknown_bus", "line 3, axis 0: "),
        (axis("").replace("axis = 0", "axis = 77"), "unknown_axis", "line 2, axis 77: "),
        (axis("") + &second, "node_in_use", "line 11, axis 1: "),
        (
            axis("motor_timeout_ms = 50\n").replace("rmd", "thruster").replace("hold", "coast"),
            "out_of_range",
            "100 ms",
        ),
        (bus.replace("1_000_000", "123"), "bitrate_not_offered", "line 3, bus 0: "),
        (
            bus.replace("rmd", "d5").replace("1_000_000", "210_526"),
            "needs_own_bus",
            "line 4, bus 0: ",
        ),
        (
            bus.replace("bus = 0", "bus = 2").replace("1_000_000", "115_200"),
            "wrong_bus_kind",
            "line 4, bus 2: ",
        ),
    ] {
        // The buses that the axes are on.
        let mut rest = "[gateway]\nlink_silence_us = 300_000\n".to_owned();
        if !text.contains("[[bus]]") {
            rest += bus;
            rest += "[[bus]]\nbus = 2\nbitrate = 115_200\nprotocols = [\"rmd\"]\n";
        }
        std::fs::write(path, text.clone() + &rest).unwrap();
        let error = error(sim.mgw(&["--json", "config", "apply", path]), 1);
        assert_eq!(error["name"], name, "{text}{error}");
        let message = error["message"].as_str().unwrap();
        assert!(message.contains(said) && message.starts_with(path), "{text}{message}");
        assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"), "{text}");
    }
}

#[test]
fn a_time_that_cannot_be_is_answered_with_what_is_allowed() {
    for arguments in [
        &["set", "0", "velocity", "1", "--for", "-1"][..],
        &["set", "0", "velocity", "1", "--for", "0"],
    ] {
        let text = mgw(arguments).failure(2);
        assert!(text.contains("seconds above 0"), "{text}");
    }
    let text = mgw(&["raw", "0", "listen", "--for", "-0.5"]).failure(2);
    assert!(text.contains("seconds from 0 on"), "{text}");
}

#[test]
fn a_second_host_is_not_in_command() {
    let sim = Sim::patient();
    let first = Process::start(&["--port", &sim.port, "arm", "0"]);
    first.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    let error = error(sim.mgw_once_connected(&["--json", "set", "2", "velocity", "1"]), 1);
    assert_eq!(error["name"], "not_in_command");
    // Reading and stopping need no authority.
    sim.mgw_once_connected(&["state"]).success();
    sim.mgw_once_connected(&["stop", "0"]).success();
}

#[test]
fn options_of_a_setpoint_belong_to_its_kind() {
    let sim = Sim::start();
    for (arguments, said) in [
        (&["velocity", "1", "--stiffness", "5"][..], "--stiffness belongs to `impedance`"),
        (&["impedance", "1", "--speed-limit", "5"], "--speed-limit belongs to `position`"),
        (&["impedance", "1", "--stiffness", "5"], "--damping"),
        (&["position", "1"], "--speed-limit"),
    ] {
        let text = sim.mgw(&[&["set", "0"], arguments].concat()).failure(2);
        assert!(text.contains(said), "{arguments:?}: {text}");
    }
}

/// Who has no link hears so, and so does the simulator.
#[test]
fn when_all_links_are_taken_the_next_host_is_told_and_may_stop() {
    let sim = Sim::start();
    let watching = [(); gateway::MAX_LINKS].map(|()| {
        let watch = Process::start(&["--port", &sim.port, "watch", "0"]);
        watch.wait_for("a sample", |line| line.contains("idle").then_some(()));
        watch
    });
    let error = error(sim.mgw(&["--json", "info"]), 1);
    assert_eq!(error["name"], "links_taken");
    assert!(error["message"].as_str().unwrap().contains("all host links are taken"), "{error}");
    let refused = format!("refused: all {} host links are taken", watching.len());
    sim.process.wait_for("the refusal", |line| line.contains(&refused).then_some(()));
    // But nobody keeps others from stopping.
    assert!(sim.mgw(&["stop"]).success().contains("holding"));
}

#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let sim = Sim::start();
    let arguments = ["--port", &sim.port, "watch", "--period", "10"];
    let outcome = mgw_cut_short(&arguments, std::process::Stdio::null(), 3);
    assert_eq!((outcome.stdout.lines().count(), outcome.stderr.as_str()), (3, ""), "{outcome:?}");
}

#[test]
fn wrong_usage_is_told_as_json_where_json_is_asked_for() {
    let usage = error(mgw(&["--json", "set"]), 2);
    assert_eq!(usage["name"], "usage");
    assert!(usage["message"].as_str().unwrap().contains("<AXIS>"), "{usage}");
}

#[test]
fn an_arming_that_fails_says_nothing_of_disarming() {
    let sim = Sim::start();
    let text = sim.mgw(&["arm", "31"]).failure(1);
    assert!(text.contains("axis 31"), "{text}");
    assert!(!text.contains("disarmed"), "{text}");
}

#[test]
fn the_unsafe_clear_needs_a_motor_out_of_reach() {
    let sim = Sim::start();
    let text = sim.mgw(&["clear", "0", "--unreachable"]).failure(1);
    assert!(text.contains("axis 0"), "{text}");
    assert!(sim.mgw(&["clear", "gateway", "--unreachable"]).failure(2).contains("axis"));
}

/// Arming may free a brake, so a slip must be told before.
#[test]
fn no_setpoint_that_would_be_refused_arms_the_axis() {
    let sim = Sim::patient();
    sim.mgw_once_in_command(&["config", "axis", "0", "current_limit_a=2", "torque_limit_nm=1"])
        .success();
    for (words, name) in [
        ("0 velocity nan", "not_a_number"),
        ("0 velocity 31", "out_of_range"),
        ("0 velocity -31", "out_of_range"),
        ("0 current 2.5", "out_of_range"),
        ("0 signal 0.1", "unsupported"),
        ("0 position 1 --speed-limit 0", "speed_limit_zero"),
        ("0 position 1 --speed-limit -1", "out_of_range"),
        ("0 position 1e9 --speed-limit 1", "out_of_range"),
        ("0 impedance 50 --stiffness 1 --damping 1 --torque-limit 9", "out_of_range"),
        ("0 impedance 1 --stiffness -1 --damping 1 --torque-limit 9", "out_of_range"),
        ("0 impedance 1 --stiffness 1 --damping 6 --torque-limit 9", "out_of_range"),
        ("0 impedance 1 --stiffness 1 --damping 1 --torque 2 --torque-limit 9", "out_of_range"),
        ("0 impedance 0.5 --stiffness 20 --damping 1 --torque-limit 9", "out_of_range"),
        ("0 impedance 0.5 --stiffness 20 --damping 1", "usage"),
        ("0 impedance 0.5 --stiffness 20 --damping 1 --torque-limit -1", "usage"),
        ("1 signal 0.6", "out_of_range"),
        ("1 velocity 1", "out_of_range"),
        ("1 current 1", "unsupported"),
        ("2 position 1 --speed-limit 1", "unsupported"),
        ("3 impedance 1 --stiffness 1 --damping 1 --torque-limit 9", "unsupported"),
    ] {
        let words = words.split_whitespace().collect::<Vec<_>>();
        let outcome = sim.mgw_once_in_command(&[&["--json", "set"], words.as_slice()].concat());
        assert_eq!(outcome.stdout, "", "{words:?}");
        let code = if name == "usage" { 2 } else { 1 };
        assert_eq!(error(outcome, code)["name"], name, "{words:?}");
    }
    let impedance = |axis, target| {
        let spring = ["--stiffness", "20", "--damping", "1", "--torque-limit", "9"];
        sim.mgw(&[&["set", axis, "impedance", target, "--for", "0.1"], &spring[..]].concat())
    };
    let text = impedance("0", "0.5").failure(1);
    let wanted = "0.500 rad from its target: it is pulled with 10.00 N·m, and --torque-limit";
    assert!(text.contains(wanted), "{text}");
    let outcome = impedance("0", "0.04");
    assert!(outcome.stderr.contains("it is pulled with 0.80 N·m"), "{outcome:?}");
    outcome.success();
    let text = impedance("3", "1").failure(1);
    assert!(text.contains("axis 3 is on RS485; impedance needs CAN"), "{text}");
}

/// What another host has stopped was not done, and that is said.
#[test]
fn a_stop_by_another_host_is_told() {
    let sim = Sim::patient();
    for (arguments, states) in [
        (&["--json", "set", "0", "velocity", "2", "--for", "40"][..], &["active"][..]),
        (&["--json", "native", "0", "A2000000E8030000", "--for", "40"], &["active"]),
        (&["--json", "arm", "0", "--for", "40"], &["armed"]),
    ] {
        let outcome = sim.mgw_beside(arguments, "0", states, || {
            sim.mgw_once_connected(&["stop", "0"]).success();
        });
        let error = error(outcome, 1);
        assert_eq!(error["name"], "stopped_elsewhere", "{arguments:?}: {error}");
        assert!(
            error["message"].as_str().unwrap().starts_with("axis 0 was stopped by another host"),
            "{error}"
        );
    }
}

/// The other axes are stopped for it, and how each ended is said.
#[test]
fn each_axis_is_told_of_where_another_host_has_stopped_one() {
    let sim = Sim::patient();
    let cycle = ["cycle", "0", "velocity", "2", "2", "velocity", "2", "--rate", "50"];
    let cycle = [&["--json"], &cycle[..], &["--for", "40"]].concat();
    for (arguments, states) in
        [(&cycle[..], &["active"][..]), (&["--json", "arm", "0", "2", "--for", "40"], &["armed"])]
    {
        let outcome = sim.mgw_beside(arguments, "2", states, || {
            sim.mgw_once_connected(&["stop", "2"]).success();
        });
        let lines: Vec<Value> = outcome.stdout.lines().map(json).collect();
        let stopped = lines.iter().filter(|line| line["event"] == "stopped");
        let stopped: Vec<&Value> = stopped.map(|line| &line["axis"]).collect();
        assert_eq!(stopped, [0, 2], "{lines:?}");
        let error = error(outcome, 1);
        assert_eq!((&error["name"], &error["axis"]), (&"stopped_elsewhere".into(), &2.into()));
    }
}

#[test]
fn an_axis_that_is_not_configured_is_not_removed() {
    let sim = Sim::start();
    let error = error(sim.mgw(&["--json", "config", "remove", "9"]), 1);
    assert_eq!(error["name"], "not_configured");
    assert!(error["message"].as_str().unwrap().contains("axis 9 is not configured"), "{error}");
}

#[test]
fn a_simulation_that_others_can_reach_says_so() {
    let sim = Process::start(&["sim", "--listen", "0.0.0.0:0"]);
    sim.wait_for("the warning", |line| line.starts_with("WARNING: 0.0.0.0:").then_some(()));
}

/// Each signal that asks a process to end, while the gateway has not even answered.
#[test]
fn a_signal_before_anything_is_armed_ends_as_an_interrupt() {
    for signal in [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP, Signal::SIGQUIT] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", listener.local_addr().unwrap());
        let mut host = Process::start(&["--port", &port, "set", "0", "velocity", "2"]);
        let (mut link, _) = listener.accept().unwrap();
        // It has begun to talk, and hears nothing.
        link.read_exact(&mut [0]).unwrap();
        assert_eq!(host.signal(signal), Some(1), "{signal}");
    }
}

#[test]
fn a_stop_on_links_that_close_is_not_confirmed() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        for link in listener.incoming().flatten() {
            let mut link: TcpStream = link;
            let _ = link.read(&mut [0; 8]);
        }
    });
    for command in ["stop", "estop"] {
        let error = error(mgw(&["--json", "--port", &port, command]), 3);
        assert_eq!(error["name"], "stop_unanswered");
        assert!(error["message"].as_str().unwrap().contains("sent, not confirmed"), "{error}");
    }
}

#[test]
fn what_is_given_twice_is_refused() {
    let sim = Sim::start();
    let twice = ["config", "axis", "0", "ttl_us=100000", "ttl_us=200000"];
    let text = sim.mgw_once_in_command(&twice).failure(2);
    assert!(text.contains("ttl_us is given twice"), "{text}");
    let text = mgw(&["encode", "--protocol", "rmd", "stop", "--node", "1", "--node", "2"]);
    assert!(text.failure(2).contains("--node is given twice"));
}

#[test]
fn a_list_of_commands_takes_no_field() {
    let text = mgw(&["encode", "--protocol", "rmd", "--list", "--nosuch", "5"]).failure(2);
    assert!(text.contains("no command and no fields"), "{text}");
}

#[test]
fn what_a_tripped_axis_bars_names_the_command_that_clears_it() {
    let mut sim = Sim::patient();
    let host = Process::start(&["--port", &sim.port, "arm", "0"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    sim.typed("motor 0 faults 0x0002");
    sim.await_state("0", |state| state["state"] == "tripped" && state["stop_confirmed"] == true);
    let text = sim.once("config axis 0 ttl_us=60000").failure(1);
    assert!(text.contains("disarm or clear it first: `mgw clear 0`"), "{text}");
    let text = sim.once("arm 0").failure(1);
    assert!(text.contains("remove the cause, then clear the axis: `mgw clear 0`"), "{text}");
}

#[test]
fn where_there_is_nothing_to_stop_or_to_clear_that_is_said() {
    let said = Sim::with(&["--motor", "0:rmd:1"]).mgw(&["stop"]).success();
    assert_eq!(said, "no axis is configured: there is nothing to stop\n");
    let said = Sim::start().once("clear 0").success();
    assert_eq!(said, "axis 0 was not tripped: there was nothing to clear\n");
    let empty = Sim::with(&["--motor", "0:rmd:1"]);
    assert_eq!(empty.mgw(&["state"]).success(), "no axis is configured\n");
    // What it says to begin with is taken, in this order.
    let hint = empty.mgw(&["axes"]).success();
    let commands: Vec<&str> = hint.split('`').skip(1).step_by(2).collect();
    assert_eq!(commands.len(), 2, "{hint}");
    for command in commands {
        empty.once(command.strip_prefix("mgw ").unwrap()).success();
    }
    assert!(empty.mgw(&["axes"]).success().contains("rmd"));
}
