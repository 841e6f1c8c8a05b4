//! A rig with one configured motor, and the motors' literal replies.

use crate::rig::Rig;
use host_protocol::{
    AxisParameter, Protocol, ProtocolSet, Reply, Request, Setpoint, StopAction, Value, replies, requests,
};
use std::cell::RefCell;
use std::rc::Rc;

/// What the played motor does.
#[derive(Debug, Clone)]
pub struct Play {
    /// Answers nothing.
    pub mute: bool,
    /// Speed that it reports, in the protocol's own bytes of the speed reply.
    pub turning: bool,
    /// Reports a fault.
    pub fault: bool,
    /// Refuses set commands (thruster) or throws them back (RMD).
    pub refuses: bool,
}

pub type Shared = Rc<RefCell<Play>>;

fn play() -> Shared {
    Rc::new(RefCell::new(Play { mute: false, turning: false, fault: false, refuses: false }))
}

pub fn configure_bus(rig: &mut Rig, bus: u8, bitrate: u32, protocols: &[Protocol]) {
    let request = requests::ConfigureBus {
        bus,
        bitrate,
        protocols: ProtocolSet::of(protocols),
        wholly_ours: false,
        reply_window_us: 5_000,
    };
    rig.ask(Request::ConfigureBus(request)).unwrap();
}

pub fn parameter(rig: &mut Rig, axis: u8, parameter: AxisParameter, value: Value) {
    let request = requests::ConfigureAxis { axis, parameter: parameter.number(), value };
    rig.ask(Request::ConfigureAxis(request)).unwrap();
}

/// Axis 0 on a bus, motor timeouts not asked for.
pub fn configure_axis(rig: &mut Rig, bus: u8, protocol: Protocol, node: u8, stop: StopAction) {
    let unsigned = |number: u8| Value::Unsigned(u32::from(number));
    parameter(rig, 0, AxisParameter::Bus, unsigned(bus));
    parameter(rig, 0, AxisParameter::Protocol, unsigned(protocol.number()));
    parameter(rig, 0, AxisParameter::Node, unsigned(node));
    parameter(rig, 0, AxisParameter::StopAction, unsigned(stop.number()));
    parameter(rig, 0, AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true));
}

/// RMD node 1 on CAN bus 0.
pub fn rmd(stop: StopAction) -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(rmd_motor(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd, Protocol::Thruster]);
    configure_axis(&mut rig, 0, Protocol::Rmd, 1, stop);
    (rig, play)
}

/// Thruster node 0x0B on CAN bus 0.
pub fn thruster() -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(thruster_motor(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 0, 500_000, &[Protocol::Thruster]);
    configure_axis(&mut rig, 0, Protocol::Thruster, 0x0B, StopAction::Coast);
    (rig, play)
}

/// D5 id 0x0B on CAN bus 1.
pub fn d5() -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    rig.motor = Box::new(d5_motor(play.clone()));
    hello(&mut rig);
    configure_bus(&mut rig, 1, 210_526, &[Protocol::D5]);
    configure_axis(&mut rig, 1, Protocol::D5, 0x0B, StopAction::Hold);
    (rig, play)
}

/// RMD node 1 on RS485 bus 2.
pub fn rmd_serial() -> (Rig, Shared) {
    let (mut rig, play) = (Rig::new(), play());
    let mut motor = rmd_motor(play.clone());
    rig.motor = Box::new(move |now, bus, text| {
        let data = text.strip_prefix("3E0108")?.get(..16)?;
        let reply = motor(now, bus, &format!("141#{data}"))?;
        let mut frame = crate::rig::unhex(&format!("3E0108{}", reply.strip_prefix("241#")?));
        let crc = crc16_modbus(&frame);
        frame.extend(crc.to_le_bytes());
        Some(crate::rig::hex(&frame))
    });
    hello(&mut rig);
    configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    configure_axis(&mut rig, 2, Protocol::Rmd, 1, StopAction::Hold);
    (rig, play)
}

/// CRC-16/MODBUS, bit by bit, so that the codec's table is not checked against itself.
fn crc16_modbus(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
        }
    }
    crc
}

fn rmd_motor(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    move |_, _, text| {
        let play = play.borrow();
        let data = text.strip_prefix("141#")?;
        if play.mute {
            return None;
        }
        let speed = if play.turning { "F401" } else { "0000" };
        Some(match data.get(..2)? {
            "9A" => format!("241#9A320001E501{}00", if play.fault { "02" } else { "00" }),
            "92" => "241#92000000A08C0000".into(),
            "A1" | "A2" | "A4" if play.refuses => format!("241#{data}"),
            command @ ("9C" | "A1" | "A2" | "A4") => format!("241#{command}326400{speed}2D00"),
            _ => format!("241#{data}"),
        })
    }
}

fn thruster_motor(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    move |_, _, text| {
        let play = play.borrow();
        let data = text.strip_prefix("30B#")?;
        if play.mute {
            return None;
        }
        Some(match data.get(..4)? {
            "5443" | "5643" if play.refuses => format!("28B#{}0000EEEE", data.get(..8)?),
            "5156" if play.turning => "28B#515600000000012C".into(),
            "4546" if play.fault => "28B#4546000000000040".into(),
            _ if data.len() == 8 => format!("28B#{data}00000000"),
            _ => format!("28B#{data}"),
        })
    }
}

fn d5_motor(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    move |_, _, text| {
        let play = play.borrow();
        let frame = crate::rig::unhex(text.strip_prefix("00B#")?);
        if play.mute {
            return None;
        }
        let [_, id, length, command, register, low, high, _] = frame.try_into().ok()?;
        let (low, high) = match (command, register) {
            (2, 0x10) => (2, 0),
            (2, 0x11) => (1, 0),
            (2, 0x12) => (if play.fault { 0x40 } else { 0 }, 0),
            (2, 0x26) if play.turning => (0x58, 0x02),
            (2, _) => (0, 0),
            _ => (low, high),
        };
        let body = [id, length, command, register, low, high];
        let sum = body.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        Some(format!("00B#5D{}{sum:02X}", crate::rig::hex(&body)))
    }
}

pub fn hello(rig: &mut Rig) {
    rig.ask(Request::Hello(requests::Hello { protocol_major: 1, protocol_minor: 0, session: 7 })).unwrap();
}

pub fn arm(rig: &mut Rig) -> u32 {
    match rig.ask(Request::Arm(requests::Arm { axis: 0 })) {
        Ok(Reply::Arm(replies::Armed { epoch, .. })) => epoch,
        other => panic!("arming was answered {other:?}"),
    }
}

/// A setpoint that lives `ttl_us` from now.
pub fn setpoint(rig: &Rig, epoch: u32, ttl_us: u64, setpoint: Setpoint) -> Request {
    let expires_at_us = (rig.now() + gateway::Duration::from_micros(ttl_us)).low_bits();
    Request::Setpoint(requests::Setpoint { axis: 0, epoch, expires_at_us, setpoint })
}

/// Arms axis 0 and sets it in motion for 80 ms.
pub fn move_axis(rig: &mut Rig, value: Setpoint) -> u32 {
    let epoch = arm(rig);
    let request = setpoint(rig, epoch, 80_000, value);
    rig.ask(request).unwrap();
    epoch
}
