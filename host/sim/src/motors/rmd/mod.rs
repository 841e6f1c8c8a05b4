//! A simulated RMD servo motor (RMD V3.6), on CAN or RS485, with the habits observed on real ones.

mod commands;
mod faults;
mod interface;
mod memory;
mod newer;
mod readings;
#[cfg(test)]
mod tests;

use std::time::Duration;

use host_protocol::CanFrame;
use rmd::{Dialect, Faults, Node, RawNotice, Reply, Request, Target};

use super::dynamics::{Characteristics, Drive, Plant};
use super::log::MotorEvent;
use super::model::{Context, Model};
use super::stall::StallGuard;
use super::watch::Watch;
use commands::{is_motion, name};
pub(super) use interface::Interface;
use memory::Memory;

/// Time from a request to its answer.
const REPLY_MIN: Duration = Duration::from_micros(100);
const REPLY_MAX: Duration = Duration::from_micros(200);
/// How often a motor in timeout says so.
const NOTICE_EVERY: Duration = Duration::from_secs(1);
/// How often it sends by itself what it is set to.
const ACTIVE_EVERY: Duration = Duration::from_millis(100);
/// Why a command that it does not know is not carried out.
const UNKNOWN: &str = "unknown";
/// So long a restart takes (an assumption), in which the motor hears and says nothing.
const RESTART_MIN: Duration = Duration::from_millis(800);
const RESTART_MAX: Duration = Duration::from_millis(1_500);

/// The same of one that is told to be quick.
const PROMPT_RESTART: Duration = Duration::from_millis(10);

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
/// Deceleration of a stop, rad/s².
const ACCELERATION: f64 = 200.0;
/// Torque at the shaft for each ampere, N·m: the manual's 24 N·m at the current limit.
const NM_PER_AMPERE: f64 = 24.0 / 20.0;

/// The motor's firmware.
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Rmd {
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::rmd_node"))]
    node: Node,
    interface: Interface,
    memory: Memory,
    plant: Plant,
    /// What it was told to do. It returns to that when a fault heals by itself.
    wanted: Drive,
    /// What it was doing when the fault came.
    before_fault: Option<Drive>,
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
    report_at: Option<Duration>,
    /// When it next sends its status 2 by itself.
    active_at: Option<Duration>,
    /// Its last answer.
    last: [u8; 8],
    /// Its node after the next restart, from which it answers already.
    next_node: Option<u8>,
    /// When its firmware started; unknown from a loss of power until it runs again, later than now
    /// during a restart.
    started_at: Option<Duration>,
    #[cfg_attr(feature = "snapshot", serde(with = "super::snapshot::rmd_faults"))]
    faults: Faults,
    stall: StallGuard,
}

impl Rmd {
    pub(super) fn new(node: Node, interface: Interface) -> Self {
        Self {
            node,
            interface,
            memory: Memory::new(),
            plant: Plant::new(CHARACTERISTICS),
            wanted: Drive::Off,
            before_fault: None,
            watch: Watch::default(),
            deaf_once: false,
            has_brake: false,
            locked_by_timeout: false,
            brake_released: false,
            release_at: None,
            notice_at: None,
            report_at: None,
            active_at: None,
            last: [0; 8],
            next_node: None,
            started_at: Some(Duration::ZERO),
            faults: Faults::empty(),
            stall: StallGuard::default(),
        }
    }

    fn is_locked(&self) -> bool {
        self.has_brake && (!self.brake_released || self.locked_by_timeout)
    }

    /// 0x76: the firmware starts anew, output off and brake locked as at power-on (RMD V3.6 §2.25).
    fn restart(&mut self, cx: &mut Context<'_>) {
        self.begin_anew();
        self.memory.restart();
        let takes = match cx.injected.prompt_restart {
            true => PROMPT_RESTART,
            false => cx.random.between(RESTART_MIN, RESTART_MAX),
        };
        self.started_at = Some(cx.now + takes);
        cx.log(MotorEvent::Restarted);
    }

    fn is_restarting(&self, now: Duration) -> bool {
        self.started_at.is_some_and(|at| at > now)
    }

    /// Time since the start, ms (RMD V3.6 §2.28).
    fn run_time_ms(&self, now: Duration) -> u32 {
        let since = now.saturating_sub(self.started_at.unwrap_or(now));
        u32::try_from(since.as_millis()).unwrap_or(u32::MAX)
    }

    fn begin_anew(&mut self) {
        if let Some(Ok(node)) = self.next_node.take().map(Node::new) {
            self.node = node;
        }
        self.last = [0; 8];
        (self.wanted, self.before_fault) = (Drive::Off, None);
        self.watch = Watch::default();
        (self.deaf_once, self.locked_by_timeout, self.brake_released) = (false, false, false);
        (self.release_at, self.notice_at, self.report_at) = (None, None, None);
        (self.faults, self.stall) = (Faults::empty(), StallGuard::default());
    }

    /// Takes in a request, if it is for this motor.
    fn hear_request(&mut self, cx: &mut Context<'_>, to: Target, request: &Request) {
        let all_to_can = to == Target::All && matches!(self.interface, Interface::Can);
        let of_id = matches!(request, Request::ReadCanId | Request::SetCanId { .. });
        // The filter keeps 0x280 out (RMD V3.6 §2.33.4); of 0x300 the manual does not say that.
        let filtered = all_to_can && !of_id && self.memory.can_id_filter;
        if to == Target::All && !filtered || to == Target::Node(self.node) {
            self.hear(cx, request);
        }
    }

    fn hear(&mut self, cx: &mut Context<'_>, request: &Request) {
        self.watch.hear(cx.now);
        self.notice_at = None;
        if *request == Request::ReadStatus2 && cx.injected.active_replies {
            return;
        }
        if request.only_reads() {
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
        } else if matches!(request, Request::Unknown { .. }) {
            Some(UNKNOWN)
        } else {
            None
        };
        match ignored {
            Some(because) => {
                cx.ignored(name, because);
                if because == UNKNOWN && cx.injected.stale_replies {
                    self.repeat(cx);
                } else {
                    self.echo(cx, request);
                }
            }
            None => {
                cx.command(name);
                self.carry_out(cx, request);
            }
        }
        self.update_faults(cx);
        self.apply_drive();
    }

    /// Answers with the request's own bytes. Motion mode, whose replies have another form, is
    /// answered with the state (an assumption).
    fn echo(&mut self, cx: &mut Context<'_>, request: &Request) {
        if let Request::MotionMode { .. } = request {
            return self.answer(cx, &Reply::MotionMode { feedback: self.feedback() });
        }
        // Where another dialect has the command, it is no request that may be encoded.
        if let Request::Unknown { data } = *request {
            return self.answer(cx, &Reply::Unknown { data });
        }
        // Request and reply of a command have the same code and length, so the bytes decode as a
        // reply.
        if let Ok(data) = request.encode()
            && let Ok(reply) = Reply::decode(&data)
        {
            self.answer(cx, &reply);
        }
    }

    fn answer(&mut self, cx: &mut Context<'_>, reply: &Reply) {
        let delay = cx.random.between(REPLY_MIN, REPLY_MAX);
        if let Ok(data) = reply.encode() {
            self.last = data;
        }
        let next = self.next_node.filter(|_| !cx.injected.keeps_reply_id);
        let node = next.and_then(|node| Node::new(node).ok()).unwrap_or(self.node);
        self.interface.send(cx, node, delay, reply);
    }

    /// Answers with its last answer.
    fn repeat(&mut self, cx: &mut Context<'_>) {
        if let Ok(reply) = Reply::decode_in(self.dialect(cx), &self.last) {
            self.answer(cx, &reply);
        }
    }

    fn dialect(&self, cx: &Context<'_>) -> Dialect {
        match cx.injected.rmd_dialect {
            0 => Dialect::V3_6,
            number => Dialect::from_number(number.into()).unwrap_or_default(),
        }
    }
}

impl Model for Rmd {
    fn hear_frame(&mut self, cx: &mut Context<'_>, frame: &CanFrame) {
        if let Some((to, request)) = Interface::request(cx.injected.lenient, frame)
            && !self.is_restarting(cx.now)
        {
            let request = self.in_dialect(cx, request, frame.data());
            self.hear_request(cx, to, &request);
        }
    }

    fn hear_byte(&mut self, cx: &mut Context<'_>, byte: u8) {
        if let Some((to, request, data)) = self.interface.push(cx.now, cx.injected.lenient, byte)
            && !self.is_restarting(cx.now)
        {
            let request = match to {
                Target::Node(_) => self.in_dialect(cx, request, &data),
                Target::All => request,
            };
            self.hear_request(cx, to, &request);
        }
    }

    fn next_timer(&self) -> Option<Duration> {
        let timers = [
            self.watch.strikes_at(self.own_timeout()),
            self.release_at,
            self.notice_at,
            self.report_at,
            self.active_at,
            self.stall.strikes_at(),
        ];
        timers.into_iter().flatten().min()
    }

    fn run(&mut self, cx: &mut Context<'_>) {
        self.has_brake = cx.injected.brake;
        self.started_at.get_or_insert(cx.now);
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
        self.active_at = match (cx.injected.active_replies, self.active_at) {
            (false, _) => None,
            (true, Some(at)) if at > cx.now => Some(at),
            (true, _) => {
                let motion = self.motion();
                self.answer(cx, &Reply::Status2 { motion });
                Some(cx.now + ACTIVE_EVERY)
            }
        };
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
        let timeout_ms = self.memory.timeout_ms;
        (timeout_ms > 0).then(|| Duration::from_millis(timeout_ms.into()))
    }

    fn power_cycle(&mut self) {
        self.begin_anew();
        self.memory.lose_power(self.plant.position_rad());
        if let Some(bitrate) = self.memory.bitrate {
            self.interface.set_rate(bitrate);
        }
        self.started_at = None;
    }

    fn bitrate(&self) -> Option<u32> {
        self.memory.bitrate
    }

    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }
}
