//! Steps as lines.

use crate::action::{Action, Ask, Does, Goal, Number, Permit, Step};
use host_protocol::parameters;
use std::fmt::Write;

/// The text of a run.
#[must_use]
pub fn write(start_us: u64, steps: &[Step]) -> String {
    let mut text = format!("start {start_us}\n");
    for step in steps {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{} {}", step.at_us, action(&step.action));
    }
    text
}

fn hex(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "none".into();
    }
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn action(action: &Action) -> String {
    match action {
        Action::Ask { link, ask } => format!("host {link} {}", asks(ask)),
        Action::Again { link, back } => format!("again {link} {back}"),
        Action::Bytes { link, bytes } => format!("bytes {link} {}", hex(bytes)),
        Action::Unread { link, for_us } => format!("unread {link} {for_us}"),
        Action::EStopInput { open } => {
            format!("e-stop-input {}", if *open { "open" } else { "closed" })
        }
        Action::Motor { motor, does } => format!("motor {motor} {}", deed(does)),
        Action::Cut { bus, for_us } => format!("cut {bus} {for_us}"),
        Action::Short { bus, for_us } => format!("short {bus} {for_us}"),
        Action::Foreign { bus, id, length, pause_us, for_us } => {
            format!("foreign {bus} {id} length {length} pause {pause_us} for {for_us}")
        }
        Action::Stray { bus, id, data } => format!("stray {bus} {id} {}", hex(data)),
        Action::Noise { bus, bytes } => format!("noise {bus} {}", hex(bytes)),
        Action::Stubborn { bus, for_us } => format!("stubborn {bus} {for_us}"),
        Action::Errors { bus, transmit, receive } => format!("errors {bus} {transmit} {receive}"),
        Action::Overflow { bus } => format!("overflow {bus}"),
        Action::StraySlot { bus, slot } => format!("stray-slot {bus} {slot}"),
        Action::ClockBack { by_us } => format!("clock-back {by_us}"),
        Action::Reset => "reset".into(),
        Action::DamagingReset { words } => format!("damaging-reset {words}"),
        Action::ResetWhileSaving { words, garbles } => {
            format!("reset-while-saving {words} {}", if *garbles { "garbled" } else { "whole" })
        }
        Action::ResetAfter { steps } => format!("reset-after {steps}"),
        Action::PowerLoss => "power-loss".into(),
    }
}

fn deed(does: &Does) -> String {
    match does {
        Does::Mute { for_us } => format!("mute {for_us}"),
        Does::Deaf { for_us } => format!("deaf {for_us}"),
        Does::Late { by_us } => format!("late {by_us}"),
        Does::Twice => "twice".into(),
        Does::Lies { data } => format!("lies {}", hex(data)),
        Does::Refuses => "refuses".into(),
        Does::Faults { word } => format!("faults {word}"),
        Does::Restarts => "restarts".into(),
        Does::Off { for_us } => format!("off {for_us}"),
        Does::Disobeys { for_us } => format!("disobeys {for_us}"),
        Does::AnswersOthers { on } => format!("answers-others {on}"),
        Does::Waits { speed } => format!("waits {speed:?}"),
        Does::Returns { mode } => format!("returns {mode}"),
        Does::Turns { speed, for_us } => format!("turns {speed:?} {for_us}"),
    }
}

fn permits(Permit { axis, epoch, lead_us }: &Permit) -> String {
    format!("{axis} epoch {epoch} lead {lead_us}")
}

fn asks(ask: &Ask) -> String {
    match ask {
        Ask::Hello => "hello".into(),
        Ask::Ping => "ping".into(),
        Ask::Take => "take".into(),
        Ask::Release => "release".into(),
        Ask::Silence { us } => format!("silence {us}"),
        Ask::Bus { bus, window_us, protocols, exclusive } => {
            let exclusive = if *exclusive { " exclusive" } else { "" };
            format!("bus {bus} window {window_us} protocols {protocols}{exclusive}")
        }
        Ask::Set { axis, parameter, value } => {
            let value = match value {
                Number::Bool(value) => format!("bool {value}"),
                Number::Unsigned(value) => format!("unsigned {value}"),
                Number::Signed(value) => format!("signed {value}"),
                Number::Float(value) => format!("float {value:?}"),
            };
            let name = parameters::name(*parameter).unwrap_or("?");
            format!("configure {axis} {parameter} {value} # {name}")
        }
        Ask::Remove { axis } => format!("remove {axis}"),
        Ask::Provision { axis, timeout_ms } => format!("provision {axis} {timeout_ms}"),
        Ask::Arm { axis } => format!("arm {axis}"),
        Ask::Disarm { axis } => format!("disarm {axis}"),
        Ask::Stop { axis } => format!("stop {axis}"),
        Ask::StopAll => "stop-all".into(),
        Ask::EStop => "e-stop".into(),
        Ask::ClearGateway => "clear-gateway".into(),
        Ask::Clear { axis } => format!("clear {axis}"),
        Ask::ClearByRestart { axis } => format!("clear-by-restart {axis}"),
        Ask::ClearUnreachable { axis } => format!("clear-unreachable {axis}"),
        Ask::OutputOff { axis } => format!("output-off {axis}"),
        Ask::Setpoint { permit, goal } => {
            let goal = match goal {
                Goal::Signal(value) => format!("signal {value:?}"),
                Goal::Current(value) => format!("current {value:?}"),
                Goal::Velocity(value) => format!("velocity {value:?}"),
                Goal::Position(value, speed) => format!("position {value:?} {speed:?}"),
                Goal::Impedance(value) => format!("impedance {value:?}"),
            };
            format!("setpoint {} {goal}", permits(permit))
        }
        Ask::Move { permit, distance, speed } => {
            format!("move {} {distance:?} {speed:?}", permits(permit))
        }
        Ask::Native { permit, data } => format!("native {} {}", permits(permit), hex(data)),
        Ask::Together { lead_us, members } => {
            let member =
                |(axis, epoch, speed): &(u8, i32, f32)| format!(" {axis} {epoch} {speed:?}");
            format!("together {lead_us}{}", members.iter().map(member).collect::<String>())
        }
        Ask::Read { axis } => format!("read {axis}"),
        Ask::Subscribe { axes, period_us } => format!("subscribe {axes} {period_us}"),
        Ask::Status => "status".into(),
        Ask::List => "list".into(),
        Ask::BusStatus { bus } => format!("bus-status {bus}"),
        Ask::Incidents { first } => format!("incidents {first}"),
        Ask::RawOpen { bus, unsafe_access: false } => format!("raw-open {bus}"),
        Ask::RawOpen { bus, unsafe_access: true } => format!("raw-open {bus} unsafe"),
        Ask::RawSend { bus, id, data } => format!("raw-send {bus} {id} {}", hex(data)),
        Ask::RawReceive { bus } => format!("raw-receive {bus}"),
        Ask::RawClose { bus } => format!("raw-close {bus}"),
    }
}
