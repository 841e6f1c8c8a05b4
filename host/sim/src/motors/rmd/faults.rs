//! What an RMD motor does by itself: its own timeout, its faults, and what they leave of its drive
//! (RMD V3.6 §2.30, §8).

use std::time::Duration;

use super::super::dynamics::Drive;
use super::super::log::MotorEvent;
use super::super::model::Context;
use super::{NOTICE_EVERY, Rmd};
use rmd::Faults;

/// How often a motor with a fault says so, where it is told to (RMD V3.6 §2.33.4).
const ERROR_EVERY: Duration = Duration::from_millis(100);

impl Rmd {
    /// The timeout has struck: output cut and brake locked (RMD V3.6 §2.30.1).
    pub(super) fn cut_output(&mut self, cx: &mut Context<'_>) {
        self.deaf_once = !cx.injected.plain_timeout;
        self.wanted = Drive::Off;
        self.notice_at = self.deaf_once.then(|| cx.now + NOTICE_EVERY);
        if self.has_brake && !self.is_locked() {
            cx.log(MotorEvent::BrakeLocked);
        }
        self.locked_by_timeout = true;
    }

    pub(super) fn is_faulty(&self) -> bool {
        !self.faults.is_empty()
    }

    /// Level 1 stays until a restart; the rest goes with its cause and the motor resumes (RMD V3.6
    /// §8.1).
    pub(super) fn update_faults(&mut self, cx: &mut Context<'_>) {
        let latched = self.faults & Faults::UNTIL_RESTART;
        self.faults = latched | Faults::from_bits_retain(cx.injected.fault_bits);
        // Against its locked brake it pushes in vain.
        let against_brake = self.is_locked() && !self.is_faulty() && self.plant.pushes(self.wanted);
        if self.stall.has_struck(cx.now, against_brake || self.plant.is_stalled()) {
            self.faults |= Faults::STALL;
        }
        if self.is_faulty() {
            self.before_fault.get_or_insert(self.wanted);
        } else if let Some(before) = self.before_fault.take()
            && cx.injected.resume_after_fault
        {
            self.wanted = before;
        }
        self.report_faults(cx);
    }

    /// 0x20 index 3: 0x9A every 100 ms for as long as there is a fault (RMD V3.6 §2.33.4).
    fn report_faults(&mut self, cx: &mut Context<'_>) {
        if !self.is_faulty() || !self.memory.reports_errors {
            self.report_at = None;
            return;
        }
        let at = *self.report_at.get_or_insert(cx.now);
        if at <= cx.now {
            self.report_at = Some(at + ERROR_EVERY);
            let status = self.status_1();
            self.answer(cx, &status);
        }
    }

    pub(super) fn apply_drive(&mut self) {
        let drive = if self.is_locked() {
            Drive::Locked
        } else if self.is_faulty() || self.watch.has_struck() {
            Drive::Off
        } else {
            self.wanted
        };
        self.plant.set_drive(drive);
    }
}
