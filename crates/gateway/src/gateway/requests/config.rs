//! Configuring buses and axes: every change is tried on a copy, and taken only if the whole still
//! fits together.

use crate::axis::Axis;
use crate::bus::check_load;
use crate::bus_rules;
use crate::config::{Address, AxisConfig};
use crate::gateway::Gateway;
use crate::outbox::Outbox;
use crate::protocol;
use crate::rules;
use crate::time::Instant;
use host_protocol::{AxisParameter, BusConfig, BusKind, Error, GatewayParameter, Value, requests};

impl Gateway {
    pub(crate) fn configure_gateway(
        &mut self,
        request: &requests::ConfigureGateway,
    ) -> Result<(), Error> {
        let unknown = Error::UnknownParameter { parameter: request.parameter };
        match GatewayParameter::from_number(request.parameter).ok_or(unknown)? {
            parameter @ GatewayParameter::LinkSilenceUs => {
                parameter.check(request.value)?;
                if let Value::Unsigned(us) = request.value {
                    self.authority.set_silence(crate::Duration::from_micros(u64::from(us)));
                }
            }
        }
        Ok(())
    }

    pub(crate) fn configure_bus(
        &mut self,
        now: Instant,
        request: &requests::ConfigureBus,
    ) -> Result<(), Error> {
        let bus = self.bus(request.bus)?;
        let config = BusConfig {
            bitrate: request.bitrate,
            protocols: request.protocols,
            exclusive: request.exclusive,
            reply_window_us: request.reply_window_us,
        };
        bus_rules::check_bus_config(request.bus, bus.kind(), bus.port().bitrates, &config)?;
        let here = || self.axes.iter().filter(|axis| axis.config.bus() == Some(request.bus));
        for axis in here() {
            if !axis.is_at_rest() || axis.is_kept_holding() && bus.config() != Some(&config) {
                return Err(Error::BusInUse { bus: request.bus, axis: axis.index });
            }
            if let Some(protocol) = axis.config.protocol()
                && axis.is_configured()
                && !config.protocols.contains(protocol)
            {
                return Err(Error::ProtocolNotOnBus { bus: request.bus, protocol });
            }
        }
        check_load(bus, &config, here().filter(|axis| axis.is_configured()))?;
        self.end_raw(now, request.bus);
        self.on_bus(now, request.bus, |bus, axes, out| bus.configure(now, config, axes, out));
        self.retention.bus_changed(request.bus);
        Ok(())
    }

    pub(crate) fn configure_axis(
        &mut self,
        now: Instant,
        request: &requests::ConfigureAxis,
    ) -> Result<(), Error> {
        let unknown = Error::UnknownParameter { parameter: request.parameter };
        let parameter = AxisParameter::from_number(request.parameter).ok_or(unknown)?;
        let axis = self.axis(request.axis)?;
        if axis.is_busy() {
            return Err(Error::Busy { axis: request.axis });
        }
        if !axis.is_at_rest() {
            return Err(Error::NotIdle { axis: request.axis, state: axis.state() });
        }
        let mut config = axis.config.clone();
        config.set(parameter, request.value)?;
        let complete = config.missing().is_none();
        self.check_axis(request.axis, &config)?;
        // Nobody would poll the motor that holds any more.
        if axis.is_kept_holding() && config.address() != axis.config.address() {
            return Err(Error::NotIdle { axis: request.axis, state: axis.state() });
        }
        // Nobody would know any more what its motor owes.
        if axis.owes_restart() && is_of_address(parameter) && config != axis.config {
            return Err(Error::RestartOwed { axis: request.axis });
        }
        let touched = [axis.config.bus(), config.bus()];
        // What waits in its motor would not be asked for any more before the frame that starts all
        // of the bus.
        if touched.into_iter().flatten().any(|bus| self.starts_together_on(bus)) {
            return Err(Error::Busy { axis: request.axis });
        }
        if let Some(bus) = config.bus()
            && self.bus(bus).is_ok_and(|bus| bus.raw.as_ref().is_some_and(|raw| raw.is_unsafe()))
        {
            return Err(Error::RawOpen { bus });
        }
        let previous = core::mem::replace(&mut self.axis_mut(request.axis)?.config, config);
        if let Err(error) = self.check_axis_load(request.axis) {
            self.axis_mut(request.axis)?.config = previous;
            return Err(error);
        }
        let Self { axes, buses, links, .. } = self;
        if let Some(axis) = axes.get_mut(usize::from(request.axis)) {
            let moved =
                is_of_address(parameter) && axis.config.get(parameter) != previous.get(parameter);
            if moved {
                buses.iter_mut().for_each(|bus| bus.disown(request.axis));
            }
            let same = axis.config.address() == previous.address();
            axis.configured(moved, same, complete, &mut Outbox::new(now, links));
        }
        for bus in touched.into_iter().flatten() {
            self.end_raw(now, bus);
        }
        self.settle(self.now);
        self.retention.axis_changed(request.axis);
        Ok(())
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

    pub(crate) fn remove_axis(&mut self, now: Instant, axis: u8) -> Result<(), Error> {
        let removed = self.axis(axis)?;
        if removed.is_busy() {
            return Err(Error::Busy { axis });
        }
        if !removed.is_at_rest() || removed.is_kept_holding() {
            return Err(Error::NotIdle { axis, state: removed.state() });
        }
        if removed.owes_restart() {
            return Err(Error::RestartOwed { axis });
        }
        let bus = removed.config.bus();
        *self.axis_mut(axis)? = Axis::new(axis);
        self.buses.iter_mut().for_each(|bus| bus.disown(axis));
        if let Some(bus) = bus {
            self.end_raw(now, bus);
        }
        self.settle(self.now);
        self.retention.axis_changed(axis);
        Ok(())
    }

    /// Whether a configuration that names a motor fits its bus, its protocol and the other axes.
    pub(crate) fn check_axis(&self, axis: u8, config: &AxisConfig) -> Result<(), Error> {
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
    fn check_ids(&self, axis: u8, config: &AxisConfig) -> Result<(), Error> {
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
    pub(crate) fn check_axis_load(&self, axis: u8) -> Result<(), Error> {
        let config = &self.axis(axis)?.config;
        if config.missing().is_some() {
            return Ok(());
        }
        let Some(bus_index) = config.bus() else { return Ok(()) };
        let bus = self.bus(bus_index)?;
        let Some(bus_config) = bus.config() else { return Ok(()) };
        let here = self.axes.iter().filter(|other| {
            other.config.bus() == Some(bus_index) && other.config.missing().is_none()
        });
        check_load(bus, bus_config, here)
    }
}

/// Whether a parameter says by which frames the motor is reached.
fn is_of_address(parameter: AxisParameter) -> bool {
    matches!(
        parameter,
        AxisParameter::Bus
            | AxisParameter::Protocol
            | AxisParameter::Node
            | AxisParameter::D5RequestId
            | AxisParameter::D5ReplyId
    )
}
