//! The literal bytes of every command that the core can send, reached by what a host asks for. The
//! setpoints that the manuals print are in `motion`, the sequences of arming there too.

use crate::bench::{self, arm, clear, move_axis, setpoint, stop};
use crate::motors::Shared;
use crate::rig::{Instead, Rig};
use host_protocol::{AxisParameter, Request, Setpoint, StopAction, Value, requests};

fn read_state(rig: &mut Rig, bus: u8) -> Vec<String> {
    let since = rig.now_us;
    rig.ask(Request::ReadState(requests::ReadState { axis: 0 })).unwrap();
    rig.sent_since(bus, since).iter().map(ToString::to_string).collect()
}

fn provision(rig: &mut Rig, bus: u8, timeout_ms: u32) -> Vec<String> {
    let since = rig.now_us;
    bench::provision(rig, timeout_ms).unwrap();
    rig.sent_since(bus, since).iter().map(ToString::to_string).collect()
}

fn first_after_setpoint(rig: &mut Rig, bus: u8, value: Setpoint) -> String {
    let epoch = arm(rig);
    let since = rig.now_us;
    let request = setpoint(rig, epoch, 80_000, value);
    rig.ask(request).unwrap();
    rig.sent_since(bus, since).first().unwrap().to_string()
}

fn sent_by_stop(rig: &mut Rig, bus: u8) -> Vec<String> {
    let since = rig.now_us;
    stop(rig);
    rig.run(100_000);
    rig.sent_since(bus, since).iter().map(ToString::to_string).collect()
}

/// Trips axis 0 by a fault, takes the fault away, and clears.
fn sent_by_clear(rig: &mut Rig, play: &Shared, bus: u8, value: Setpoint) -> Vec<String> {
    move_axis(rig, value);
    play.borrow_mut().fault = true;
    rig.run(300_000);
    play.borrow_mut().fault = false;
    let since = rig.now_us;
    clear(rig).unwrap();
    rig.sent_since(bus, since).iter().map(ToString::to_string).collect()
}

#[test]
fn rmd_reads_and_timeout_on_can() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let sent = read_state(&mut rig, 0);
    assert_eq!(sent, ["141#9C00000000000000", "141#9200000000000000", "141#9A00000000000000"]);
    // RMD V3.6 §2.30.4
    // And which motor it is that keeps it: §2.29, §2.32.
    assert_eq!(
        provision(&mut rig, 0, 1_000),
        [
            "141#8000000000000000",
            "141#B3000000E8030000",
            "141#B200000000000000",
            "141#B501010000000000",
        ]
    );
}

#[test]
fn rmd_position_is_sent_as_the_manual_prints_it() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let full_turn_at_500_dps =
        Setpoint::Position { position_rad: core::f32::consts::TAU, speed_limit_rad_s: 8.726_646 };
    let sent = first_after_setpoint(&mut rig, 0, full_turn_at_500_dps);
    assert_eq!(sent, "141#A400F401A08C0000"); // RMD V3.6 §2.20.4, example 1
}

#[test]
fn rmd_brake_is_released_only_where_the_axis_says_so() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    arm(&mut rig);
    assert!(!rig.sent_since(0, 0).contains(&"141#7700000000000000"));
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    bench::parameter(&mut rig, 0, AxisParameter::ReleaseBrakeWhenArming, Value::Bool(true));
    arm(&mut rig);
    assert!(rig.sent_since(0, 0).contains(&"141#7700000000000000"));
}

#[test]
fn rmd_stop_actions_have_their_commands() {
    let (mut rig, _) = bench::rmd(StopAction::Coast);
    move_axis(&mut rig, Setpoint::Current { current_a: 1.0 });
    rig.run(1_000);
    assert_eq!(sent_by_stop(&mut rig, 0), ["141#8000000000000000", "141#8000000000000000"]);
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    move_axis(&mut rig, Setpoint::Current { current_a: 1.0 });
    rig.run(1_000);
    let sent = sent_by_stop(&mut rig, 0);
    let expected = [
        "141#8100000000000000",
        "141#8100000000000000",
        "141#9C00000000000000",
        "141#9C00000000000000",
    ];
    assert_eq!(sent.get(..4).unwrap(), expected);
}

#[test]
fn rmd_on_rs485_carries_the_same_data_with_its_checksum() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let sent = read_state(&mut rig, 2);
    // CRCs of the last two worked out with a table-free CRC-16/MODBUS outside the project.
    assert_eq!(
        sent,
        ["3E01089C00000000000000F230", "3E0108920000000000000073BC", "3E01089A00000000000000721A"]
    );
}

#[test]
fn thruster_reads_and_timeout() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    let sent = read_state(&mut rig, 0);
    let [qv, qc, qp, qt, eq, ef, qa] = [
        "30B#51560000",
        "30B#51430000",
        "30B#51500000",
        "30B#51540000",
        "30B#45510000",
        "30B#45460000",
        "30B#51410000",
    ];
    // Nothing was sent to it before: its stop comes first (`first_stop`).
    let [tc, ls] = ["30B#5443000000000000", "30B#4C53000000000000"];
    assert_eq!(sent, [tc, ls, qv, qc, qp, qt, eq, ef, qa]);
    assert_eq!(read_state(&mut rig, 0), [qv, qc, qp, qt, eq, ef, qa]);
    assert_eq!(provision(&mut rig, 0, 5_000), ["30B#5354000000001388"]); // Thruster manual §2.3
}

#[test]
fn thruster_speed_position_and_stop_of_a_position_device() {
    let (mut rig, _) = bench::thruster();
    bench::parameter(&mut rig, 0, AxisParameter::PositionDevice, Value::Bool(true));
    let slowest = Setpoint::Velocity { velocity_rad_s: core::f32::consts::PI };
    assert_eq!(first_after_setpoint(&mut rig, 0, slowest), "30B#564300000000001E"); // 30 rpm
    let stopped = sent_by_stop(&mut rig, 0);
    let tc = "30B#5443000000000000";
    let stops: Vec<_> = stopped.iter().filter(|text| !text.starts_with("30B#5643")).collect();
    assert_eq!(stops.get(..3).unwrap(), [tc, tc, "30B#4C53000000000000"]); // TC 0 twice, LS
    let turn = Setpoint::Position { position_rad: -3.139_847_3, speed_limit_rad_s: 31.415_926 };
    let sent = first_after_setpoint(&mut rig, 0, turn);
    assert_eq!(sent, "30B#4C41012CFFFFF8F9"); // 300 rpm to −179.9°
}

#[test]
fn thruster_faults_are_cleared_and_read_again() {
    let (mut rig, play) = bench::thruster();
    let sent = sent_by_clear(&mut rig, &play, 0, Setpoint::Signal { fraction: 0.1 });
    // CF, EF, QV
    assert_eq!(sent.get(..3).unwrap(), ["30B#43460000", "30B#45460000", "30B#51560000"]);
}

#[test]
fn d5_reads_and_timeout_switch() {
    let (mut rig, _) = bench::d5();
    let expected = [
        "00B#D50B050226000038",
        "00B#D50B05022800003A", // D5 manual, common commands 5
        "00B#D50B040212000023",
        "00B#D50B04022E00003F",
        "00B#D50B04022F000040",
    ];
    assert_eq!(read_state(&mut rig, 1), expected);
    let on = ["00B#D50B040311010024", "00B#D50B040211000022"];
    assert_eq!(provision(&mut rig, 1, 1), on);
    let off = ["00B#D50B040311000023", "00B#D50B040211000022"];
    assert_eq!(provision(&mut rig, 1, 0), off);
}

#[test]
fn a_write_that_waits_in_a_d5_is_overwritten_by_the_stop() {
    let (mut rig, _) = bench::d5();
    rig.instead(|text| match text {
        "00B#D50B04022C00003D" => Instead::Says("00B#5D0B04022C01003E"),
        _ => Instead::AsUsual,
    });
    move_axis(&mut rig, Setpoint::Velocity { velocity_rad_s: -10.471_976 });
    rig.run(5_000);
    // D5 manual, common commands 3: 600 °/s clockwise.
    assert!(rig.sent_since(1, 0).contains(&"00B#D50B05032058820D"));
    let sent = sent_by_stop(&mut rig, 1);
    let (stop, pending, overwrite) =
        ("00B#D50B050320000033", "00B#D50B04022C00003D", "00B#D50B050420000034");
    assert_eq!(sent.get(..4).unwrap(), [stop, stop, pending, overwrite]);
}

#[test]
fn d5_protection_is_cleared_before_the_status_is_read() {
    let (mut rig, play) = bench::d5();
    let sent = sent_by_clear(&mut rig, &play, 1, Setpoint::Velocity { velocity_rad_s: 1.0 });
    let expected = ["00B#D50B04031901002C", "00B#D50B040212000023", "00B#D50B050226000038"];
    assert_eq!(sent.get(..3).unwrap(), expected);
}
