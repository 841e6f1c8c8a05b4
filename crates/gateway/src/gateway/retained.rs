//! What outlives a reset: the axis table, who was in motion, tripped or unreachable, and the
//! history (GUARANTEES G6, G8).
//!
//! The core says which words to keep and reads them back; the caller stores them in memory
//! that a start does not clear. A board that is reset in mid-motion therefore knows its motors, and
//! stops them before any host speaks.
//!
//! There is one order, and no port can choose another: [`Gateway::handle`] takes in an event and
//! stores the states and configurations that it has changed, so that they are stored when a frame
//! that follows from it can be taken; [`Gateway::poll_host`] stores the history too before it tells
//! a host anything, unless [`Gateway::save_some`] has done so. A reset between any two of these
//! steps finds each axis that a frame can have set in motion, and all that a host has been told.

mod layout;
mod slot;
mod states;

pub use layout::RETAINED_WORDS;

use crate::axis::{Axis, Is};
use crate::bus_rules;
use crate::config::AxisConfig;
use crate::filled::filled;
use crate::gateway::Gateway;
use crate::gateway::names::{NAME_WORDS, NameWords};
use crate::gateway::requests::{Result, running_bus};
use crate::gateway::stored::{AXIS_ROWS, BUS_ROWS};
use crate::history::{History, INCIDENTS};
use crate::log::LogEntry;
use crate::outbox::Outbox;
use crate::port::Store;
use crate::set::Set;
use crate::time::{Duration, Instant};
use crate::{MAX_AXES_WIRE, MAX_BUSES};
use host_protocol::{BusConfig, Change, Incident, ProtocolSet, Subject, TripReason};
use layout::{Place, SLOTS, WRITING_AT};
use serde::{Deserialize, Serialize};
use serde_big_array::BigArray;
use slot::{Condition, Found};
use states::{E_STOPPED, MIXED, States};

/// Words of an axis: its configuration, the timeout last written to its motor, ms, its name.
const AXIS_WORDS: usize = AxisConfig::WORDS + 1 + NAME_WORDS;

/// Words of a bus: bitrate (0 where it is not configured), protocols, whether it is exclusive,
/// reply window, its name.
const BUS_WORDS: usize = 4 + NAME_WORDS;

/// Incidents of one part: each takes some µs for its checksum.
const INCIDENTS_AT_ONCE: usize = 2;

/// What has been saved, and what has changed since.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Retention {
    /// The generation last written of each slot.
    #[serde(with = "BigArray")]
    generations: [u32; SLOTS],
    /// Axes configured anew, or whose motor was.
    axes: Set,
    /// Buses configured anew.
    buses: Set,
    /// The gateway has another name.
    gateway: bool,
    states: States,
    /// Several rows have changed together, or damage is mended: a reset that leaves some rows as
    /// before is noticed.
    pub together: bool,
    /// Nothing is left to save: the history has every trip, and the states say so.
    pub is_complete: bool,
    /// What the memory is: unknown before it is restored or written.
    memory: Memory,
    /// A word of what a reset should have left alone had changed at this start.
    pub is_damaged: bool,
    /// Places of the history that hold nothing readable.
    lost_incidents: Set,
    /// Axes and buses of which nothing readable was left, and that nobody has configured since.
    lost_axes: Set,
    lost_buses: Set,
}

/// What is in the memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Memory {
    /// Anything: the power was off, or another firmware wrote it.
    Foreign,
    /// What a run before has left, the slot that it was writing with it.
    Restored { writing: u32 },
    /// What this run has written, and what it needs of the run before.
    Ours,
}

impl Retention {
    /// Whether the memory has words of a run, the one before or this one.
    pub fn is_of_a_run(&self) -> bool {
        self.memory != Memory::Foreign
    }

    pub const fn new() -> Self {
        Self {
            generations: [0; SLOTS],
            axes: Set::NONE,
            buses: Set::NONE,
            gateway: false,
            states: States::NONE,
            together: false,
            is_complete: false,
            memory: Memory::Foreign,
            is_damaged: false,
            lost_incidents: Set::NONE,
            lost_axes: Set::NONE,
            lost_buses: Set::NONE,
        }
    }

    /// These rows have changed: axes, buses, and the name of the gateway.
    pub fn changed(&mut self, axes: Set, buses: Set, gateway: bool) {
        self.axes.add(axes);
        self.buses.add(buses);
        self.lost_buses.put(buses, false);
        self.gateway |= gateway;
    }

    /// Whether the axis was lost. It is known again.
    pub fn take_lost(&mut self, axis: u8) -> bool {
        let lost = self.lost_axes;
        self.lost_axes = lost.without(Set::of(axis));
        lost != self.lost_axes
    }

    /// Whether an axis or a bus is lost: a motor that nobody knows of may be in motion.
    pub fn has_lost(&self) -> bool {
        !self.lost_axes.with(self.lost_buses).is_empty()
    }

    /// Whether it is the row that this changes.
    pub fn has_lost_of(&self, change: &Change) -> bool {
        match change {
            Change::Axis { axis, .. } | Change::Name { of: Subject::Axis(axis), .. } => {
                self.lost_axes.has(*axis)
            }
            Change::Bus { bus, .. } | Change::Name { of: Subject::Bus(bus), .. } => {
                self.lost_buses.has(*bus)
            }
            _ => false,
        }
    }

    /// A person says that all is well.
    pub fn forget_lost(&mut self) {
        (self.lost_axes, self.lost_buses) = (Set::NONE, Set::NONE);
    }

    fn write(&mut self, place: Place, payload: &[u32], store: Store<'_>) {
        if let Some(generation) = self.generations.get_mut(place.index()) {
            *generation = generation.wrapping_add(1);
            // Until damage is mended, a slot that a reset cuts short counts as damaged too.
            let is_mending = self.is_damaged && self.memory != Memory::Ours;
            store(WRITING_AT, if is_mending { 0 } else { place.writing() });
            place.slot().write(*generation, payload, store);
            store(WRITING_AT, 0);
        }
    }

    /// Makes the memory such that what is written to it can be read again: once, before the first
    /// word.
    fn prepare(&mut self, store: Store<'_>) {
        match self.memory {
            Memory::Foreign => layout::clear(store),
            Memory::Restored { .. } => {
                for index in (0..INCIDENTS).filter(|index| self.lost_incidents.has(*index)) {
                    let place = Place::Incident(index);
                    store(WRITING_AT, place.writing());
                    place.slot().erase(store);
                }
                store(WRITING_AT, 0);
            }
            Memory::Ours => {}
        }
    }

    /// What the memory holds can be read from now on: a mark that came before it would speak for
    /// what is not there yet, and what is stored elsewhere would not be looked for.
    fn make_ours(&mut self, store: Store<'_>) {
        if self.memory != Memory::Ours {
            layout::mark(store);
            self.memory = Memory::Ours;
        }
    }

    fn write_states(&mut self, states: States, store: Store<'_>) {
        if states != self.states {
            self.states = states;
            self.write(Place::States, &states.words(), store);
        }
    }

    /// The payload of a slot, whose generation is taken over. One whose copies are not both as they
    /// should be is to be written again.
    fn read<'a>(&mut self, place: Place, words: &'a [u32]) -> Option<&'a [u32]> {
        let torn = self.memory == Memory::Restored { writing: place.writing() };
        let Found { newest, condition } = place.slot().read(words, torn);
        self.is_damaged |= condition == Condition::Damaged;
        let is_lost = newest.is_none() && condition == Condition::Damaged;
        let lost = |index: usize| if is_lost { Set::of(index) } else { Set::NONE };
        if condition != Condition::Sound {
            match place {
                // Each start counts itself there.
                Place::States => {}
                Place::Axis(axis) => {
                    self.axes.add(Set::of(axis));
                    self.lost_axes.add(lost(axis));
                }
                Place::Bus(bus) => {
                    self.buses.add(Set::of(bus));
                    self.lost_buses.add(lost(bus));
                }
                Place::Gateway => self.gateway = true,
                Place::Incident(index) => self.lost_incidents.add(Set::of(index)),
            }
        }
        let (generation, payload) = newest?;
        *self.generations.get_mut(place.index())? = generation;
        Some(payload)
    }
}

impl Gateway {
    /// Stores what the next start must know before any frame leaves that follows from what has just
    /// happened: configurations, the e-stop, and who may move. A trip is short of its place in
    /// the history then, so what has tripped counts as in motion until
    /// [`save_some`](Self::save_some) has stored that too.
    pub(crate) fn save_states(&mut self, store: Store<'_>) {
        // Before anything is mended: another reset must find that there was damage.
        if core::mem::take(&mut self.retention.together) {
            let mut states = self.states(self.retention.states.tripped);
            states.flags |= MIXED;
            self.retention.write_states(states, store);
        }
        self.retention.prepare(store);
        self.save_configurations(store);
        let states = self.states(self.retention.states.tripped);
        let unrecorded = self.axes.which(Is::Tripped).without(states.tripped);
        self.retention.is_complete = !self.history.has_unsaved() && unrecorded.is_empty();
        self.retention.write_states(states, store);
        self.retention.make_ours(store);
    }

    /// Whether [`save_some`](Self::save_some) has something to store.
    pub fn has_more_to_save(&self) -> bool {
        !self.retention.is_complete
    }

    /// Stores a part of what [`handle`](Self::handle) has left for later: the history, and what has
    /// tripped. Returns whether that was all. [`poll_host`](Self::poll_host) stores the rest
    /// before it says anything; a caller that calls this before, when there is time, spares the
    /// next event a long wait after many trips.
    pub fn save_some(&mut self, store: Store<'_>) -> bool {
        if !self.has_more_to_save() {
            return true;
        }
        self.remember_trips();
        self.settle(self.now);
        for _ in 0..INCIDENTS_AT_ONCE {
            let Some((index, words)) = self.history.take_unsaved() else { break };
            self.retention.write(Place::Incident(index), &words, store);
        }
        if self.history.has_unsaved() {
            return false;
        }
        let states = self.states(Set::ALL);
        self.retention.write_states(states, store);
        self.retention.is_complete = true;
        true
    }

    /// Those that have changed; that of an axis also when its motor was told what is kept with it.
    /// What is lost stays damaged until it is known again, or a person says that all is well.
    fn save_configurations(&mut self, store: Store<'_>) {
        let Self { retention, axes, buses, names, .. } = self;
        let unsaved = axes.which(Is::Unsaved);
        let rows = unsaved.with(retention.axes).with(retention.buses);
        if rows.is_empty() && !retention.gateway {
            return;
        }
        axes.each(unsaved, |axis| axis.is_unsaved = false);
        let new_axes = retention.axes.take().with(unsaved).without(retention.lost_axes);
        let new_buses = retention.buses.take().without(retention.lost_buses);
        (retention.axes, retention.buses) = (retention.lost_axes, retention.lost_buses);
        for axis in axes.of(new_axes) {
            let name = names.words(AXIS_ROWS.start + usize::from(axis.index));
            retention.write(Place::Axis(axis.index.into()), &axis_words(axis, name), store);
        }
        for index in new_buses {
            let name = names.words(BUS_ROWS.start + index);
            let config = buses.get(index).and_then(|bus| bus.config());
            retention.write(Place::Bus(index), &bus_words(config, name), store);
        }
        if core::mem::take(&mut retention.gateway) {
            retention.write(Place::Gateway, &names.words(0), store);
        }
    }

    /// The states as they are. What has tripped counts as in motion, except for these axes.
    fn states(&self, in_history: Set) -> States {
        let which = |is| self.axes.which(is);
        let tripped = which(Is::Tripped).and(in_history);
        States {
            starts: self.starts,
            // What holds goes on holding: after a reset each axis is sent its stop action.
            moving: which(Is::Moving).with(self.unstopped.axes()).without(tripped),
            tripped,
            unreachable: which(Is::Unreachable),
            flags: if self.e_stopped { E_STOPPED } else { 0 },
            silence_us: self.authority.silence.as_micros_u32(),
        }
    }

    /// Whether these words tell what a reset has left of a run before: its configuration then
    /// counts, and what is stored may be loaded later.
    pub fn is_remembered(words: &[u32]) -> bool {
        layout::is_ours(words)
    }

    /// Takes over what was saved before a reset; once, before any event. `words` are those of the
    /// memory, empty after power came on. Every configured axis is stopped: what may have been
    /// in motion trips with [`TripReason::Reset`], what was tripped stays so, and unreachable
    /// if it was; the others are stopped to be sure. What the memory holds is believed only where
    /// its checksum is right and it would be accepted as a configuration.
    ///
    /// | what is found | e-stop | axes |
    /// |---|---|---|
    /// | no words, as the power was off | not latched | none |
    /// | words without the mark of this layout: power was off unnoticed, or another firmware wrote them | not latched | none |
    /// | every slot sound, or cut short by the reset | as it was | as they were |
    /// | rows changed together, stored in part | latched | all that are configured trip |
    /// | a damaged copy of any slot | latched | all that are configured trip |
    /// | a bus that the board cannot run now | as it was | what was in motion or tripped there is unreachable |
    ///
    /// Both copies of a slot say the same, so one that is damaged costs no configuration. Where
    /// both are, the axis or bus is lost: the latched e-stop says that something is, and the enable
    /// output stays inactive until [`load`](Self::load) finds it in what is stored, a host
    /// configures it, or a person clears the e-stop. If another reset comes before all of this is
    /// stored, the next start finds the damage, or rows in part.
    pub fn restore(&mut self, now: Instant, words: &[u32]) {
        let words = if layout::is_ours(words) { words } else { &[] };
        if let Some(writing) = words.get(WRITING_AT) {
            self.retention.memory = Memory::Restored { writing: *writing };
        }
        let states = self.retention.read(Place::States, words).and_then(States::from_words);
        let mut states = states.unwrap_or(States::NONE);
        self.retention.is_damaged |= states.flags & MIXED != 0;
        *self.history =
            History::restored(|index| self.retention.read(Place::Incident(index), words));
        self.retention.lost_incidents = self.history.save_again(self.retention.lost_incidents);
        self.restore_buses(now, words);
        self.restore_axes(words);
        if let Some(name) = self.retention.read(Place::Gateway, words) {
            self.restore_name(Subject::Gateway, name);
        }
        if self.retention.is_damaged {
            self.retention.together = true;
            self.links.log(LogEntry::MemoryDamaged);
            states.flags |= E_STOPPED;
            states.moving.add(Set::ALL.without(states.tripped));
        }
        if states.silence_us != 0 {
            self.authority.silence = Duration::from_micros(u64::from(states.silence_us));
        }
        self.e_stopped = states.flags & E_STOPPED != 0;
        self.starts = states.starts.saturating_add(1);
        let (start, boot) = (self.starts, self.board.boot);
        self.history.push(Incident::Started {
            start,
            boot,
            has_crash_report: !self.board.crash_report.is_empty(),
        });
        self.measure_configuration();
        self.stop_after_reset(now, states);
        self.remember_trips();
    }

    fn restore_buses(&mut self, now: Instant, words: &[u32]) {
        for bus in (0u8..).take(MAX_BUSES) {
            let payload = self.retention.read(Place::Bus(bus.into()), words);
            let Some((config, name)) = payload.and_then(bus_from_words) else { continue };
            // One that this firmware refuses is left unconfigured, and its axes with it.
            if self.restore_unserved(bus, config).is_none() {
                let _ = self.change(now, &Change::Bus { bus, config: Some(config) });
            }
            self.restore_name(Subject::Bus(bus), name);
        }
    }

    /// Takes over the configuration of a bus that the board cannot run now, where it is one of
    /// those, so that its axes stay known. Its bitrate is not offered now either.
    pub(super) fn restore_unserved(&mut self, bus: u8, config: BusConfig) -> Option<Result<()>> {
        let unserved = self.buses.get_mut(usize::from(bus)).filter(|bus| bus.is_unserved())?;
        let bitrates = [config.bitrate];
        let fits = bus_rules::check_bus_config(bus, unserved.kind(), &bitrates, &config);
        if fits.is_ok() {
            unserved.restore_unserved(config, &self.axes);
            self.retention.changed(Set::NONE, Set::of(bus), false);
            self.measure(Set::of(bus), Set::NONE, false);
        }
        Some(fits)
    }

    fn restore_axes(&mut self, words: &[u32]) {
        for axis in 0..MAX_AXES_WIRE {
            let payload = self.retention.read(Place::Axis(axis.into()), words);
            if let Some((config, timeout_ms, name)) = payload.and_then(axis_from_words) {
                self.restore_axis(axis, config, timeout_ms);
                self.restore_name(Subject::Axis(axis), name);
            }
        }
    }

    fn stop_after_reset(&mut self, now: Instant, states: States) {
        let Self { axes, buses, links, history, .. } = self;
        let mut out = Outbox::new(now, links);
        let unserved = |axis: &Axis| {
            let bus = axis.config.bus().and_then(|bus| buses.get(usize::from(bus)));
            bus.is_some_and(|bus| bus.is_unserved())
        };
        axes.each(axes.which(Is::Configured), |axis| {
            let was_tripped = states.tripped.has(axis.index);
            if was_tripped || states.moving.has(axis.index) {
                let known = if was_tripped { history.last_trip_of(axis.index) } else { None };
                let reason = known.unwrap_or(TripReason::Reset);
                let unreachable = states.unreachable.has(axis.index);
                axis.trip_after_reset(now, reason, unreachable, &mut out);
                if unserved(axis) {
                    axis.stop_not_sent(now, &mut out);
                }
                if was_tripped {
                    // It stands in the history already.
                    let _ = axis.take_unrecorded_trip();
                }
            } else {
                axis.halt(now, &mut out);
            }
        });
        self.settle(now);
    }

    /// Whether an axis on a bus that runs has still to see its first stop leave: after a start no
    /// host link is opened before, at most 100 ms.
    pub fn stops_under_way(&self) -> bool {
        let runs = |axis: &Axis| running_bus(&self.buses, axis).is_ok_and(|bus| bus.is_some());
        !self.unstopped.is_empty() || self.axes.of(self.axes.which(Is::FirstStop)).any(runs)
    }
}

/// The words of an axis: its configuration, the timeout last written to its motor, its name.
fn axis_words(axis: &Axis, name: NameWords) -> [u32; AXIS_WORDS] {
    filled(axis.config.to_words().into_iter().chain([axis.told_word()]).chain(name))
}

fn axis_from_words(words: &[u32]) -> Option<(AxisConfig, u32, &[u32])> {
    let (config, [timeout_ms, name @ ..]) = words.split_at_checked(AxisConfig::WORDS)? else {
        return None;
    };
    Some((AxisConfig::from_words(config).ok()?, *timeout_ms, name))
}

fn bus_words(config: Option<&BusConfig>, name: NameWords) -> [u32; BUS_WORDS] {
    let [a, b, c, d] = name;
    config.map_or([0; BUS_WORDS], |config| {
        let BusConfig { bitrate, protocols, exclusive, reply_window_us } = *config;
        let (protocols, exclusive) = (u32::from(protocols.bits()), u32::from(exclusive));
        [bitrate, protocols, exclusive, reply_window_us, a, b, c, d]
    })
}

fn bus_from_words(words: &[u32]) -> Option<(BusConfig, &[u32])> {
    let [bitrate, protocols, exclusive, reply_window_us, ref name @ ..] = *words else {
        return None;
    };
    if bitrate == 0 {
        return None;
    }
    let protocols = ProtocolSet::from_bits(u8::try_from(protocols).ok()?);
    Some((BusConfig { bitrate, protocols, exclusive: exclusive != 0, reply_window_us }, name))
}

#[cfg(test)]
#[path = "../../tests/unit/retained.rs"]
mod tests;
