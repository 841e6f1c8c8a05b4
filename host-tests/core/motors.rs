//! The motors of the bench: what they answer, in literal bytes.

use crate::text::{hex, unhex};
use std::cell::RefCell;
use std::rc::Rc;

/// What the played motors do.
#[derive(Debug, Clone, Default)]
pub struct Play {
    /// Answers nothing.
    pub mute: bool,
    /// Turns: 500 °/s of an RMD, 300 rpm of a thruster, 600 °/s of a D5.
    pub turning: bool,
    /// Reports a fault.
    pub fault: bool,
    /// Refuses set commands (thruster) or throws them back (RMD).
    pub refuses: bool,
    /// RMD: the number of its dialect; 0 answers as V3.6 does.
    pub dialect: u32,
}

pub type Shared = Rc<RefCell<Play>>;

/// All RMD nodes of a CAN bus, each with a holding brake, free at first.
pub fn rmd(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    let mut locked = Vec::new();
    move |now_us, _, text| {
        let play = play.borrow();
        let (id, data) = text.split_once('#')?;
        let node = u16::from_str_radix(id, 16)
            .ok()?
            .checked_sub(0x140)
            .filter(|node| (1..=32).contains(node))?;
        if play.mute {
            return None;
        }
        let speed = if play.turning { "F401" } else { "0000" };
        let reply = match data.get(..2)? {
            "9A" => {
                let free = if locked.contains(&node) { "00" } else { "01" };
                let faults = if play.fault { "02" } else { "00" };
                format!("9A3200{free}E501{faults}00")
            }
            "92" => "92000000A08C0000".into(),
            // It has run for as long as the gateway.
            "B1" => format!("B1000000{:08X}", u32::try_from(now_us / 1_000).ok()?.swap_bytes()),
            "A1" | "A2" | "A4" if play.refuses => data.into(),
            command @ ("30" | "42" | "B5") => version(play.dialect, command, data),
            command @ ("9C" | "A1" | "A2" | "A4") => format!("{command}326400{speed}6801"),
            command => {
                match command {
                    "78" => locked.push(node),
                    "77" => locked.retain(|other| *other != node),
                    _ => {}
                }
                data.into()
            }
        };
        Some(format!("{:03X}#{reply}", 0x240 + node))
    }
}

/// The answer of a motor of a dialect, by its number, to a read whose form tells it
/// (docs/rmd-dialects.md).
fn version(dialect: u32, command: &str, data: &str) -> String {
    let index = &data[2..4];
    match command {
        "30" if dialect >= 4 => format!("30{index}00000000003F"),
        "30" => "3000551955195519".into(),
        "42" if dialect >= 3 => format!("42{index}000088130000"),
        "42" => "4200000088130000".into(),
        _ if dialect == 6 => format!("{}524D442D58", &data[..6]),
        _ => "B558385332563130".into(),
    }
}

/// RMD node 1 on RS485.
pub fn rmd_serial(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    let mut motor = rmd(play);
    move |now, bus, text| {
        let (node, data) = text.strip_prefix("3E")?.get(..20)?.split_once("08")?;
        let id = 0x140 + u16::from_str_radix(node, 16).ok()?;
        let reply = motor(now, bus, &format!("{id:03X}#{data}"))?;
        let mut frame = unhex(&format!("3E{node}08{}", reply.split_once('#')?.1));
        frame.extend(crc16_modbus(&frame).to_le_bytes());
        Some(hex(&frame))
    }
}

/// CRC-16/MODBUS, bit by bit, so that the codec's table is not checked against itself.
pub fn crc16_modbus(bytes: &[u8]) -> u16 {
    let mut crc = 0xFFFF;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
        }
    }
    crc
}

/// Thruster node 0x0B.
pub fn thruster(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
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

/// D5 id 0x0B at acknowledgement level 2, its own timeout switched on at first.
pub fn d5(play: Shared) -> impl FnMut(u64, u8, &str) -> Option<String> {
    let mut timeout_switch = 1;
    move |_, _, text| {
        let play = play.borrow();
        let (arbitration_id, data) = text.split_once('#')?;
        let frame = unhex(data);
        if play.mute {
            return None;
        }
        let [_, id, length, command, register, low, high, _] = frame.try_into().ok()?;
        if (command, register) == (3, 0x11) {
            timeout_switch = low;
        }
        let (low, high) = match (command, register) {
            (2, 0x10) => (2, 0),
            (2, 0x11) => (timeout_switch, 0),
            (2, 0x12) => (if play.fault { 0x40 } else { 0 }, 0),
            (2, 0x26) if play.turning => (0x58, 0x02),
            (2, _) => (0, 0),
            _ => (low, high),
        };
        let body = [id, length, command, register, low, high];
        let sum = body.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        Some(format!("{arbitration_id}#5D{}{sum:02X}", hex(&body)))
    }
}
