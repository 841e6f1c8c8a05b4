//! What the bytes of the three manuals do to a motor, and what a motor's bytes tell.

mod d5;
mod lenient;
mod rmd;
mod setpoint;
mod thruster;

pub use lenient::{Deed, RMD_SERIAL_ALL};
pub use setpoint::Goal;
pub use thruster::Returns;

use std::f64::consts::PI;

/// What speaks on a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// RMD V3.6.
    Rmd,
    /// Thruster manual.
    Thruster,
    /// D5 manual.
    D5,
}

/// What a request does to the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// It moves the shaft; where `once`, each time anew.
    Motion {
        /// Sent again it would move again.
        once: bool,
    },
    /// It stops the shaft.
    Stop,
    /// A setpoint of zero, or what overwrites one: neither moves nor counts as the stop.
    Rest,
    /// It only asks.
    Read,
    /// It changes the motor.
    Change,
}

/// What a request asks, as far as it matters before motion is allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Question {
    /// To stop.
    Stop,
    /// The measured speed.
    Speed,
    /// The fault word.
    Faults,
    /// The faults since the motor started.
    Record,
    /// D5: a register of one byte.
    Register(u8),
    /// D5: a speed that waits becomes 0.
    Overwrite,
    /// RMD: what tells the dialect.
    Dialect,
}

/// A motor's own timeout, as far as it is known (G1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Timeout {
    /// Nobody knows.
    #[default]
    Unknown,
    /// It does not act, or not within [`LONGEST_TIMEOUT_MS`].
    Off,
    /// It acts.
    On,
}

/// A timeout that cannot act within this counts as off (G1).
const LONGEST_TIMEOUT_MS: u32 = 60_000;

impl Timeout {
    /// One that was set to so many milliseconds.
    fn of_ms(ms: u32) -> Self {
        if (1..=LONGEST_TIMEOUT_MS).contains(&ms) { Self::On } else { Self::Off }
    }
}

/// What a reply tells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reading {
    /// The fault word.
    pub faults: Option<u16>,
    /// Measured speed, rad/s, without sign.
    pub speed: Option<f64>,
    /// Measured current, A, without sign.
    pub current: Option<f64>,
    /// Measured position, rad, in the motor's sense of rotation.
    pub position: Option<f64>,
    /// Temperature of motor or driver, °C.
    pub temperature: Option<f64>,
    /// The brake is locked.
    pub locked: Option<bool>,
    /// D5: the low byte of the register that was read.
    pub register: Option<u8>,
    /// It acknowledges a stop, or shows that the commanded speed is zero.
    pub stops: bool,
    /// The motor refuses.
    pub refused: bool,
}

impl Protocol {
    /// The protocol with this number in the parameter table.
    pub fn of_number(number: u32) -> Option<Self> {
        match number {
            1 => Some(Self::Rmd),
            2 => Some(Self::Thruster),
            3 => Some(Self::D5),
            _ => None,
        }
    }

    /// Bytes of each of its frames on a serial line.
    pub fn serial_len(self) -> usize {
        if self == Self::D5 { 8 } else { 13 }
    }

    /// To or from which node a frame of a serial line is, and the data that it has on CAN.
    pub fn serial_frame(self, bytes: &[u8]) -> Option<(u8, [u8; 8])> {
        match self {
            Self::Rmd => rmd::serial_frame(bytes),
            Self::D5 => d5::serial_frame(bytes),
            Self::Thruster => None,
        }
    }

    /// What a frame of a serial line makes the motor do that it is to: its data.
    pub fn serial_deed(self, data: &[u8]) -> Option<Deed> {
        match self {
            Self::Rmd => lenient::rmd(data),
            Self::D5 if data.first() == Some(&0xD5) => lenient::d5(data),
            Self::Thruster | Self::D5 => None,
        }
    }

    /// The data of a CAN frame with this id and data, if it is a request to this node.
    pub fn request_to(self, node: u8, d5_id: Option<u32>, id: u32, data: &[u8]) -> Option<Vec<u8>> {
        let node_id = u32::from(node);
        match self {
            Self::Rmd if id == 0x140 + node_id => Some(data.to_vec()),
            Self::Rmd if id == 0x400 + node_id => Some(rmd::motion_mode(data)),
            Self::Thruster if id == 0x300 + node_id => Some(data.to_vec()),
            Self::D5 if id == d5_id.unwrap_or(node_id) && data.get(..2) == Some(&[0xD5, node]) => {
                Some(data.to_vec())
            }
            _ => None,
        }
    }

    /// The data of a CAN frame, if it is a reply of this node.
    pub fn reply_of(self, node: u8, d5_id: Option<u32>, id: u32, data: &[u8]) -> Option<Vec<u8>> {
        let node_id = u32::from(node);
        match self {
            Self::Rmd if id == 0x240 + node_id => Some(data.to_vec()),
            Self::Rmd if id == 0x500 + node_id && data.first() == Some(&node) => {
                Some(rmd::motion_mode(data))
            }
            Self::Thruster if id == 0x280 + node_id => Some(data.to_vec()),
            Self::D5 if d5_id.is_none_or(|wanted| wanted == id) && d5::is_from(node, data) => {
                Some(data.to_vec())
            }
            _ => None,
        }
    }

    /// The least speed that a reading can tell from none, rad/s: 1 degree a second (RMD V3.6 §2.13;
    /// D5 manual, register 0x26), 1 rpm (Thruster manual §2.1).
    pub fn speed_unit_rad_s(self) -> f64 {
        match self {
            Self::Rmd | Self::D5 => PI / 180.0,
            Self::Thruster => 2.0 * PI / 60.0,
        }
    }

    /// What a request does.
    pub fn purpose(self, data: &[u8]) -> Purpose {
        match self {
            Self::Rmd => rmd::purpose(data),
            Self::Thruster => thruster::purpose(data),
            Self::D5 => d5::purpose(data),
        }
    }

    /// What a request asks.
    pub fn question(self, data: &[u8]) -> Option<Question> {
        match self {
            _ if self.purpose(data) == Purpose::Stop => Some(Question::Stop),
            Self::Rmd => rmd::question(data),
            Self::Thruster => thruster::question(data),
            Self::D5 => d5::question(data),
        }
    }

    /// What a request that the motor carries out makes of its own timeout, if it touches it.
    pub fn timeout_touched(self, data: &[u8]) -> Option<Timeout> {
        match self {
            Self::Rmd => rmd::timeout_touched(data),
            Self::Thruster => thruster::timeout_touched(data),
            // It is read back at each arming.
            Self::D5 => None,
        }
    }

    /// What a native command is by the rules for hosts (PROTOCOL.md, Native commands): a zero is a
    /// setpoint or a stop, LS a stop, and what only prepares a D5 motor is a motion.
    pub fn asked_by_host(self, data: &[u8]) -> Purpose {
        match (self, self.purpose(data), data) {
            (Self::Thruster, _, [b'L', b'S', ..]) => Purpose::Stop,
            (Self::Thruster | Self::D5, Purpose::Stop, _) => Purpose::Rest,
            (Self::D5, Purpose::Rest, _) => Purpose::Motion { once: true },
            (_, purpose, _) => purpose,
        }
    }

    /// Whether a data field of the manual can be so long.
    pub fn has_data_fields_of(self, bytes: usize) -> bool {
        match self {
            Self::Rmd | Self::D5 => bytes == 8,
            Self::Thruster => matches!(bytes, 4 | 8),
        }
    }

    /// Whether two requests are the same command of the manual, whatever their values. Bytes that
    /// the command does not use are not sent as the host gave them.
    pub fn same_command(self, one: &[u8], other: &[u8]) -> bool {
        let command = |data: &[u8]| match self {
            Self::Rmd => data.get(..1).map(<[u8]>::to_vec),
            Self::Thruster => data.get(..2).map(<[u8]>::to_vec),
            Self::D5 => data.get(3..5).map(<[u8]>::to_vec),
        };
        command(one) == command(other)
    }

    /// Whether the motor takes long to answer: freeing and locking a brake (PROTOCOL-NOTES R20).
    pub fn is_slow(self, data: &[u8]) -> bool {
        self == Self::Rmd && matches!(data.first(), Some(0x77 | 0x78))
    }

    /// Whether a reply of the motor says that a request was for another.
    pub fn is_objection(self, reply: &[u8]) -> bool {
        self == Self::D5 && d5::is_objection(reply)
    }

    /// Whether a motor may be sent this whose axis states the dialect with this number.
    pub fn has(self, dialect: u32, data: &[u8]) -> bool {
        self != Self::Rmd || rmd::has(dialect, data)
    }

    /// RMD: the dialects whose motors answer a request so, a bit for each by its number.
    pub fn dialects(self, request: &[u8], reply: &[u8]) -> Option<u8> {
        if self == Self::Rmd { rmd::dialects(request, reply) } else { None }
    }

    /// What a reply tells as the answer to a request; `None` where it cannot be its answer.
    /// `returns`: of a thruster.
    pub fn answer(self, returns: Returns, request: &[u8], reply: &[u8]) -> Option<Reading> {
        match self {
            Self::Rmd => rmd::answer(request, reply),
            Self::Thruster => thruster::answer(returns, request, reply),
            Self::D5 => d5::answer(request, reply),
        }
    }
}
