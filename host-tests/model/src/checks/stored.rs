//! What is stored of the configuration (G6): written only while everything is at rest, whole or not
//! at all, and what counts after a loss of power.

use crate::axis::{Axis, Cause};
use crate::bus::Bus;
use crate::oracle::Oracle;
use crate::violation::Check;
use crate::wire::{BusSetting, Told};

/// A configuration, as the hosts were told that it is.
#[derive(Debug, Clone)]
pub(crate) struct Configuration {
    silence_us: u64,
    buses: Vec<BusSetting>,
    axes: Vec<Axis>,
}

/// What outlives a loss of power.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stored {
    kept: Option<Configuration>,
    /// What takes its place once it is written; nothing, where it is to be forgotten.
    written: Option<Option<Configuration>>,
}

impl Oracle {
    /// The gateway gives out what is to be stored: its configuration, or nothing any more.
    pub fn stores(&mut self, now: u64, keeps: bool) {
        self.check_stored(now, Axis::needs_its_bus);
        let configuration = keeps.then(|| Configuration {
            silence_us: self.silence_us,
            buses: self.buses.iter().map(Bus::setting).collect(),
            axes: self.axes.iter().map(Axis::configured).collect(),
        });
        self.stored.written = Some(configuration);
    }

    /// The storage has written it, or has not and holds what it held before.
    pub fn stored(&mut self, now: u64, done: bool) {
        // A stop goes out all the same.
        self.check_stored(now, |axis| {
            matches!(axis.told, Told::Arming | Told::Armed | Told::Active)
        });
        let Some(written) = self.stored.written.take() else { return };
        if done {
            self.stored.kept = written;
        }
    }

    /// The flash may hold the processor up.
    fn check_stored(&mut self, now: u64, moves: impl Fn(&Axis) -> bool) {
        if let Some(axis) = self.axes.iter().find(|axis| moves(axis)) {
            let seen = format!("the configuration is stored while an axis is {:?}", axis.told);
            self.broken(Check::StoredInMotion, now, seen);
        }
    }

    /// What is stored is the configuration after a loss of power, and each axis is stopped first.
    /// Whether something is.
    pub(super) fn loads(&mut self, now: u64) -> bool {
        let Some(Configuration { silence_us, buses, axes }) = self.stored.kept.clone() else {
            return false;
        };
        self.silence_us = silence_us;
        for (index, setting) in (0..).zip(buses) {
            self.bus_changed(now, index, Some(setting));
        }
        self.axes = axes;
        self.note_extended();
        for index in 0..self.axes.len() {
            if self.axes[index].is_complete() {
                self.axes[index].told = Told::Stopping;
                self.owe_stop(index, Cause::Reset, now);
            }
        }
        true
    }
}
