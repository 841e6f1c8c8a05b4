//! A simulated RMD servo motor (RMD V3.6), on CAN or RS485, with the habits observed on real ones.

use std::time::Duration;

use embedded_can::{Frame, Id};
use host_protocol::CanFrame;
use rmd::{
    Celsius, Centiamps, Centidegrees, Decivolts, Degrees, DegreesPerSecond, Faults, Milliseconds, Motion,
    MotionFeedback, MotionRanges, Node, RawNotice, Reply, Request, Span, command,
};

use super::counts::{to_i8, to_i16, to_i32, to_u16};
use super::dynamics::{Characteristics, Drive, Plant};
use super::framer::Framer;
use super::lenient;
use super::log::MotorEvent;
use super::model::{Context, Model};
use super::stall::StallGuard;
use super::watch::Watch;
use crate::bus::{Wire, bit_time};

/// CAN id on which every motor listens (RMD V3.6 §6).
const BROADCAST_CAN_ID: u16 = 0x280;
/// Frame id to which every motor listens on RS485 (RMD V3.6 §6).
const BROADCAST_RS485_ID: u8 = 0xCD;
/// A pause of this many bits ends a frame begun on RS485.
const FRAME_GAP_BITS: u64 = 35;

/// Time from a request to its answer.
const REPLY_MIN: Duration = Duration::from_micros(100);
const REPLY_MAX: Duration = Duration::from_micros(200);
/// The brake takes this long to open, and only then is the command answered (observed).
const RELEASE_MIN: Duration = Duration::from_millis(50);
const RELEASE_MAX: Duration = Duration::from_millis(150);
/// How often a motor in timeout says so.
const NOTICE_EVERY: Duration = Duration::from_secs(1);

/// A geared servo of a robot's joint, on 48 V.
const CHARACTERISTICS: Characteristics = Characteristics {
    max_speed_rad_s: 30.0,
    max_current_a: 20.0,
    speed_per_ampere: 5.0,
    mechanical_s: 0.15,
    speed_loop_s: 0.02,
    position_gain: 12.0,
    supply_v: 48.0,
    supply_ohm: 0.1,
    thermal_s: 120.0,
    warming_per_a2: 0.4,
    ambient_c: 25.0,
};
/// Acceleration limit of the speed loop, rad/s².
const ACCELERATION: f64 = 200.0;

/// Torque at the shaft for each ampere, N·m: the manual's 24 N·m at the current limit.
const NM_PER_AMPERE: f64 = 24.0 / 20.0;
/// The divisors with which the manual reads the words of motion mode (RMD V3.6 §5.4).
const POSITION_DIVISOR: f64 = 65_536.0;
const WORD_DIVISOR: f64 = 4_095.0;
const POSITION_LAST: f64 = 65_535.0;

/// How the motor is connected.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) enum Interface {
    Can,
    Rs485 { framer: Framer, line: lenient::Line, last_byte: Duration, gap: Duration },
}

impl Interface {
    pub(super) fn rs485(baud: u32) -> Self {
        let gap = bit_time(FRAME_GAP_BITS, baud);
        let (framer, line) = (Framer::default(), lenient::Line::default());
        Self::Rs485 { framer, line, last_byte: Duration::ZERO, gap }
    }
}

/// The motor's firmware.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Rmd {
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::rmd_node"))]
    node: Node,
    interface: Interface,
    plant: Plant,
    /// What it was told to do. It returns to that when a fault heals by itself.
    wanted: Drive,
    /// What it was doing when the fault came.
    before_fault: Option<Drive>,
    /// Stored by 0xB3; zero = off.
    timeout: Duration,
    watch: Watch,
    /// The next command will be echoed and ignored.
    deaf_once: bool,
    /// It has a holding brake.
    has_brake: bool,
    /// The timeout has locked the brake.
    locked_by_timeout: bool,
    brake_released: bool,
    release_at: Option<Duration>,
    notice_at: Option<Duration>,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::rmd_faults"))]
    faults: Faults,
    stall: StallGuard,
}

impl Rmd {
    pub(super) fn new(node: Node, interface: Interface) -> Self {
        Self {
            node,
            interface,
            plant: Plant::new(CHARACTERISTICS),
            wanted: Drive::Off,
            before_fault: None,
            timeout: Duration::ZERO,
            watch: Watch::default(),
            deaf_once: false,
            has_brake: false,
            locked_by_timeout: false,
            brake_released: false,
            release_at: None,
            notice_at: None,
            faults: Faults::empty(),
            stall: StallGuard::default(),
        }
    }

    /// The timeout has struck: output cut and brake locked (RMD V3.6 §2.30.1).
    fn cut_output(&mut self, cx: &mut Context<'_>) {
        self.deaf_once = true;
        self.wanted = Drive::Off;
        self.notice_at = Some(cx.now + NOTICE_EVERY);
        if self.has_brake && !self.is_locked() {
            cx.log(MotorEvent::BrakeLocked);
        }
        self.locked_by_timeout = true;
    }

    fn is_locked(&self) -> bool {
        self.has_brake && (!self.brake_released || self.locked_by_timeout)
    }

    fn is_faulty(&self) -> bool {
        !self.faults.is_empty()
    }

    /// Level 1 stays until a restart; the rest goes with its cause and the motor resumes (RMD V3.6 §8.1).
    fn update_faults(&mut self, cx: &Context<'_>) {
        let latched = self.faults & Faults::UNTIL_RESTART;
        self.faults = latched | Faults::from_bits_retain(cx.injected.fault_bits);
        if self.stall.has_struck(cx.now, self.plant.is_stalled()) {
            self.faults |= Faults::STALL;
        }
        if self.is_faulty() {
            self.before_fault.get_or_insert(self.wanted);
        } else if let Some(before) = self.before_fault.take()
            && cx.injected.resume_after_fault
        {
            self.wanted = before;
        }
    }

    fn apply_drive(&mut self) {
        let drive = if self.is_locked() {
            Drive::Locked
        } else if self.is_faulty() || self.watch.has_struck() {
            Drive::Off
        } else {
            self.wanted
        };
        self.plant.set_drive(drive);
    }

    fn hear(&mut self, cx: &mut Context<'_>, request: &Request) {
        self.watch.hear(cx.now);
        self.notice_at = None;
        let is_read =
            matches!(request, Request::ReadMultiTurnAngle | Request::ReadStatus1 | Request::ReadStatus2);
        if is_read {
            return self.carry_out(cx, request);
        }
        let name = name(request);
        if matches!(request, Request::SetCommunicationTimeout { .. }) {
            cx.command(name);
            return self.carry_out(cx, request);
        }
        let is_motion = is_motion(request);
        let is_stop = matches!(request, Request::Stop | Request::Shutdown);
        let ignored = if std::mem::take(&mut self.deaf_once) {
            Some("first after the timeout")
        } else if is_motion && self.is_faulty() {
            Some("fault")
        } else if is_motion && cx.injected.ignore_motion || is_stop && cx.injected.ignore_stop {
            Some("injected")
        } else {
            None
        };
        match ignored {
            Some(because) => {
                cx.ignored(name, because);
                self.throw_back(cx, request);
            }
            None => {
                cx.command(name);
                self.carry_out(cx, request);
            }
        }
        self.apply_drive();
    }

    /// Answers with the request's own bytes. Motion mode, whose replies have another form, is answered with the state (an
    /// assumption).
    fn throw_back(&self, cx: &mut Context<'_>, request: &Request) {
        if let Request::MotionMode { .. } = request {
            return self.answer(cx, &Reply::MotionMode { feedback: self.feedback() });
        }
        // Request and reply of a command have the same code and length, so the bytes decode as a reply.
        if let Ok(data) = request.encode()
            && let Ok(reply) = Reply::decode(&data)
        {
            self.answer(cx, &reply);
        }
    }

    fn carry_out(&mut self, cx: &mut Context<'_>, request: &Request) {
        let wanted = match *request {
            Request::Shutdown => Some(Drive::Off),
            Request::Stop => Some(Drive::Speed { rad_s: 0.0, acceleration: ACCELERATION }),
            Request::TorqueCurrent { current } => Some(Drive::Current(f64::from(current.0) / 100.0)),
            Request::Velocity { speed } => {
                let rad_s = (f64::from(speed.0) / 100.0).to_radians();
                Some(Drive::Speed { rad_s, acceleration: ACCELERATION })
            }
            Request::AbsolutePosition { max_speed, angle } => {
                let rad = (f64::from(angle.0) / 100.0).to_radians();
                Some(Drive::Position { rad, max_speed: f64::from(max_speed.0).to_radians() })
            }
            Request::IncrementalPosition { max_speed, angle } => {
                let distance = (f64::from(angle.0) / 100.0).to_radians();
                let rad = self.plant.position_rad() + distance;
                Some(Drive::Position { rad, max_speed: f64::from(max_speed.0).to_radians() })
            }
            Request::MotionMode { command } => {
                let target = MotionRanges::DEFAULT.target(&command);
                Some(Drive::Spring {
                    rad: target.position_rad,
                    rad_s: target.velocity_rad_s,
                    amps_per_rad: target.kp / NM_PER_AMPERE,
                    amp_s_per_rad: target.kd / NM_PER_AMPERE,
                    amps: target.torque_nm / NM_PER_AMPERE,
                })
            }
            _ => None,
        };
        self.wanted = wanted.unwrap_or(self.wanted);
        let motion = self.motion();
        let reply = match *request {
            Request::ReadMultiTurnAngle => Reply::MultiTurnAngle { angle: self.angle() },
            Request::ReadStatus1 => self.status_1(),
            Request::ReadStatus2 => Reply::Status2 { motion },
            Request::Shutdown => Reply::Shutdown,
            Request::Stop => Reply::Stop,
            Request::TorqueCurrent { .. } => Reply::TorqueCurrent { motion },
            Request::Velocity { .. } => Reply::Velocity { motion },
            Request::AbsolutePosition { .. } => Reply::AbsolutePosition { motion },
            Request::IncrementalPosition { .. } => Reply::IncrementalPosition { motion },
            Request::MotionMode { .. } => Reply::MotionMode { feedback: self.feedback() },
            Request::ReleaseBrake => {
                let takes = cx.random.between(RELEASE_MIN, RELEASE_MAX);
                self.release_at = Some(cx.now + takes);
                return self.answer_after(cx, takes, &Reply::BrakeReleased);
            }
            Request::LockBrake => {
                self.release_at = None;
                if self.has_brake && !self.is_locked() {
                    cx.log(MotorEvent::BrakeLocked);
                }
                self.brake_released = false;
                Reply::BrakeLocked
            }
            Request::SetCommunicationTimeout { timeout } => {
                self.timeout = Duration::from_millis(u64::from(timeout.0));
                Reply::CommunicationTimeout { timeout: Milliseconds(timeout.0) }
            }
            // Commands that are not simulated are echoed.
            _ => return self.throw_back(cx, request),
        };
        if is_motion(request) && std::mem::take(&mut self.locked_by_timeout) && self.has_brake {
            // Communication is back to normal, and so is the motor (RMD V3.6 §2.30.4).
            cx.log(MotorEvent::BrakeReleased);
        }
        self.answer(cx, &reply);
    }

    fn answer(&self, cx: &mut Context<'_>, reply: &Reply) {
        let delay = cx.random.between(REPLY_MIN, REPLY_MAX);
        self.answer_after(cx, delay, reply);
    }

    fn answer_after(&self, cx: &mut Context<'_>, delay: Duration, reply: &Reply) {
        match self.interface {
            Interface::Can => {
                if let Ok(frame) = rmd::can::reply(self.node, reply) {
                    cx.send(delay, Wire::Can(frame), false);
                }
            }
            Interface::Rs485 { .. } => {
                if let Ok(bytes) = rmd::rs485::reply(self.node, reply) {
                    cx.send(delay, Wire::Serial(bytes.to_vec()), true);
                }
            }
        }
    }

    fn angle(&self) -> Centidegrees {
        Centidegrees(to_i32(self.plant.position_rad().to_degrees() * 100.0))
    }

    fn motion(&self) -> Motion {
        Motion {
            temperature: Celsius(to_i8(self.plant.motor_c())),
            current: Centiamps(to_i16(self.plant.current_a() * 100.0)),
            speed: DegreesPerSecond(to_i16(self.plant.speed_rad_s().to_degrees())),
            // The manual's range is symmetric.
            angle: Degrees(to_i16(self.plant.position_rad().to_degrees()).max(-i16::MAX)),
        }
    }

    /// The state in the words of motion mode; beyond their ranges it stays at their ends (RMD V3.6 §5.3).
    fn feedback(&self) -> MotionFeedback {
        let word = |value: f64, Span { min, max }: Span, divisor: f64, last: f64| {
            to_u16(((value - min) / (max - min) * divisor).clamp(0.0, last))
        };
        let ranges = MotionRanges::DEFAULT;
        let torque_nm = self.plant.current_a() * NM_PER_AMPERE;
        MotionFeedback {
            id: self.node.get(),
            position: word(self.plant.position_rad(), ranges.position_rad, POSITION_DIVISOR, POSITION_LAST),
            velocity: word(self.plant.speed_rad_s(), ranges.velocity_rad_s, WORD_DIVISOR, WORD_DIVISOR),
            torque: word(torque_nm, ranges.torque_nm, WORD_DIVISOR, WORD_DIVISOR),
        }
    }

    fn status_1(&self) -> Reply {
        Reply::Status1 {
            temperature: Celsius(to_i8(self.plant.motor_c())),
            brake_released: !self.is_locked(),
            voltage: Decivolts(to_u16(self.plant.voltage_v() * 10.0)),
            faults: self.faults,
        }
    }
}

impl Model for Rmd {
    fn hear_frame(&mut self, cx: &mut Context<'_>, frame: &CanFrame) {
        let frame = &if cx.injected.lenient { lenient::as_rmd(frame) } else { *frame };
        let broadcast = matches!(frame.id(), Id::Standard(id) if id.as_raw() == BROADCAST_CAN_ID);
        if broadcast && !frame.is_remote_frame() {
            if let Ok(data) = <&[u8; rmd::DATA_LEN]>::try_from(frame.data()) {
                self.hear(cx, &Request::decode(data));
            }
        } else if let Ok((node, request)) = rmd::can::decode_request(frame)
            && node == self.node
        {
            self.hear(cx, &request);
        }
    }

    fn hear_byte(&mut self, cx: &mut Context<'_>, byte: u8) {
        let Interface::Rs485 { framer, line, last_byte, gap } = &mut self.interface else { return };
        if cx.now.saturating_sub(*last_byte) > *gap {
            framer.reset();
        }
        *last_byte = cx.now;
        let (strictly, leniently) = (framer.push(byte), line.push(byte));
        let Some(frame) = (if cx.injected.lenient { leniently } else { strictly }) else { return };
        let [_, id, _, data @ .., _, _] = &frame;
        if *id == BROADCAST_RS485_ID {
            self.hear(cx, &Request::decode(data));
        } else if let Ok((node, request)) = rmd::rs485::decode_request(&frame)
            && node == self.node
        {
            self.hear(cx, &request);
        }
    }

    fn next_timer(&self) -> Option<Duration> {
        let timers = [
            self.watch.strikes_at(self.own_timeout()),
            self.release_at,
            self.notice_at,
            self.stall.strikes_at(),
        ];
        timers.into_iter().flatten().min()
    }

    fn run(&mut self, cx: &mut Context<'_>) {
        self.has_brake = cx.injected.brake;
        if self.watch.strikes(self.own_timeout(), cx) {
            self.cut_output(cx);
        }
        if self.release_at.take_if(|at| *at <= cx.now).is_some() {
            let was_locked = self.is_locked();
            (self.brake_released, self.locked_by_timeout) = (!cx.injected.stuck_brake, false);
            if was_locked && !self.is_locked() {
                cx.log(MotorEvent::BrakeReleased);
            }
        }
        if let Some(at) = self.notice_at.filter(|at| *at <= cx.now) {
            self.notice_at = Some(at + NOTICE_EVERY);
            self.answer(cx, &Reply::TimeoutNotice { raw: RawNotice::default() });
        }
        self.update_faults(cx);
        self.apply_drive();
    }

    fn fault_word(&self) -> u16 {
        self.faults.bits()
    }

    fn own_timeout(&self) -> Option<Duration> {
        (!self.timeout.is_zero()).then_some(self.timeout)
    }

    fn power_cycle(&mut self) {
        (self.wanted, self.before_fault) = (Drive::Off, None);
        self.watch = Watch::default();
        (self.deaf_once, self.locked_by_timeout) = (false, false);
        (self.brake_released, self.release_at, self.notice_at) = (false, None, None);
        (self.faults, self.stall) = (Faults::empty(), StallGuard::default());
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}

/// Commands that move: closed-loop ones, and motion mode.
fn is_motion(request: &Request) -> bool {
    command::CLOSED_LOOP.contains(&request.command()) || matches!(request, Request::MotionMode { .. })
}

fn name(request: &Request) -> &'static str {
    match request {
        Request::ReadMultiTurnAngle => "0x92 read angle",
        Request::ReadStatus1 => "0x9A read status 1",
        Request::ReadStatus2 => "0x9C read status 2",
        Request::Shutdown => "0x80 shutdown",
        Request::Stop => "0x81 stop",
        Request::TorqueCurrent { .. } => "0xA1 current",
        Request::Velocity { .. } => "0xA2 velocity",
        Request::AbsolutePosition { .. } => "0xA4 position",
        Request::IncrementalPosition { .. } => "0xA8 incremental position",
        Request::MotionMode { .. } => "motion mode",
        Request::ReleaseBrake => "0x77 release brake",
        Request::LockBrake => "0x78 lock brake",
        Request::SetCommunicationTimeout { .. } => "0xB3 timeout",
        _ => "other",
    }
}

#[cfg(test)]
#[path = "rmd_tests.rs"]
mod tests;
