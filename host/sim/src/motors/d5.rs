//! A simulated D5 motor (D5 manual), on CAN or on a serial line.

use std::f64::consts::TAU;
use std::time::Duration;

use d5::{
    Access, AckLevel, Address, Celsius, DecodeError, Degrees, DegreesPerSecond, FRAME_LEN, Faults,
    MotorError, Node, REGISTERS, REQUEST_HEADER, Register, Reply, Request, TurnDegrees, Value,
    Width, decode_speed, encode_angle, encode_speed, encode_temperature,
};
use embedded_can::Frame;
use host_protocol::{CanFrame, CanId};

use super::counts::{to_i8, to_i16, to_i32, to_u16};
use super::dynamics::{Characteristics, Drive, Plant};
use super::lenient;
use super::model::{Context, Model};
use super::stall::StallGuard;
use super::watch::Watch;
use crate::bus::{Wire, bit_time};

/// Time from a request to its answer.
const REPLY_MIN: Duration = Duration::from_micros(300);
const REPLY_MAX: Duration = Duration::from_micros(500);
/// The communication timeout, which the manual does not give.
const TIMEOUT: Duration = Duration::from_secs(1);
/// A pause of this many bits ends a frame begun on a serial line.
const FRAME_GAP_BITS: u64 = 35;
/// What the table calls 360/S²: one count of registers 0x15 and 0x16 in rad/s².
const ACCELERATION_UNIT: f64 = TAU;
/// Counts of those registers that the motor accepts; it uses the nearest for any other.
const ACCELERATION_RANGE: std::ops::RangeInclusive<u8> = 72..=250;

/// A small wheel motor, on 24 V.
const CHARACTERISTICS: Characteristics = Characteristics {
    max_speed_rad_s: 40.0,
    max_current_a: 10.0,
    speed_per_ampere: 8.0,
    mechanical_s: 0.1,
    speed_loop_s: 0.03,
    position_gain: 0.0,
    supply_v: 24.0,
    supply_ohm: 0.1,
    thermal_s: 90.0,
    warming_per_a2: 0.8,
    ambient_c: 25.0,
};

/// Faults that only a write to 0x19 clears (D5 manual, register 0x19).
const LATCHED: Faults = Faults::STALL.union(Faults::OVER_CURRENT);

/// How the motor is connected.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
#[derive(Clone)]
pub(super) enum Interface {
    Can,
    /// The bytes of the frame begun, when the last came, and the pause that ends it.
    Serial {
        begun: Vec<u8>,
        last_byte: Duration,
        gap: Duration,
    },
}

impl Interface {
    pub(super) fn serial(baud: u32) -> Self {
        let gap = bit_time(FRAME_GAP_BITS, baud);
        Self::Serial { begun: Vec::new(), last_byte: Duration::ZERO, gap }
    }

    /// Takes the next byte of a line; the frame that it completes, whatever its checksum. A lenient
    /// motor knows no pauses.
    fn push(&mut self, now: Duration, lenient: bool, byte: u8) -> Option<[u8; FRAME_LEN]> {
        let Self::Serial { begun, last_byte, gap } = self else { return None };
        if now.saturating_sub(*last_byte) > *gap && !lenient {
            begun.clear();
        }
        *last_byte = now;
        begun.push(byte);
        let frame = <[u8; FRAME_LEN]>::try_from(begun.as_slice()).ok();
        // A lenient one may have begun to listen anywhere.
        let used =
            if frame.is_some() && !lenient { FRAME_LEN } else { usize::from(frame.is_some()) };
        begun.drain(..used);
        let begins = begun.iter().position(|byte| *byte == REQUEST_HEADER);
        begun.drain(..begins.unwrap_or(begun.len()));
        frame
    }
}

/// The motor's firmware: a register file, and what writing to it does.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct D5 {
    interface: Interface,
    /// Requests are heard, and answers sent, under this CAN id.
    can_id: CanId,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::d5_node"))]
    node: Node,
    plant: Plant,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::d5_registers"))]
    registers: [u8; 256],
    /// The one asynchronous write that can wait.
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::d5_write"))]
    waiting: Option<(Register, Value)>,
    last_command: u8,
    watch: Watch,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::d5_faults"))]
    faults: Faults,
    stall: StallGuard,
}

impl D5 {
    /// `can_id`: where it is not the node.
    pub(super) fn new(node: Node, can_id: Option<CanId>, interface: Interface) -> Self {
        let mut motor = Self {
            interface,
            can_id: can_id.unwrap_or_else(|| CanId(d5::can::default_request_id(node).into())),
            node,
            plant: Plant::new(CHARACTERISTICS),
            registers: [0; 256],
            waiting: None,
            last_command: 0,
            watch: Watch::default(),
            faults: Faults::empty(),
            stall: StallGuard::default(),
        };
        motor.load_defaults(node);
        motor
    }

    fn load_defaults(&mut self, node: Node) {
        self.registers = [0; 256];
        for info in &REGISTERS {
            match (info.width, info.default) {
                (Width::Byte, Some(default)) => {
                    self.store(info.register, Value::Byte(low(default)))
                }
                (Width::Word, Some(default)) => self.store(info.register, Value::Word(default)),
                (_, None) => {}
            }
        }
        self.take_id(node);
        self.store(Register::ID, Value::Byte(node.get()));
    }

    /// Its answer to that comes from the new id already (PROTOCOL-NOTES D11). That its CAN id is
    /// that number, and goes with it, is an assumption (D14); one that it was wired with
    /// otherwise stays.
    fn take_id(&mut self, node: Node) {
        let can_id = |node| CanId(d5::can::default_request_id(node).into());
        if self.can_id == can_id(self.node) {
            self.can_id = can_id(node);
        }
        self.node = node;
    }

    fn byte(&self, Register(address): Register) -> u8 {
        self.registers[usize::from(address)]
    }

    fn value(&self, register: Register, width: Width) -> Value {
        let next = Register(register.0.wrapping_add(1));
        match width {
            Width::Byte => Value::Byte(self.byte(register)),
            Width::Word => Value::Word(u16::from_le_bytes([self.byte(register), self.byte(next)])),
        }
    }

    fn store(&mut self, Register(address): Register, value: Value) {
        match value {
            Value::Byte(byte) => self.registers[usize::from(address)] = byte,
            Value::Word(word) => {
                let [low, high] = word.to_le_bytes();
                self.registers[usize::from(address)] = low;
                self.registers[usize::from(address.wrapping_add(1))] = high;
            }
        }
    }

    /// Writes what the motor measures into its registers.
    fn measure(&mut self, brake: bool) {
        let plant = &self.plant;
        let speed = DegreesPerSecond(to_i16(plant.speed_rad_s().to_degrees()));
        let degrees = plant.position_rad().to_degrees();
        // The angle starts again after 65536°; −32768 has no place in the manual's range.
        let [low, high, _, _] = to_i32(degrees).to_le_bytes();
        let angle = Degrees(i16::from_le_bytes([low, high]).max(-i16::MAX));
        let celsius =
            |value| encode_temperature(Celsius(to_i8(value).max(-i8::MAX))).unwrap_or_default();
        let values = [
            (Register::CURRENT_SPEED, Value::Word(encode_speed(speed).unwrap_or_default())),
            (Register::TRAVELLED_ANGLE, Value::Word(encode_angle(angle).unwrap_or_default())),
            (Register::MAGNETIC_ANGLE, Value::Word(to_u16(degrees.rem_euclid(360.0)))),
            (Register::RUNNING, Value::Byte(u8::from(plant.drive() != Drive::Off))),
            (Register::ASYNC_FLAG, Value::Byte(u8::from(self.waiting.is_some()))),
            (Register::BOARD_TEMPERATURE, Value::Byte(celsius(plant.driver_c()))),
            (Register::MOTOR_TEMPERATURE, Value::Byte(celsius(plant.motor_c()))),
            (Register::STATUS, Value::Byte(self.faults.bits())),
            (Register::BRAKE, Value::Byte(u8::from(brake))),
            (Register::CURRENT_COMMAND, Value::Byte(self.last_command)),
        ];
        for (register, value) in values {
            self.store(register, value);
        }
    }

    fn set_speed(&self) -> DegreesPerSecond {
        match self.value(Register::SPEED, Width::Word) {
            Value::Word(word) => decode_speed(word),
            Value::Byte(_) => DegreesPerSecond(0),
        }
    }

    fn update(&mut self, cx: &Context<'_>) {
        let injected = Faults::from_bits_retain(low(cx.injected.fault_bits));
        self.faults = (self.faults & LATCHED) | injected;
        if self.stall.has_struck(cx.now, self.plant.is_stalled()) {
            self.faults |= Faults::STALL;
        }
        let rad_s =
            if cx.injected.brake_on { 0.0 } else { f64::from(self.set_speed().0).to_radians() };
        let speeds_up = rad_s.abs() > self.plant.speed_rad_s().abs();
        let register = if speeds_up { Register::ACCELERATION } else { Register::DECELERATION };
        let counts =
            self.byte(register).clamp(*ACCELERATION_RANGE.start(), *ACCELERATION_RANGE.end());
        let drive = Drive::Speed { rad_s, acceleration: f64::from(counts) * ACCELERATION_UNIT };
        self.plant.set_drive(if self.faults.is_empty() { drive } else { Drive::Off });
    }

    fn hear(&mut self, cx: &mut Context<'_>, address: Address, request: &Request) {
        self.watch.hear(cx.now);
        if let Some(name) = name(request) {
            cx.command(name);
        }
        self.measure(cx.injected.brake_on);
        let reply = self.carry_out(cx, request);
        self.last_command = request.command();
        self.update(cx);
        // After a write to 0x10 the level that it has set: the manual does not say which.
        if self.ack_level().answers(address, request) {
            self.answer(cx, &reply);
        }
    }

    fn carry_out(&mut self, cx: &mut Context<'_>, request: &Request) -> Reply {
        match *request {
            Request::QueryId => Reply::Id,
            Request::Read { register, width } => {
                Reply::Read { register, value: self.value(register, width) }
            }
            Request::Write { register, value } if may_write(register) => {
                self.write(cx, register, value);
                Reply::Written { register, value }
            }
            Request::AsyncWrite { register, value } if may_write(register) => {
                self.waiting = Some((register, value));
                Reply::AsyncWritten { register, value }
            }
            Request::Execute => {
                // The manual does not say what an execute answers when nothing waits.
                let (register, value) =
                    self.waiting.take().unwrap_or((Register(0), Value::Word(0)));
                self.write(cx, register, value);
                Reply::Executed { register, value }
            }
            Request::Reset => {
                self.waiting = None;
                self.load_defaults(Node::FACTORY);
                Reply::ResetDone
            }
            Request::ReadMagneticAngle => {
                let angle = match self.value(Register::MAGNETIC_ANGLE, Width::Word) {
                    Value::Word(angle) => angle,
                    Value::Byte(angle) => u16::from(angle),
                };
                Reply::MagneticAngle { angle: TurnDegrees(angle) }
            }
            // What a healthy motor answers is not printed; here it repeats the request.
            Request::SelfTest => match request.encode() {
                Ok(raw) => Reply::SelfTest { raw },
                Err(_) => Reply::Error { error: MotorError::Command, command: request.command() },
            },
            Request::Write { .. }
            | Request::AsyncWrite { .. }
            | Request::FaultySelfTest
            | Request::Unknown { .. } => {
                Reply::Error { error: MotorError::Command, command: request.command() }
            }
        }
    }

    fn write(&mut self, cx: &mut Context<'_>, register: Register, value: Value) {
        let stops = register == Register::SPEED && value == Value::Word(0);
        let moves = !stops && Request::Write { register, value }.writes(Register::SPEED);
        let why = match (stops, moves) {
            (true, _) if cx.injected.ignore_stop => "injected",
            (_, true) if cx.injected.ignore_motion => "injected",
            _ if cx.injected.brake_on && (stops || moves) => "the brake is on",
            _ => "",
        };
        if !why.is_empty() {
            cx.ignored(if stops { "speed 0" } else { "speed" }, why);
            return;
        }
        match register {
            Register::ID => {
                let id = match value {
                    Value::Byte(id) => id,
                    Value::Word(word) => low(word),
                };
                self.take_id(Node::new(id).unwrap_or(self.node));
                self.store(Register::ID, Value::Byte(self.node.get()));
            }
            Register::CLEAR_PROTECTION => {
                if matches!(value, Value::Byte(1)) {
                    self.faults -= LATCHED;
                    self.stall = StallGuard::default();
                }
            }
            _ => self.store(register, value),
        }
    }

    /// Of frames to all: the manual gives neither id nor frame type (D14).
    fn broadcast_id(&self) -> Option<CanId> {
        let raw = u32::from(Address::BROADCAST_ID);
        if self.can_id.is_extended() { CanId::extended(raw) } else { CanId::standard(raw) }
    }

    fn ack_level(&self) -> AckLevel {
        AckLevel::of(self.byte(Register::ACK_LEVEL))
    }

    fn answer(&self, cx: &mut Context<'_>, reply: &Reply) {
        let wire = match self.interface {
            Interface::Can => d5::can::reply(self.can_id.0, self.node, reply).map(Wire::Can),
            Interface::Serial { .. } => {
                d5::reply_frame(self.node, reply).map(|bytes| Wire::Serial(bytes.to_vec()))
            }
        };
        if let Ok(wire) = wire {
            let delay = cx.random.between(REPLY_MIN, REPLY_MAX);
            cx.send(delay, wire, true);
        }
    }

    /// Takes in a frame that is for it, or that it answers all the same.
    fn hear_frame_of(&mut self, cx: &mut Context<'_>, bytes: &[u8; FRAME_LEN]) {
        let [_, _, _, command, ..] = *bytes;
        match d5::decode_request_frame(bytes) {
            Ok((address, request))
                if address == Address::Broadcast || address == Address::Node(self.node) =>
            {
                self.hear(cx, address, &request);
            }
            Ok(_) => self.complain(cx, MotorError::Id, command),
            Err(DecodeError::Header { .. }) => {}
            Err(DecodeError::Checksum { .. }) => {
                self.complain(cx, MotorError::Checksum, self.last_command)
            }
            Err(_) => self.complain(cx, MotorError::Command, command),
        }
    }

    fn complain(&self, cx: &mut Context<'_>, error: MotorError, command: u8) {
        if !matches!(self.ack_level(), AckLevel::Nothing { .. }) {
            self.answer(cx, &Reply::Error { error, command });
        }
    }
}

impl Model for D5 {
    fn hear_frame(&mut self, cx: &mut Context<'_>, frame: &CanFrame) {
        let id = CanId(frame.id());
        let is_for_it = id == self.can_id || Some(id) == self.broadcast_id();
        if !is_for_it && !cx.injected.answers_others {
            return;
        }
        let frame =
            if cx.injected.lenient { lenient::as_d5(self.node.get(), frame) } else { *frame };
        if let Ok(bytes) = frame.data().try_into()
            && !frame.is_remote_frame()
        {
            self.hear_frame_of(cx, bytes);
        }
    }

    fn hear_byte(&mut self, cx: &mut Context<'_>, byte: u8) {
        let lenient = cx.injected.lenient;
        let Some(bytes) = self.interface.push(cx.now, lenient, byte) else { return };
        let [_, to, ..] = bytes;
        let is_for_it = to == self.node.get() || to == Address::BROADCAST_ID;
        if !is_for_it && !cx.injected.answers_others {
            return;
        }
        let own = CanFrame::data_frame(self.can_id.0, &bytes).filter(|_| lenient);
        match own.map(|frame| lenient::as_d5(self.node.get(), &frame)) {
            Some(frame) => {
                if let Ok(bytes) = frame.data().try_into() {
                    self.hear_frame_of(cx, bytes);
                }
            }
            None => self.hear_frame_of(cx, &bytes),
        }
    }
    fn next_timer(&self) -> Option<Duration> {
        [self.watch.strikes_at(self.own_timeout()), self.stall.strikes_at()]
            .into_iter()
            .flatten()
            .min()
    }

    fn run(&mut self, cx: &mut Context<'_>) {
        if self.watch.strikes(self.own_timeout(), cx) {
            self.store(Register::SPEED, Value::Word(0));
        }
        self.update(cx);
    }

    fn fault_word(&self) -> u16 {
        u16::from(self.faults.bits())
    }

    fn own_timeout(&self) -> Option<Duration> {
        (self.byte(Register::TIMEOUT_SWITCH) == 1).then_some(TIMEOUT)
    }

    /// What survives a power cycle the manual does not say; here only the id does.
    fn power_cycle(&mut self) {
        let (plant, interface) = (self.plant.clone(), self.interface.clone());
        *self = Self { plant, ..Self::new(self.node, Some(self.can_id), interface) };
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}

/// Registers without a function are writable, as the manual's table has it.
fn may_write(register: Register) -> bool {
    register.info().is_none_or(|info| info.access == Access::ReadWrite)
}

fn low(word: u16) -> u8 {
    let [low, _] = word.to_le_bytes();
    low
}

/// What the log calls a command; nothing for reads.
fn name(request: &Request) -> Option<&'static str> {
    Some(match request {
        Request::QueryId | Request::Read { .. } | Request::ReadMagneticAngle => return None,
        Request::Write { register: Register::SPEED, value: Value::Word(0) } => "03 speed 0",
        Request::Write { register: Register::SPEED, .. } => "03 speed",
        Request::Write { .. } => "03 write",
        Request::AsyncWrite { register: Register::SPEED, value: Value::Word(0) } => "04 speed 0",
        Request::AsyncWrite { register: Register::SPEED, .. } => "04 speed",
        Request::AsyncWrite { .. } => "04 write",
        Request::Execute => "05 execute",
        Request::Reset => "06 reset",
        Request::SelfTest => "CF self test",
        Request::FaultySelfTest => "CE faulty self test",
        Request::Unknown { .. } => "other",
    })
}
