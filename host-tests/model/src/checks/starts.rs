//! Starts: what must outlive a reset, and that nothing outlives a loss of power (G6).

use super::History;
use crate::axis::{Axis, Cause};
use crate::bus::Bus;
use crate::link::{Link, Record};
use crate::oracle::{LINK_SILENCE_US, Oracle};
use crate::violation::Check;
use crate::wire::{Clears, Listed, Report, Request, Told};

/// What the first list of the axes after a start must show.
#[derive(Debug, Clone)]
pub(crate) struct Unlisted {
    /// The axes that were in motion or tripped.
    moved: Vec<bool>,
    /// Power was lost.
    blank: bool,
    /// The e-stop may have been latched or cleared by what the reset interrupted.
    e_stop_unsure: bool,
}

impl Oracle {
    /// Whether a request to configure something has not been answered: a reset now may keep the
    /// change or not.
    #[must_use]
    pub fn is_configuring(&self) -> bool {
        let configures = |record: &Record| {
            record.result.is_none()
                && matches!(
                    record.request,
                    Request::LinkSilence(_)
                        | Request::ConfigureBus { .. }
                        | Request::ConfigureAxis { .. }
                        | Request::ApplyChanges
                        | Request::RemoveAxis(_)
                )
        };
        self.links.iter().any(|link| link.records.iter().any(configures))
    }

    /// The gateway is reset, has its memory back, and begins anew: a reset `interrupted` it before
    /// the change that the latest event made was kept as a whole, and before it could tell
    /// anybody. Its hosts are heard when it says so, and the one that listens asks first for
    /// the state of the gateway and a list of the axes.
    pub fn reset(&mut self, now: u64, interrupted: bool) {
        self.advance(now);
        let e_stop_unsure = interrupted && self.e_stop_may_change(now)
            || self.unlisted.as_ref().is_some_and(|unlisted| unlisted.e_stop_unsure);
        self.starts += 1;
        self.sessions_end();
        self.buses.iter_mut().for_each(|bus| bus.restarted(now));
        let (mut moved, mut tripping) = (Vec::new(), Vec::new());
        for index in 0..self.axes.len() {
            let axis = &mut self.axes[index];
            // What was interrupted may have been the end of it, and nobody has been told; nor what
            // a start has led to so far.
            let ends = axis.clearing > 0 || matches!(axis.told, Told::Stopping | Told::Arming);
            let may_be_over =
                interrupted && ends || self.unlisted.is_some() && axis.told == Told::Stopping;
            let at_rest = axis.told == Told::Unconfigured || axis.told.is_at_rest();
            moved.push(!at_rest && !may_be_over);
            if moved[index] && !matches!(axis.told, Told::Tripped { .. }) {
                tripping.extend(u8::try_from(index));
            }
            *axis = axis.restarted();
            if axis.is_complete() {
                axis.told =
                    if moved[index] { Told::Tripped { confirmed: false } } else { Told::Stopping };
                self.owe_stop(index, Cause::Reset, now);
            }
        }
        self.history.started(self.starts, interrupted, tripping);
        self.unlisted = Some(Unlisted { moved, blank: false, e_stop_unsure });
    }

    /// The gateway begins anew, and has no memory but what is [stored](Self::stored).
    pub fn power_lost(&mut self, now: u64) {
        self.advance(now);
        self.starts = 1;
        self.sessions_end();
        self.silence_us = LINK_SILENCE_US;
        self.e_stopped = self.e_stop_open;
        self.buses.iter_mut().for_each(Bus::lose_power);
        self.axes.iter_mut().for_each(|axis| *axis = Axis::default());
        let moved = vec![false; self.axes.len()];
        self.history = History::blank();
        let blank = !self.loads(now);
        self.unlisted = Some(Unlisted { moved, blank, e_stop_unsure: false });
    }

    fn sessions_end(&mut self) {
        self.holder = None;
        self.links.iter_mut().for_each(|link| *link = Link::default());
    }

    /// Whether what has just been asked latches the e-stop or clears it.
    fn e_stop_may_change(&self, now: u64) -> bool {
        // The host may have been answered, and nobody told of what follows.
        let clears = |record: &Record| {
            (record.result.is_none() || record.at_us == now)
                && record.request == Request::Clear(Clears::Gateway)
        };
        self.e_stop_asked_us == Some(now)
            || self.links.iter().any(|link| link.records.iter().any(clears))
    }

    /// The gateway says how it is.
    pub(super) fn reported(&mut self, now: u64, request: &Request, report: Report) {
        match report {
            Report::Gateway { starts, e_stopped } => {
                if let Some(unlisted) = &mut self.unlisted
                    && std::mem::take(&mut unlisted.e_stop_unsure)
                {
                    self.e_stopped = e_stopped;
                }
                if starts != self.starts || self.e_stopped && !e_stopped {
                    let seen =
                        format!("{report:?}, {} starts, e-stop {}", self.starts, self.e_stopped);
                    self.broken(Check::ResetForgot, now, seen);
                }
            }
            Report::Bus { off, counters } => {
                if let Request::BusStatus(bus) = *request {
                    self.counted(now, bus, off, counters);
                }
            }
            Report::Axes(axes, false) => self.listed(now, &axes),
            Report::Axes(..) => {}
            Report::Incidents(incidents, next) => {
                let Request::ReadIncidents(first) = *request else { return };
                if let Err(seen) = self.history.read(first, incidents, next) {
                    self.broken(Check::HistoryWrong, now, seen);
                }
            }
        }
    }

    /// The first list of the axes after a start.
    fn listed(&mut self, now: u64, axes: &[Listed]) {
        let Some(Unlisted { moved, blank, .. }) = self.unlisted.take() else { return };
        if blank {
            if !axes.is_empty() {
                self.broken(Check::PowerLossKept, now, format!("{axes:?}"));
            }
            return;
        }
        for (index, moved) in moved.into_iter().enumerate() {
            let listed = axes.iter().find(|listed| usize::from(listed.axis) == index);
            let state = listed.map_or(Told::Unconfigured, |listed| listed.state);
            let axis = &self.axes[index];
            let is_the_same =
                !axis.is_complete() || listed.is_some_and(|listed| listed.wiring == axis.wiring());
            let is_kept = match state {
                Told::Unconfigured => !axis.is_complete(),
                Told::Idle | Told::Holding | Told::Stopping => !moved,
                Told::Arming | Told::Armed | Told::Active => false,
                Told::Tripped { .. } => true,
            };
            if !is_kept || !is_the_same {
                let seen = format!("axis {index} is {listed:?}, was in motion or tripped: {moved}");
                self.broken(Check::ResetForgot, now, seen);
            } else if state != axis.told {
                self.state(now, index, state);
            }
        }
    }
}
