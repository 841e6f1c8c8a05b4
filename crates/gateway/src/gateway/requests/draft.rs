//! The changes of the configuration that a host makes together: what each row becomes, until they
//! are made, and what it was, until they are kept.

use super::Result;
use crate::MAX_BUSES;
use crate::axes::Axes;
use crate::axis::Axis;
use crate::bus::Bus;
use crate::config::AxisConfig;
use crate::each::Each;
use crate::gateway::names::{NAME_WORDS, NameWords, Names};
use crate::gateway::stored::{AXIS_ROWS, BUS_ROWS};
use crate::set::Set;
use crate::time::Duration;
use crate::tracked::Tracked;
use core::ops::Range;
use heapless::Vec;
use host_protocol::{AxisParameter, BusConfig, Error, Value};
use serde::{Deserialize, Serialize, Serializer};

/// Changes of axis parameters and of words of names that a list holds: eleven for each of 32 axes.
const MOST: u16 = 352;

/// A list of changes. It belongs to the link in command, and is forgotten with its authority.
///
/// `parameters` comes last, as the axes do in `Axes`.
#[derive(Debug, Clone, Deserialize)]
#[repr(C)]
pub(crate) struct Draft {
    pub is_open: bool,
    /// What the silence that ends authority becomes, if it changes.
    pub silence: Option<Duration>,
    /// What each bus becomes, if it changes; nothing: it no longer runs.
    buses: [Option<Option<BusConfig>>; MAX_BUSES],
    parameters: Vec<Entry, { MOST as usize }>,
}

/// A parameter of an axis, or a word of the name of a row, and its value as bits, which is its new
/// one until it is exchanged. In bytes, so that there is nothing between two.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Entry {
    /// The axis, or the row.
    of: u8,
    /// The place of the parameter, and [`IS_SET`] where there is a value; that of the word, behind
    /// [`NAME`].
    place: u8,
    bits: [u8; 4],
}

const IS_SET: u8 = 0x80;
/// The places of the words of a name.
const NAME: u8 = 0x70;
const _: () = assert!(AxisParameter::ALL.len() <= NAME as usize, "a place leaves a bit free");
const _: () = assert!(NAME as usize + NAME_WORDS <= IS_SET as usize, "so does a word");

impl Entry {
    fn new(of: u8, place: usize, bits: Option<u32>) -> Self {
        let flag = if bits.is_some() { IS_SET } else { 0 };
        let place = u8::try_from(place).unwrap_or(u8::MAX) & !IS_SET;
        Self { of, place: place | flag, bits: bits.unwrap_or(0).to_le_bytes() }
    }

    /// The axis of which it is a parameter.
    fn axis(self) -> Option<u8> {
        self.word().is_none().then_some(self.of)
    }

    /// Which word it is of a name.
    fn word(self) -> Option<u8> {
        (self.place & !IS_SET).checked_sub(NAME)
    }

    /// Gives the configuration this value, and returns the change that takes it back.
    fn exchange(self, config: &mut AxisConfig) -> Self {
        let place = usize::from(self.place & !IS_SET);
        let bits = (self.place & IS_SET != 0).then_some(u32::from_le_bytes(self.bits));
        Self::new(self.of, place, config.exchange(place, bits))
    }
}

impl Draft {
    /// Into how many pieces a snapshot divides it.
    pub const PIECES: usize = 9;

    /// A piece of it in a snapshot. All, one behind the other, are what its `Deserialize` reads.
    pub fn piece<S: Serializer>(&self, piece: usize, to: S) -> Result<S::Ok, S::Error> {
        const THESE: usize = (MOST as usize).div_ceil(Draft::PIECES - 1);
        let Draft { is_open, silence, buses, parameters } = self;
        let Some(behind) = piece.checked_sub(1) else {
            return (is_open, silence, buses, parameters.len()).serialize(to);
        };
        Each(|| parameters.iter().skip(behind * THESE).take(THESE)).serialize(to)
    }

    pub const fn new() -> Self {
        Self { is_open: false, silence: None, buses: [None; MAX_BUSES], parameters: Vec::new() }
    }

    /// Begins an empty list.
    pub fn open(&mut self) {
        self.close();
        self.is_open = true;
    }

    /// Forgets the list.
    pub fn close(&mut self) {
        self.is_open = false;
        self.silence = None;
        self.buses = [None; MAX_BUSES];
        self.parameters.clear();
    }

    pub fn set_bus(&mut self, bus: u8, config: Option<BusConfig>) {
        if let Some(place) = self.buses.get_mut(usize::from(bus)) {
            *place = Some(config);
        }
    }

    /// Adds a parameter, whose value has been checked.
    pub fn set_parameter(
        &mut self,
        axis: u8,
        parameter: AxisParameter,
        value: Option<Value>,
    ) -> Result<()> {
        let entry = Entry::new(axis, parameter.place(), value.map(crate::config::to_bits));
        self.parameters.push(entry).map_err(|_| Error::TooManyChanges { most: MOST })
    }

    /// Adds what differs of the name of a row, instead of what was added for it before.
    pub fn set_name(&mut self, names: &Names, row: usize, words: NameWords) -> Result<()> {
        let of = u8::try_from(row).unwrap_or(u8::MAX);
        self.parameters.retain(|entry| entry.word().is_none() || entry.of != of);
        let both = words.into_iter().zip(names.words(row));
        for (word, (new, old)) in (usize::from(NAME)..).zip(both) {
            if new != old {
                let entry = Entry::new(of, word, Some(new));
                let full = |_| Error::TooManyChanges { most: MOST };
                self.parameters.push(entry).map_err(full)?;
            }
        }
        Ok(())
    }

    /// Of these rows those whose name changes, from 0.
    pub fn named(&self, rows: Range<usize>) -> Set {
        let words = self.parameters.iter().filter(|entry| entry.word().is_some());
        let index = |entry: &Entry| usize::from(entry.of).checked_sub(rows.start);
        words.filter_map(index).filter(|index| *index < rows.len()).collect()
    }

    /// Whether the gateway's name changes.
    pub fn names_gateway(&self) -> bool {
        !self.named(0..BUS_ROWS.start).is_empty()
    }

    /// The axes of which a parameter or the name changes.
    pub fn axis_rows(&self) -> Set {
        self.axes().with(self.named(AXIS_ROWS))
    }

    /// The buses that change, and those whose name does.
    pub fn bus_rows(&self) -> Set {
        self.buses().with(self.named(BUS_ROWS))
    }

    /// The axes of which a parameter changes.
    pub fn axes(&self) -> Set {
        self.parameters.iter().filter_map(|entry| entry.axis()).collect()
    }

    /// The buses that change.
    pub fn buses(&self) -> Set {
        let changed = self.buses.iter().enumerate().filter(|(_, change)| change.is_some());
        changed.map(|(bus, _)| bus).collect()
    }

    /// How many axes and buses change, and of the gateway its silence and its name, which a reset
    /// can part.
    pub fn rows(&self) -> u32 {
        let of_gateway = u32::from(self.silence.is_some()) + u32::from(self.names_gateway());
        self.axis_rows().len() + self.bus_rows().len() + of_gateway
    }

    /// What a bus becomes; nothing where it does not change.
    pub fn bus(&self, bus: u8) -> Option<Option<BusConfig>> {
        self.buses.get(usize::from(bus)).copied().flatten()
    }

    /// What the configuration of an axis becomes.
    pub fn config_of(&self, axis: &Axis) -> AxisConfig {
        let mut config = axis.config.clone();
        for entry in self.parameters.iter().filter(|entry| entry.axis() == Some(axis.index)) {
            entry.exchange(&mut config);
        }
        config
    }

    /// Gives axes and buses their new configuration and names, and keeps those of before, the last
    /// one first: another exchange takes this one back.
    pub fn exchange(&mut self, axes: &mut Axes, buses: &mut [Tracked<Bus>], names: &mut Names) {
        self.parameters.iter_mut().for_each(|entry| exchange(entry, axes, names));
        self.parameters.reverse();
        for (change, bus) in self.buses.iter_mut().zip(buses) {
            if let Some(config) = change {
                bus.exchange_config(config);
            }
        }
    }
}

fn exchange(entry: &mut Entry, axes: &mut Axes, names: &mut Names) {
    if let Some(word) = entry.word() {
        let bits = u32::from_le_bytes(entry.bits);
        entry.bits = names.exchange(entry.of.into(), word.into(), bits).to_le_bytes();
    } else if let Some(axis) = axes.get_mut(usize::from(entry.of)) {
        *entry = entry.exchange(&mut axis.config);
    }
}
