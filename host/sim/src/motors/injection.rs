//! What a test can break in a motor.

use std::time::Duration;

use host_protocol::MAX_CAN_DATA;

/// How something outside turns a shaft: at a speed, then it holds it still, and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Turning {
    /// mrad/s.
    pub speed: i32,
    /// So long it turns the shaft.
    pub turns: Duration,
    /// So long it holds the shaft; zero: never.
    pub holds: Duration,
}

/// A fault to put into a motor, or to take out of it again. Each kind is independent of the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Injection {
    /// Its transmitter is dead: it hears and obeys, and answers nothing.
    Mute(bool),
    /// Its cable is off the bus: it hears nothing and acknowledges nothing.
    Unplugged(bool),
    /// These bits stand in its fault word; 0 takes the cause away. Whether the bits then go depends
    /// on the motor.
    FaultBits(u16),
    /// It answers later than usual by this much.
    LateReply(Duration),
    /// The data of its answers are random bytes.
    Garbage(bool),
    /// Its answers have a wrong checksum. On CAN, where the protocol has none of its own, the
    /// frame's own checksum.
    WrongChecksum(bool),
    /// Its shaft cannot turn.
    StuckRotor(bool),
    /// It answers stop commands and does not stop.
    IgnoreStop(bool),
    /// It answers commands that move and does not carry them out. An RMD answers with the command's
    /// own bytes.
    IgnoreMotion(bool),
    /// So many of its next answers get lost on the way.
    LoseReplies(u32),
    /// Its answers that begin with these bytes get lost on the way; none where there are no bytes.
    LoseAnswersLike(Beginning),
    /// It answers later than usual by a random time up to this.
    ReplyJitter(Duration),
    /// Thruster: it refuses whatever sets something, without a fault.
    Refuse(bool),
    /// RMD: when a fault goes it resumes what it did before the fault, whatever it was told
    /// meanwhile.
    ResumeAfterFault(bool),
    /// Thruster: the device has an encoder and takes position commands.
    Encoder(bool),
    /// Thruster: after its own timeout the next command, a poll too, lets it run on. The manual
    /// leaves that open.
    ResumeAfterTimeout(bool),
    /// It reads leniently: unused bytes may be anything, missing ones count as zero, no pause ends
    /// a frame on RS485, a D5 motor looks at no checksum and obeys any command to all.
    Lenient(bool),
    /// RMD: it has a holding brake, locked from when it is switched on until 0x77 (RMD V3.6 §2.27).
    Brake(bool),
    /// RMD: it hears 0x76 and does not restart.
    IgnoreRestart(bool),
    /// RMD: its brake does not open; 0x77 is echoed.
    StuckBrake(bool),
    /// D5: it hears what goes to other motors, and answers that it was not for it (D5 manual, table
    /// row 5).
    AnswersOthers(bool),
    /// D5: its register 0x2B is 1. It holds, and ignores speeds.
    BrakeOn(bool),
    /// Something outside turns its shaft, whatever the motor does.
    Turning(Option<Turning>),
    /// Its sensor of the current reads this, mA.
    Current(Option<i32>),
    /// Its winding is so hot, °C.
    MotorTemperature(Option<i16>),
    /// Its driver is so hot, °C.
    DriverTemperature(Option<i16>),
}

/// How the data of an answer begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Beginning {
    bytes: [u8; MAX_CAN_DATA],
    length: usize,
}

impl Beginning {
    /// The first bytes of an answer, at most a data field of CAN.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut beginning = Self { length: bytes.len(), ..Self::default() };
        beginning.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(beginning)
    }

    /// Whether `data` begin so.
    pub(crate) fn is_of(&self, data: &[u8]) -> bool {
        self.length > 0 && data.starts_with(&self.bytes[..self.length])
    }
}

/// The faults that are in force in one motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Injections {
    pub(crate) mute: bool,
    pub(crate) unplugged: bool,
    pub(crate) fault_bits: u16,
    pub(crate) late_reply: Duration,
    pub(crate) garbage: bool,
    pub(crate) wrong_checksum: bool,
    pub(crate) stuck_rotor: bool,
    pub(crate) ignore_stop: bool,
    pub(crate) ignore_motion: bool,
    pub(crate) lose_replies: u32,
    pub(crate) lost: Beginning,
    pub(crate) reply_jitter: Duration,
    pub(crate) refuse: bool,
    pub(crate) resume_after_fault: bool,
    pub(crate) encoder: bool,
    pub(crate) resume_after_timeout: bool,
    pub(crate) lenient: bool,
    pub(crate) ignore_restart: bool,
    pub(crate) brake: bool,
    pub(crate) stuck_brake: bool,
    pub(crate) brake_on: bool,
    pub(crate) answers_others: bool,
    pub(crate) outside: Outside,
}

/// What the world does to a shaft and its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Outside {
    pub(crate) turning: Option<Turning>,
    pub(crate) current_ma: Option<i32>,
    pub(crate) motor_c: Option<i16>,
    pub(crate) driver_c: Option<i16>,
}

impl Injections {
    pub(crate) fn apply(&mut self, injection: Injection) {
        match injection {
            Injection::Mute(on) => self.mute = on,
            Injection::Unplugged(on) => self.unplugged = on,
            Injection::FaultBits(bits) => self.fault_bits = bits,
            Injection::LateReply(delay) => self.late_reply = delay,
            Injection::Garbage(on) => self.garbage = on,
            Injection::WrongChecksum(on) => self.wrong_checksum = on,
            Injection::StuckRotor(on) => self.stuck_rotor = on,
            Injection::IgnoreStop(on) => self.ignore_stop = on,
            Injection::IgnoreMotion(on) => self.ignore_motion = on,
            Injection::LoseReplies(count) => self.lose_replies = count,
            Injection::LoseAnswersLike(beginning) => self.lost = beginning,
            Injection::ReplyJitter(most) => self.reply_jitter = most,
            Injection::Refuse(on) => self.refuse = on,
            Injection::ResumeAfterFault(on) => self.resume_after_fault = on,
            Injection::Encoder(on) => self.encoder = on,
            Injection::ResumeAfterTimeout(on) => self.resume_after_timeout = on,
            Injection::Lenient(on) => self.lenient = on,
            Injection::IgnoreRestart(on) => self.ignore_restart = on,
            Injection::Brake(on) => self.brake = on,
            Injection::StuckBrake(on) => self.stuck_brake = on,
            Injection::BrakeOn(on) => self.brake_on = on,
            Injection::AnswersOthers(on) => self.answers_others = on,
            Injection::Turning(turning) => self.outside.turning = turning,
            Injection::Current(ma) => self.outside.current_ma = ma,
            Injection::MotorTemperature(celsius) => self.outside.motor_c = celsius,
            Injection::DriverTemperature(celsius) => self.outside.driver_c = celsius,
        }
    }
}
