//! Changing the configuration: all changes are made, and taken back where the whole does not fit
//! together. A single change is a list of one.

use super::Result;
use crate::axis::Axis;
use crate::bus::{Bus, check_load};
use crate::bus_rules;
use crate::config::{Address, AxisConfig};
use crate::gateway::Gateway;
use crate::outbox::Outbox;
use crate::protocol;
use crate::rules;
use crate::set::Set;
use crate::time::{Duration, Instant};
use host_protocol::{
    AxisParameter, AxisState, BusKind, Change, Error, GatewayParameter, StopAction, TripReason,
    Value,
};

impl Gateway {
    pub(crate) fn remove_axis(&mut self, now: Instant, axis: u8) -> Result<()> {
        // Where there is no such axis, a list that is open stays.
        self.axis(axis)?;
        self.draft.open();
        for parameter in AxisParameter::ALL.iter().copied() {
            if self.axis(axis)?.config.is_set(parameter) {
                self.draft.set_parameter(axis, parameter, None)?;
            }
        }
        self.apply_changes(now)
    }

    pub(crate) fn change(&mut self, now: Instant, change: &Change) -> Result<()> {
        self.draft.open();
        self.add_changes(core::slice::from_ref(change))?;
        self.apply_changes(now)
    }

    /// Adds changes to the list, or forgets it.
    pub(crate) fn add_changes(&mut self, changes: &[Change]) -> Result<()> {
        let result = changes.iter().try_for_each(|change| self.add_change(change));
        if result.is_err() {
            self.draft.close();
        }
        result
    }

    fn add_change(&mut self, change: &Change) -> Result<()> {
        if !self.draft.is_open {
            return Err(Error::NoChangesBegun {});
        }
        match *change {
            Change::Gateway { parameter, value } => {
                let unknown = Error::UnknownParameter { parameter };
                let known = GatewayParameter::from_number(parameter).ok_or(unknown)?;
                known.check(value)?;
                match (known, value) {
                    (GatewayParameter::LinkSilenceUs, Value::Unsigned(us)) => {
                        self.draft.silence = Some(Duration::from_micros(u64::from(us)));
                    }
                    _ => return Err(Error::WrongType { parameter }),
                }
                Ok(())
            }
            Change::Bus { bus, config } => {
                let port = self.bus(bus)?;
                if let Some(config) = &config {
                    let bitrates = port.port().bitrates;
                    bus_rules::check_bus_config(bus, port.kind(), bitrates, config)?;
                }
                self.draft.set_bus(bus, config);
                Ok(())
            }
            Change::Axis { axis, parameter, value } => {
                let unknown = Error::UnknownParameter { parameter };
                let parameter = AxisParameter::from_number(parameter).ok_or(unknown)?;
                self.axis(axis)?;
                value.map_or(Ok(()), |value| parameter.check(value))?;
                self.draft.set_parameter(axis, parameter, value)
            }
            Change::Name { of, ref name } => self.add_name(of, name.as_deref()),
        }
    }

    /// The value in force of a parameter of the gateway.
    pub(crate) fn gateway_parameter(&self, parameter: u16) -> Result<Value> {
        match GatewayParameter::from_number(parameter) {
            Some(GatewayParameter::LinkSilenceUs) => {
                Ok(Value::Unsigned(self.authority.silence.as_micros_u32()))
            }
            None => Err(Error::UnknownParameter { parameter }),
        }
    }

    /// Makes all changes of the list, or none; the list is forgotten.
    pub(crate) fn apply_changes(&mut self, now: Instant) -> Result<()> {
        let result = self.make_changes(now);
        self.draft.close();
        result
    }

    fn make_changes(&mut self, now: Instant) -> Result<()> {
        if !self.draft.is_open {
            return Err(Error::NoChangesBegun {});
        }
        let reach = self.check_states()?;
        self.exchange_draft();
        if let Err(error) = self.check_changed(&reach).and_then(|()| self.check_names()) {
            self.exchange_draft();
            return Err(error);
        }
        self.take_changes_over(now, &reach);
        let Self { draft, retention, .. } = self;
        let (axes, buses, is_named) = (draft.axis_rows(), draft.bus_rows(), draft.names_gateway());
        let gateway = is_named || draft.silence.is_some();
        retention.changed(axes, buses, is_named);
        self.measure(buses, axes, gateway);
        Ok(())
    }

    /// What is configured takes the place of the changes, and the other way round; how long others
    /// wait on the buses follows.
    fn exchange_draft(&mut self) {
        let Self { draft, axes, buses, names, .. } = self;
        draft.exchange(axes, buses, names);
        self.settle(self.now);
        let Self { draft, axes, buses, .. } = self;
        buses
            .iter_mut()
            .filter(|bus| draft.bus(bus.index()).is_some())
            .for_each(|bus| bus.measure(axes));
    }

    /// Refuses the changes while what they change is in use. Returns what they reach.
    fn check_states(&self) -> Result<Reach> {
        if self.draft.rows() > 1 {
            self.refuse_while_moving()?;
        }
        let mut reach = Reach::default();
        for axis in self.axes.of(self.draft.axes()) {
            let config = self.draft.config_of(axis);
            self.check_state(axis, &config)?;
            let one = Set::of(axis.index);
            reach.moved.put(one, is_moved(&axis.config, &config));
            reach.same.put(one, config.address() == axis.config.address());
            reach.buses.add(buses_of(&axis.config, &config));
        }
        for index in self.draft.buses() {
            let Some(bus) = self.buses.get(index) else { continue };
            if bus.is_borrowed() {
                return Err(Error::RawOpen { bus: bus.index() });
            }
            let config = self.draft.bus(bus.index()).flatten();
            // One that does not run keeps the stops that are owed there.
            let here = |axis: &&Axis| {
                axis.config.bus().map(usize::from) == Some(index) && bus.config().is_some()
            };
            for axis in self.axes.iter().filter(here) {
                if !axis.is_at_rest() || axis.is_kept_holding() && bus.config() != config.as_ref() {
                    return Err(Error::BusInUse { bus: bus.index(), axis: axis.index });
                }
            }
        }
        Ok(reach)
    }

    /// Several rows take milliseconds, in which no stop could leave (GUARANTEES G5).
    fn refuse_while_moving(&self) -> Result<()> {
        for axis in self.axes.iter() {
            let state = axis.state();
            if matches!(
                state,
                AxisState::Arming | AxisState::Armed | AxisState::Active | AxisState::Stopping
            ) || axis.is_about_to_stop()
            {
                return Err(Error::NotIdle { axis: axis.index, state });
            }
        }
        Ok(())
    }

    /// Refuses another configuration of an axis while it is in use.
    fn check_state(&self, axis: &Axis, config: &AxisConfig) -> Result<()> {
        let index = axis.index;
        axis.refuse_busy()?;
        if !axis.is_at_rest() {
            return Err(Error::NotIdle { axis: index, state: axis.state() });
        }
        // Nobody would poll the motor that holds any more.
        if axis.is_kept_holding() && config.address() != axis.config.address() {
            return Err(Error::NotIdle { axis: index, state: axis.state() });
        }
        // Its next stop, a trip's or of an e-stop, would drop what it holds.
        let coasts = |config: &AxisConfig| config.stop_action() == Some(StopAction::Coast);
        if axis.is_kept_holding() && coasts(config) && !coasts(&axis.config) {
            return Err(Error::NotIdle { axis: index, state: axis.state() });
        }
        // Nobody would know any more what its motor owes.
        if axis.is_kept_for_restart() && is_moved(&axis.config, config) {
            return Err(Error::RestartOwed { axis: index });
        }
        // An axis with a motor has a stop action, or there is no such axis any more.
        if let Some(missing) = config.missing()
            && axis.is_configured()
            && !config.is_empty()
        {
            return Err(Error::NotConfigured { axis: index, parameter: missing.number() });
        }
        // What waits in its motor would not be asked for any more before the frame that starts all
        // of the bus.
        let starts = |bus: usize| u8::try_from(bus).is_ok_and(|bus| self.starts_together_on(bus));
        if buses_of(&axis.config, config).into_iter().any(starts) {
            return Err(Error::Busy { axis: index });
        }
        if let Some(bus) = config.bus()
            && self.bus(bus).is_ok_and(|bus| {
                bus.is_borrowed() || bus.raw.as_ref().is_some_and(|raw| raw.is_unsafe())
            })
        {
            return Err(Error::RawOpen { bus });
        }
        Ok(())
    }

    /// Refuses changes that have been made and do not fit together.
    fn check_changed(&self, reach: &Reach) -> Result<()> {
        let (changed, mut loaded) = (self.draft.axes(), self.draft.buses());
        for axis in self.axes.iter() {
            let on_changed = axis.config.bus().is_some_and(|bus| self.draft.bus(bus).is_some());
            if changed.has(axis.index) || on_changed {
                self.check_axis(axis.index, &axis.config)?;
                loaded.add(axis.config.bus().map_or(Set::NONE, Set::of));
            }
        }
        // What was told a motor that others reach from now on is forgotten.
        self.check_timeouts(loaded, reach.moved)?;
        self.buses
            .iter()
            .filter(|bus| loaded.has(bus.index()))
            .try_for_each(|bus| self.check_bus_load(bus))
    }

    /// Refuses what would make the timeouts too short that motors on these buses were told, but for
    /// those of some axes.
    pub(crate) fn check_timeouts(&self, buses: Set, but: Set) -> Result<()> {
        let told = |axis: &&Axis| {
            axis.config.bus().is_some_and(|bus| buses.has(bus)) && !but.has(axis.index)
        };
        let mut told = self.axes.iter().filter(told);
        told.try_for_each(|axis| axis.check_programmed_timeout(self.waits(axis)))
    }

    /// What follows from changes that have been made.
    fn take_changes_over(&mut self, now: Instant, reach: &Reach) {
        if let Some(silence) = self.draft.silence {
            self.authority.silence = silence;
        }
        let of_bus =
            |axis: &Axis| axis.config.bus().is_some_and(|bus| self.draft.bus(bus).is_some());
        let changed = self.draft.axes().with(self.axes.those(Set::ALL, of_bus));
        self.each_axis(now, changed, |axis, out| axis.make_way(now, out));
        for bus in self.draft.buses().numbers() {
            self.end_raw(now, bus);
            self.on_bus(now, bus, |bus, axes, out| bus.configured(now, axes, out));
        }
        let Self { axes, buses, links, draft, retention, .. } = self;
        let mut out = Outbox::new(now, links);
        axes.each(draft.axes(), |axis| {
            let index = axis.index;
            if reach.moved.has(index) {
                buses.iter_mut().for_each(|bus| bus.disown(index));
            }
            if axis.config.is_empty() {
                *axis = Axis::new(index);
            } else {
                axis.configured(reach.moved.has(index), reach.same.has(index), &mut out);
            }
            let is_known = axis.config.is_empty() || axis.is_configured();
            if is_known && retention.take_lost(index) && axis.is_configured() {
                // Its motor may be in motion.
                axis.trip_after_reset(now, TripReason::Reset, false, &mut out);
            }
        });
        if draft.rows() > 1 {
            retention.together = true;
        }
        self.take_names_over();
        for bus in reach.buses.numbers() {
            self.end_raw(now, bus);
        }
        self.watch();
        self.settle(self.now);
    }

    /// Takes over the configuration that an axis had before a reset, if this firmware would accept
    /// it, and the timeout that was written to its motor.
    pub(crate) fn restore_axis(&mut self, index: u8, config: AxisConfig, told: u32) {
        if self.check_axis(index, &config).is_err() {
            return;
        }
        let Ok(axis) = self.axis_mut(index) else { return };
        axis.restore(config, told);
        self.settle(self.now);
    }

    /// Whether a configuration that names a motor fits its bus, its protocol and the other axes.
    pub(crate) fn check_axis(&self, axis: u8, config: &AxisConfig) -> Result<()> {
        let Some(address) = config.address() else { return Ok(()) };
        let Address { bus: bus_index, protocol, .. } = address;
        let bus = self.bus(bus_index)?;
        rules::check_motor(axis, bus.kind(), config)?;
        if let Some(config) = bus.config()
            && !config.protocols.contains(protocol)
        {
            return Err(Error::ProtocolNotOnBus { bus: bus_index, protocol });
        }
        let other = |other: &&Axis| other.index != axis && other.config.address() == Some(address);
        if let Some(other) = self.axes.iter().find(other) {
            return Err(Error::NodeInUse { axis: other.index });
        }
        if bus.kind() == BusKind::Can {
            self.check_ids(axis, config)?;
        }
        // Before it is complete, what a limit needs may still come.
        if config.missing().is_some() {
            Ok(())
        } else {
            rules::check_config(axis, bus.kind(), config)
        }
    }

    /// Refuses an axis that would be sent frames on an id of another axis's motor, or the other way
    /// round (GUARANTEES G7).
    fn check_ids(&self, axis: u8, config: &AxisConfig) -> Result<()> {
        // What has no node yet has no ids, and is checked when it gets one.
        let there = |other: &&Axis| other.index != axis && other.config.bus() == config.bus();
        for other in self.axes.iter().filter(there) {
            if let Some(id) = protocol::sent_on_an_id_of(config, &other.config) {
                return Err(Error::IdInUse { axis, id, other: other.index });
            }
            if let Some(id) = protocol::sent_on_an_id_of(&other.config, config) {
                return Err(Error::IdInUse { axis: other.index, id, other: axis });
            }
        }
        Ok(())
    }

    /// Whether the axis's bus can still carry what all its axes need.
    pub(crate) fn check_axis_load(&self, axis: u8) -> Result<()> {
        match self.axis(axis)?.config.bus() {
            Some(bus) => self.check_bus_load(self.bus(bus)?),
            None => Ok(()),
        }
    }

    fn check_bus_load(&self, bus: &Bus) -> Result<()> {
        let Some(config) = bus.config() else { return Ok(()) };
        let here = |axis: &&Axis| {
            axis.config.bus() == Some(bus.index()) && axis.config.missing().is_none()
        };
        check_load(bus, config, self.axes.iter().filter(here))
    }
}

/// What changes of axes reach.
#[derive(Default)]
struct Reach {
    /// Axes whose motor is reached by other frames.
    moved: Set,
    /// Axes that keep bus, protocol and node.
    same: Set,
    /// The buses that axes are on, and those that they were on.
    buses: Set,
}

/// Whether a motor is reached by other frames.
fn is_moved(before: &AxisConfig, after: &AxisConfig) -> bool {
    ADDRESS.iter().any(|parameter| before.get(*parameter) != after.get(*parameter))
}

fn buses_of(before: &AxisConfig, after: &AxisConfig) -> Set {
    [before.bus(), after.bus()].into_iter().flatten().collect()
}

/// What says by which frames the motor is reached.
const ADDRESS: &[AxisParameter] = &[
    AxisParameter::Bus,
    AxisParameter::Protocol,
    AxisParameter::Node,
    AxisParameter::D5RequestId,
    AxisParameter::D5ReplyId,
];
