//! What the gateway tells of its axes by events (G1, G4).

use super::Arming;
use crate::axis::{Cause, StopAction};
use crate::motor::Protocol;
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::{Body, Clears, News, Request, Told};

/// Kind of a reply, and the length of a header.
const REPLY: u8 = 2;
const HEADER: usize = 5;

impl Oracle {
    pub(super) fn news(&mut self, now: u64, news: News) {
        match news {
            News::EStopLatched => self.e_stopped = true,
            News::EStopCleared => {
                let asked = |link: &crate::link::Link| {
                    link.records
                        .iter()
                        .any(|r| r.request == Request::Clear(Clears::Gateway) && r.at_us == now)
                };
                if self.links.iter().any(asked) {
                    self.e_stopped = false;
                } else {
                    self.broken(
                        Check::EStopIgnored,
                        now,
                        "the e-stop is cleared, unasked or with its input open".into(),
                    );
                }
            }
            News::Unreachable { axis, stop_transmitted } => {
                self.history.unreachable(axis);
                self.judge_unreachable(now, axis.into(), stop_transmitted);
                if let Some(axis) = self.axes.get_mut(usize::from(axis)) {
                    axis.unreachable = true;
                    if let Some(duty) = &mut axis.duty {
                        duty.confirmed = false;
                        // Known as confirmed until now: what follows is silence, so that its own
                        // timeout can act.
                        duty.rests = duty.since_us == now;
                        duty.left += duty.left_before;
                    }
                }
            }
            News::Tripped { axis, trip } => {
                self.history.tripped(axis, trip);
                self.tripped(now, usize::from(axis));
            }
            News::State { axis, state } => {
                self.state(now, usize::from(axis), state);
                // Whatever an axis does but rest ends raw access beside it.
                if let Some(axis) = self.axes.get(usize::from(axis))
                    && axis.needs_its_bus()
                {
                    self.close_raw(axis.bus(), now);
                }
            }
        }
    }

    fn tripped(&mut self, now: u64, index: usize) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        axis.came_from_rest = axis.told.is_at_rest();
        axis.told = Told::Tripped { confirmed: false };
        axis.arming = None;
        let group = axis.trip_group();
        self.owe_stop(index, Cause::Told, now);
        for other in 0..self.axes.len() {
            if group.is_some() && self.axes[other].trip_group() == group && self.axes[other].armed {
                self.owe_stop(other, Cause::Group, now);
            }
        }
    }

    pub(super) fn state(&mut self, now: u64, index: usize, state: Told) {
        let Some(axis) = self.axes.get_mut(index) else { return };
        let before = std::mem::replace(&mut axis.told, state);
        axis.came_from_rest = before.is_at_rest();
        axis.output_off_asked &= state == Told::Holding;
        let arming = axis.arming.take();
        if state == Told::Arming {
            axis.arming = Some(Arming::new(now));
        }
        match (before, state) {
            (Told::Armed | Told::Active, Told::Armed | Told::Active) => {}
            (_, Told::Armed | Told::Active) => {
                let missing =
                    arming.map_or(Some("arming"), |arming| arming.missing(&self.axes[index]));
                if let Some(missing) = missing {
                    self.broken(
                        Check::ArmedUnproved,
                        now,
                        format!("axis {index}, without {missing}"),
                    );
                }
                self.armed(now, index);
            }
            (_, Told::Stopping) => {
                self.owe_stop(index, Cause::Told, now);
            }
            (Told::Tripped { confirmed: true }, Told::Tripped { confirmed: false }) => {
                // It turns again: the stop begins anew.
                let before = axis.duty.take().map_or(0, |duty| duty.left);
                self.owe_stop(index, Cause::Told, now);
                if let Some(duty) = &mut self.axes[index].duty {
                    duty.left_before = before;
                }
            }
            (_, Told::Tripped { confirmed: false }) => self.owe_stop(index, Cause::Told, now),
            (_, Told::Tripped { confirmed: true }) => self.confirmed(now, index),
            (Told::Tripped { .. }, Told::Idle | Told::Holding | Told::Unconfigured) => {
                self.cleared(now, index)
            }
            (Told::Stopping, Told::Idle | Told::Holding | Told::Unconfigured) => {
                self.confirmed(now, index);
                self.axes[index].duty = None;
            }
            // Allowance: it failed at the very instant at which it was to be stopped, and had
            // nothing to stop.
            (Told::Arming, Told::Idle | Told::Holding) => {
                axis.duty = axis.duty.take().filter(|duty| duty.since_us != now);
            }
            (_, Told::Idle | Told::Holding | Told::Unconfigured | Told::Arming) => {
                if axis.armed {
                    // No stop is under way: one is due all the same.
                    self.owe_stop(index, Cause::Told, now);
                }
            }
        }
    }

    fn armed(&mut self, now: u64, index: usize) {
        let number = u8::try_from(index).unwrap_or(u8::MAX);
        let holder = self.holder.map(|(holder, _)| holder);
        let asked = |link: u8| {
            let records = &self.links[usize::from(link)].records;
            records.iter().any(|r| r.request.arms(number) && !r.must_be_refused)
        };
        if !holder.is_some_and(asked) {
            self.broken(Check::ArmedUnasked, now, format!("axis {index}"));
        }
        if self.e_stopped || self.e_stop_open {
            self.broken(Check::EStopIgnored, now, format!("axis {index} is armed"));
        }
        let bus = self.axes[index].bus();
        if bus.and_then(|bus| self.buses.get(bus)).is_some_and(|bus| bus.raw_open) {
            self.broken(
                Check::RawUnopened,
                now,
                format!("axis {index} is armed on a bus with raw access"),
            );
        }
        let outside = bus.and_then(|bus| self.buses.get(bus)).map_or(0, |bus| bus.outside_us(now));
        let not_ours = self.not_ours_us(now, &self.axes[index]);
        let axis = &mut self.axes[index];
        axis.faults_asked = (now, not_ours);
        axis.undelivered = None;
        axis.turns_since = None;
        axis.armed = true;
        axis.is_to_be_told = false;
        axis.armed_us = now;
        axis.heard = (now, outside);
        axis.epoch = None;
        axis.permits.clear();
        axis.duty = None;
        // The reply may have come before the event, on another link.
        let arms = |r: &&crate::link::Record| r.request.arms(number) && r.result_us == now;
        let replies = self.links.iter().flat_map(|link| link.records.iter().filter(arms));
        let is_reply = |bytes: &&Vec<u8>| bytes.first() == Some(&REPLY);
        if let Some(reply) = replies.filter_map(|r| r.result.as_ref()).find(is_reply) {
            axis.is_of_epoch(Body(&reply[HEADER..]).u32());
        }
    }

    /// The gateway says that the motor has confirmed the stop.
    fn confirmed(&mut self, now: u64, index: usize) {
        let axis = &mut self.axes[index];
        axis.unreachable = false;
        let action = axis.stop_action();
        let is_d5 = axis.protocol() == Some(Protocol::D5);
        let Some(duty) = &mut axis.duty else { return };
        let twice = duty.left >= 2;
        // Allowance: after a reset nobody is told until the hosts are let in; the motor may have
        // stood and turned again before.
        let stood = duty.still >= 2 || duty.cause == Cause::Reset && duty.stood;
        let stands = match action {
            Some(StopAction::Coast) => true,
            Some(StopAction::Hold) => stood,
            Some(StopAction::Brake) => stood && duty.locked && duty.output_off,
            None => false,
        };
        // A speed that waits in a D5 motor would start with the next that is told to all.
        let nothing_waits = duty.nothing_waits || !is_d5;
        let proved = duty.acknowledged_us.is_some() && stands && nothing_waits;
        duty.confirmed = true;
        let seen = format!("axis {index}, {action:?}: {duty:?}");
        if !twice {
            self.broken(Check::StopOnce, now, seen.clone());
        }
        if !proved {
            self.broken(Check::ConfirmedUnproved, now, seen);
        }
    }

    fn cleared(&mut self, now: u64, index: usize) {
        let axis = &mut self.axes[index];
        axis.duty = None;
        axis.unreachable = false;
        // Its result may belong to a session that is over.
        if axis.cleared_us != Some(now) && std::mem::take(&mut axis.clearing) == 0 {
            self.broken(Check::TripForgotten, now, format!("axis {index}"));
        }
    }
}
