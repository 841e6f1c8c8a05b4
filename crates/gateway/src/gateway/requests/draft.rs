//! The changes of the configuration that a host makes together: what each row becomes, until they
//! are made, and what it was, until they are kept.

use super::Result;
use crate::MAX_BUSES;
use crate::axes::Axes;
use crate::axis::Axis;
use crate::bus::Bus;
use crate::config::AxisConfig;
use crate::set::Set;
use crate::time::Duration;
use heapless::Vec;
use host_protocol::{AxisParameter, BusConfig, Error, Value};

/// Changes of axis parameters that a list holds: ten for each of 32 axes.
const MOST: u16 = 320;

/// A list of changes. It belongs to the link in command, and is forgotten with its authority.
///
/// `parameters` comes last, as the axes do in `Axes`.
#[derive(Debug, Clone)]
#[repr(C)]
pub(crate) struct Draft {
    is_open: bool,
    silence: Option<Duration>,
    /// What each bus becomes, if it changes; nothing: it no longer runs.
    buses: [Option<Option<BusConfig>>; MAX_BUSES],
    parameters: Vec<Entry, { MOST as usize }>,
}

/// A parameter of an axis, and its value as bits, which is its new one until it is exchanged. In
/// bytes, so that there is nothing between two.
#[derive(Debug, Clone, Copy)]
struct Entry {
    axis: u8,
    /// Its place, and [`IS_SET`] where there is a value.
    place: u8,
    bits: [u8; 4],
}

const IS_SET: u8 = 0x80;
const _: () = assert!(AxisParameter::ALL.len() <= IS_SET as usize, "a place leaves a bit free");

impl Entry {
    fn new(axis: u8, place: usize, bits: Option<u32>) -> Self {
        let flag = if bits.is_some() { IS_SET } else { 0 };
        let place = u8::try_from(place).unwrap_or(u8::MAX) & !IS_SET;
        Self { axis, place: place | flag, bits: bits.unwrap_or(0).to_le_bytes() }
    }

    /// Gives the configuration this value, and returns the change that takes it back.
    fn exchange(self, config: &mut AxisConfig) -> Self {
        let place = usize::from(self.place & !IS_SET);
        let bits = (self.place & IS_SET != 0).then_some(u32::from_le_bytes(self.bits));
        Self::new(self.axis, place, config.exchange(place, bits))
    }
}

impl Draft {
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

    pub fn is_open(&self) -> bool {
        self.is_open
    }

    pub fn set_silence(&mut self, silence: Duration) {
        self.silence = Some(silence);
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

    pub fn silence(&self) -> Option<Duration> {
        self.silence
    }

    /// The axes of which a parameter changes.
    pub fn axes(&self) -> Set {
        let mut axes = Set::NONE;
        self.parameters.iter().for_each(|entry| axes.add(Set::of(entry.axis)));
        axes
    }

    /// The buses that change.
    pub fn buses(&self) -> Set {
        let mut buses = Set::NONE;
        for (bus, change) in self.buses.iter().enumerate() {
            buses.put(Set::of(bus), change.is_some());
        }
        buses
    }

    /// How many axes, buses and gateways change.
    pub fn rows(&self) -> u32 {
        let sets = [self.axes(), self.buses()].map(|set| set.bits().count_ones());
        sets.iter().sum::<u32>() + u32::from(self.silence.is_some())
    }

    /// What a bus becomes; nothing where it does not change.
    pub fn bus(&self, bus: u8) -> Option<Option<BusConfig>> {
        self.buses.get(usize::from(bus)).copied().flatten()
    }

    /// What the configuration of an axis becomes.
    pub fn config_of(&self, axis: &Axis) -> AxisConfig {
        let mut config = axis.config.clone();
        for entry in self.parameters.iter().filter(|entry| entry.axis == axis.index) {
            entry.exchange(&mut config);
        }
        config
    }

    /// Gives axes and buses their new configuration, and keeps that of before.
    pub fn exchange(&mut self, axes: &mut Axes, buses: &mut [Bus]) {
        self.parameters.iter_mut().for_each(|entry| exchange(entry, axes));
        self.exchange_buses(buses);
    }

    /// Takes an exchange back.
    pub fn exchange_back(&mut self, axes: &mut Axes, buses: &mut [Bus]) {
        self.parameters.iter_mut().rev().for_each(|entry| exchange(entry, axes));
        self.exchange_buses(buses);
    }

    fn exchange_buses(&mut self, buses: &mut [Bus]) {
        for (change, bus) in self.buses.iter_mut().zip(buses) {
            if let Some(config) = change {
                bus.exchange_config(config);
            }
        }
    }
}

fn exchange(entry: &mut Entry, axes: &mut Axes) {
    if let Some(axis) = axes.get_mut(usize::from(entry.axis)) {
        *entry = entry.exchange(&mut axis.config);
    }
}
