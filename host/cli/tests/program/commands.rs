//! Every command against a simulated gateway.

use crate::support::{FOUR, Process, Sim, mgw, mgw_reading};

#[test]
fn info_tells_board_and_buses() {
    let sim = Sim::start();
    let text = sim.mgw(&["info"]).success();
    assert!(text.contains("simulated") && text.contains("RS485"), "{text}");
    let json = sim.mgw(&["--json", "info"]).json_lines();
    assert_eq!(json.len(), 1);
    assert_eq!(json[0]["board"], "simulated");
    assert_eq!(json[0]["protocol_major"], 1);
    assert_eq!(json[0]["buses"].as_array().unwrap().len(), 4);
}

#[test]
fn info_tells_who_commands_and_whether_the_e_stop_is_latched() {
    let sim = Sim::start();
    let status = &sim.mgw(&["--json", "info"]).json_lines()[0]["status"];
    assert_eq!(status["e_stop_latched"], false);
    assert_eq!(status["e_stop_input_open"], false);
    assert_eq!(status["enable_output"], true);
    assert!(status["holder"].is_null());
    sim.mgw(&["estop"]).success();
    assert_eq!(sim.mgw(&["--json", "info"]).json_lines()[0]["status"]["e_stop_latched"], true);
    assert!(sim.mgw(&["info"]).success().contains("e-stop    latched, input closed"));
}

#[test]
fn trips_lists_what_happened_from_the_latest() {
    let sim = Sim::patient();
    let before = &sim.mgw(&["--json", "trips"]).json_lines()[0];
    assert_eq!(before["crash_report"], "");
    assert_eq!(before["incidents"][0]["boot"], "simulated");
    assert!(before["incidents"][1].is_null());
    let mut host = Process::start(&["--port", &sim.port, "arm", "0"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    sim.mgw(&["estop"]).success();
    let after = &sim.mgw(&["--json", "trips"]).json_lines()[0]["incidents"];
    assert_eq!(after[0]["axis"], 0);
    assert_eq!(after[0]["trip"]["reason"], "e_stop");
    assert_eq!(after[1], before["incidents"][0]);
    let text = sim.mgw(&["trips"]).success();
    assert!(
        text.contains("axis 0 tripped: emergency stop") && text.contains("started: simulated"),
        "{text}"
    );
    host.interrupt();
}

#[test]
fn axes_lists_the_four_that_sim_configures() {
    let sim = Sim::start();
    let json = &sim.mgw(&["axes", "--json"]).json_lines()[0];
    let axes = json["axes"].as_array().unwrap();
    let protocols: Vec<_> = axes.iter().map(|axis| axis["protocol"].as_str().unwrap()).collect();
    assert_eq!(protocols, ["rmd", "thruster", "d5", "rmd"]);
    assert!(axes.iter().all(|axis| axis["state"] == "idle" && axis["missing"].is_null()), "{json}");
    assert!(sim.mgw(&["axes"]).success().contains("thruster"));
}

#[test]
fn an_unconfigured_gateway_is_configured_by_hand() {
    let sim = Sim::with(&["--unconfigured"]);
    assert!(sim.mgw(&["axes"]).success().contains("no axis is configured"));
    sim.mgw(&["config", "bus", "0", "bitrate=1000000", "protocols=rmd,thruster"]).success();
    sim.half_configure(0, "bus = 0\nprotocol = \"rmd\"\nnode = 1\n");
    let axes = &sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"];
    assert_eq!(
        (&axes[0]["state"], &axes[0]["missing"]),
        (&"unconfigured".into(), &"stop_action".into())
    );
    sim.mgw(&["config", "axis", "0", "stop_action=hold", "velocity_limit_rad_s=12.5"]).success();
    sim.mgw(&["config", "gateway", "link_silence_us=300000"]).success();
    assert!(sim.mgw(&["config", "timeout", "0", "300"]).success().contains("300 ms"));
    let shown = &sim.mgw(&["--json", "config", "show", "0"]).json_lines()[0]["parameters"];
    assert_eq!(shown["protocol"], "rmd");
    assert_eq!(shown["velocity_limit_rad_s"], 12.5);
    assert_eq!(shown["ttl_us"], 100_000);
    assert!(shown["current_limit_a"].is_null());
    assert!(sim.mgw(&["config", "show", "0"]).success().contains("stop_action"));
    let bus = &sim.mgw(&["--json", "bus", "0"]).json_lines()[0]["buses"][0];
    assert_eq!(bus["config"]["bitrate_bit_s"], 1_000_000);
    assert_eq!(bus["config"]["protocols"], serde_json::json!(["rmd", "thruster"]));
    sim.mgw(&["config", "remove", "0"]).success();
    assert_eq!(sim.mgw(&["--json", "axes"]).json_lines()[0]["axes"], serde_json::json!([]));
}

#[test]
fn a_file_configures_everything_at_once() {
    let sim = Sim::with(&["--unconfigured"]);
    let text = sim.mgw(&["config", "apply", FOUR]).success();
    assert_eq!(text, "configured: 3 buses and 4 axes; 24 changes, 3 motor timeouts written\n");
    let json = &sim.mgw(&["axes", "--json"]).json_lines()[0];
    assert!(json["axes"].as_array().unwrap().iter().all(|axis| axis["state"] == "idle"), "{json}");
}

#[test]
fn a_d5_listens_on_an_id_of_29_bits() {
    let sim = Sim::with(&["--d5-id", "extended:0x12345678"]);
    // As long as a busy machine needs.
    sim.mgw(&["config", "gateway", "link_silence_us=10000000"]).success();
    sim.mgw_once_in_command(&["config", "axis", "2", "ttl_us=10000000"]).success();
    let text = sim.mgw_once_in_command(&["set", "2", "velocity", "2", "--for", "0.5"]).success();
    assert!(text.contains("axis 2 is armed"), "{text}");
    let shown = &sim.mgw(&["--json", "config", "show", "2"]).json_lines()[0]["parameters"];
    assert_eq!(shown["d5_request_id"], "extended:0x12345678");
    // Where it does not listen it does not answer.
    sim.mgw_once_at_rest(&["config", "axis", "2", "d5_request_id=0x678"]).success();
    sim.mgw_once_in_command(&["arm", "2"]).failure(1);
    let refused = sim.mgw(&["config", "axis", "2", "d5_request_id=extended:0x20000000"]).failure(2);
    assert!(
        refused.contains("It takes 0 to 0x7FF, or extended:0 to extended:0x1FFFFFFF"),
        "{refused}"
    );
    // The standard id of the motor's node is another than the extended one of that number.
    sim.once(
        "config axis 4 bus=1 protocol=d5 node=12 stop_action=hold \
         d5_request_id=extended:0x12345678",
    )
    .success();
    let refused = sim.once("config axis 2 d5_request_id=extended:0x12345678").failure(1);
    assert!(
        refused.contains("axis 2 would be sent frames on CAN id extended:0x12345678"),
        "{refused}"
    );
    assert!(refused.contains("axis 4"), "{refused}");
}

#[test]
fn arm_holds_and_disarms() {
    let sim = Sim::patient();
    let text = sim.mgw(&["arm", "0", "2", "--for", "0.5"]).success();
    assert!(text.contains("axis 0 is armed") && text.contains("axis 2 is armed"), "{text}");
    assert!(text.ends_with("disarmed\n"), "{text}");
    assert_eq!(sim.await_state("0", |_| true)["state"], "holding");
    sim.mgw(&["--json", "arm", "3", "--for", "0.2"]).json_lines();
}

#[test]
fn a_holding_motor_is_shown_and_lets_go_on_request() {
    let sim = Sim::patient();
    let idle = sim.mgw(&["output-off", "0"]).failure(1);
    assert!(
        idle.contains("axis 0 is idle; only the output of a holding motor can be switched off"),
        "{idle}"
    );
    sim.mgw(&["arm", "0", "2", "--for", "0.2"]).success();
    for command in ["axes", "state"] {
        let text = sim.mgw(&[command]).success();
        assert_eq!(text.matches("holding").count(), 2, "{text}");
    }
    assert_eq!(
        sim.mgw(&["output-off", "0"]).success(),
        "axis 0 is idle, its motor's output is off\n"
    );
    assert_eq!(sim.await_state("0", |_| true)["state"], "idle");
    let d5 = sim.mgw(&["output-off", "2"]).failure(1);
    assert!(d5.contains("d5"), "{d5}");
}

#[test]
fn set_moves_each_axis_and_stops_it() {
    let sim = Sim::patient();
    let cases: [(&[&str], &str); 5] = [
        (&["set", "0", "velocity", "2"], "velocity_rad_s"),
        (
            &[
                "set",
                "0",
                "impedance",
                "-3",
                "--stiffness",
                "5",
                "--damping",
                "0.5",
                "--torque",
                "-1",
                "--torque-limit",
                "40",
            ],
            "velocity_rad_s",
        ),
        (&["set", "1", "signal", "-0.05"], "velocity_rad_s"),
        (&["set", "2", "velocity", "-3"], "velocity_rad_s"),
        (&["set", "3", "position", "5", "--speed-limit", "2"], "velocity_rad_s"),
    ];
    for (arguments, measured) in cases {
        let lines = sim.mgw(&[&["--json"], arguments, &["--for", "1"]].concat()).json_lines();
        let moved = lines
            .iter()
            .any(|line| line[measured]["value"].as_f64().is_some_and(|value| value.abs() > 0.5));
        assert!(moved, "{arguments:?}: {lines:?}");
        assert!(
            lines.iter().any(|line| line["event"] == "stop_confirmed"),
            "{arguments:?}: {lines:?}"
        );
        // The thruster coasts; the others are stopped by `hold`.
        let rest = if arguments[1] == "1" { "idle" } else { "holding" };
        assert_eq!(lines.last().unwrap()["state"], rest, "{arguments:?}");
    }
    let text = sim.mgw(&["set", "0", "current", "0.2", "--for", "0.5"]).success();
    assert!(text.contains("velocity rad/s") && text.contains("axis 0 is holding"), "{text}");
}

#[test]
fn ctrl_c_stops_and_disarms_first() {
    let sim = Sim::patient();
    for arguments in [&["arm", "0"][..], &["set", "0", "velocity", "2"]] {
        let mut host = Process::start(&[&["--port", &sim.port], arguments].concat());
        host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
        assert_eq!(host.interrupt(), Some(0), "{arguments:?}");
        assert_eq!(sim.await_state("0", |_| true)["state"], "holding", "{arguments:?}");
    }
}

#[test]
fn state_and_stop_and_bus_print_tables() {
    let sim = Sim::start();
    let text = sim.mgw(&["state"]).success();
    assert_eq!(text.lines().count(), 5, "{text}");
    assert!(text.contains("velocity rad/s"), "{text}");
    let json = &sim.mgw(&["state", "1", "--json"]).json_lines()[0];
    assert_eq!(json["axes"][0]["axis"], 1);
    assert!(sim.mgw(&["stop"]).success().contains("holding"));
    sim.mgw(&["stop", "0", "--json"]).json_lines();
    let text = sim.mgw(&["bus"]).success();
    assert!(
        text.contains("rmd, thruster") && text.contains("210526") && text.contains("115200"),
        "{text}"
    );
}

#[test]
fn an_axis_that_was_never_armed_makes_no_stop_fail() {
    let sim = Sim::patient();
    sim.half_configure(5, "bus = 0\nprotocol = \"rmd\"\nnode = 5\n");
    let mut host = Process::start(&["--port", &sim.port, "set", "0", "velocity", "2"]);
    host.wait_for("the arming", |line| line.contains("is armed").then_some(()));
    for command in ["stop", "estop"] {
        let text = sim.mgw(&[command]).success();
        let axis = "axis 5: nothing to stop, it was never armed: stop_action is not set";
        assert!(text.contains(axis) && text.contains("holding"), "{text}");
        let axes = &sim.mgw(&["--json", command]).json_lines().pop().unwrap()["axes"];
        let told: Vec<_> = axes.as_array().unwrap().iter().map(|axis| &axis["stop"]).collect();
        assert_eq!(
            told,
            ["confirmed", "confirmed", "confirmed", "confirmed", "not_configured"],
            "{axes}"
        );
        assert_eq!((&axes[4]["axis"], &axes[4]["missing"]), (&5.into(), &"stop_action".into()));
    }
    let text = sim.mgw(&["stop", "5"]).success();
    assert!(
        text.contains("axis 5: nothing to stop, it was never armed: stop_action is not set"),
        "{text}"
    );
    assert!(sim.mgw(&["stop", "6"]).failure(1).contains("axis 6"));
    let text = sim.mgw(&["state"]).success();
    assert!(
        text.contains("holding")
            && text.contains("axis 5 is not configured: it has no stop_action"),
        "{text}"
    );
    host.interrupt();
}

#[test]
fn a_stop_that_is_not_confirmed_is_told_beside_those_that_are() {
    let sim = Sim::with(&["--unconfigured"]);
    sim.mgw(&["config", "bus", "0", "bitrate=1000000", "protocols=rmd,thruster"]).success();
    // Node 9 is not there.
    for (axis, node) in [("0", "node=9"), ("1", "node=1")] {
        sim.mgw(&["config", "axis", axis, "bus=0", "protocol=rmd", node, "stop_action=hold"])
            .success();
    }
    let outcome = sim.mgw(&["--json", "stop"]);
    let line: serde_json::Value = serde_json::from_str(outcome.stdout.trim()).unwrap();
    assert_eq!(
        (&line["axes"][0]["stop"], &line["axes"][1]["stop"]),
        (&"not_confirmed".into(), &"confirmed".into())
    );
    assert!(outcome.failure(3).contains("stop_not_confirmed"));
}

#[test]
fn an_emergency_stop_latches_until_it_is_cleared() {
    let sim = Sim::patient();
    assert!(sim.mgw(&["estop"]).success().contains("latched"));
    let text = sim.mgw(&["set", "0", "velocity", "1"]).failure(1);
    assert!(
        text.contains("e-stop") || text.contains("e_stop") || text.contains("emergency"),
        "{text}"
    );
    sim.mgw(&["clear", "gateway"]).success();
    for axis in ["0", "1", "2", "3"] {
        // Only axes that tripped with it have something to clear.
        let state = sim.await_state(axis, |_| true);
        if state["trip"] != serde_json::Value::Null {
            sim.mgw(&["clear", axis]).success();
        }
    }
    sim.mgw(&["set", "0", "velocity", "1", "--for", "0.3"]).success();
}

#[test]
fn raw_frames_go_out_and_answers_come_back() {
    let sim = Sim::patient();
    let text = sim.mgw(&["raw", "0", "send", "141#9A00000000000000"]).success();
    assert!(text.starts_with("(00000000") && text.contains(") can0 241#9A"), "{text}");
    let decoded = mgw_reading(&["decode"], text).success();
    assert!(decoded.contains("read_status_1") && decoded.contains("voltage_v=48"), "{decoded}");
    let lines = sim.mgw(&["--json", "raw", "0", "send", "30B#51560000"]).json_lines();
    assert!(lines.iter().all(|line| line["bus"] == 0), "{lines:?}");
    // RMD V3.6 §2.13 over RS485, whose bytes may come in pieces.
    let lines =
        sim.mgw(&["--json", "raw", "2", "send-hex", "3E01089C00000000000000F230"]).json_lines();
    let received: String = lines.iter().filter_map(|line| line["frame"].as_str()).collect();
    assert!(received.starts_with("3E01089C"), "{lines:?}");
    let text = sim.mgw(&["raw", "2", "send-hex", "3E01089C00000000000000F230"]).success();
    let decoded = mgw_reading(&["--json", "decode"], text).decoded();
    assert_eq!(
        (&decoded[0]["command"], &decoded[0]["interface"]),
        (&"read_status_2".into(), &"serial2".into())
    );
    sim.mgw(&["raw", "1", "listen", "--for", "0.1"]).success();
    // Unsafe access needs a bus without axes, and the other one only passes what reads.
    let text = sim.mgw(&["raw", "--unsafe", "0", "send", "141#A200000010270000"]).failure(1);
    assert!(text.contains("axis 0 is configured on bus 0"), "{text}");
    let text = sim.mgw(&["raw", "0", "send", "142#A200000010270000"]).failure(1);
    assert!(text.contains("may do more than read a motor"), "{text}");
    // The bus is closed again: arming works.
    sim.mgw(&["arm", "0", "--for", "0.1"]).success();
}

#[test]
fn the_port_may_come_from_the_environment() {
    let sim = Sim::start();
    let program = std::process::Command::new(env!("CARGO_BIN_EXE_mgw"))
        .args(["--json", "info"])
        .env("MGW_PORT", &sim.port)
        .output()
        .unwrap();
    assert!(program.status.success(), "{program:?}");
}

#[test]
fn help_shows_examples() {
    let text = mgw(&["--help"]).success();
    assert!(text.contains("Examples:") && text.contains("mgw sim"), "{text}");
    for command in
        ["sim", "config", "arm", "set", "move", "native", "stop", "clear", "watch", "raw"]
    {
        let text = mgw(&[command, "--help"]).success();
        assert!(text.contains("Examples:") && text.contains(&format!("mgw {command}")), "{text}");
    }
}
