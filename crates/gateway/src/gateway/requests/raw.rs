//! The requests of raw access to a bus: when it may be open, and what may be sent there (GUARANTEES
//! G10).

use super::Result;
use crate::bus_rules::check_bus_config;
use crate::gateway::Gateway;
use crate::protocol;
use crate::time::Instant;
use host_protocol::{
    BusConfig, BusKind, BusMode, Error, MAX_SERIAL_FRAME, Quantity, RawFrame, requests,
};

impl Gateway {
    pub(crate) fn raw_open(&mut self, now: Instant, request: requests::RawOpen) -> Result<()> {
        let requests::RawOpen { bus, unsafe_access } = request;
        if self.bus(bus)?.config().is_none() {
            return Err(Error::BusNotConfigured { bus });
        }
        self.refuse_raw(bus, unsafe_access)?;
        if self.bus(bus)?.is_borrowed() {
            return Err(Error::RawOpen { bus });
        }
        self.on_bus(now, bus, |bus, axes, out| bus.open_raw(now, unsafe_access, axes, out));
        Ok(())
    }

    /// Opens a bus without axes that runs otherwise than it is configured.
    pub(crate) fn raw_open_at(&mut self, now: Instant, request: requests::RawOpenAt) -> Result<()> {
        let requests::RawOpenAt { bus, bitrate, protocols, reply_window_us, mode } = request;
        let config = BusConfig { bitrate, protocols, exclusive: false, reply_window_us };
        let port = self.bus(bus)?;
        check_bus_config(bus, port.kind(), port.port().bitrates, &config)?;
        self.refuse_raw(bus, true)?;
        self.on_bus(now, bus, |bus, axes, out| bus.borrow(now, config, mode, axes, out));
        Ok(())
    }

    pub(crate) fn raw_send(&mut self, request: &requests::RawSend) -> Result<()> {
        let index = request.bus;
        let bus = self.bus_mut(index)?;
        let kind = bus.kind();
        let (protocols, mode) = (bus.protocols(), bus.mode());
        let raw = bus.raw.as_mut().ok_or(Error::RawNotOpen { bus: index })?;
        if mode == BusMode::ListenOnly {
            return Err(Error::BusOnlyListens { bus: index });
        }
        let harmless = match (&request.frame, kind) {
            (RawFrame::Can(frame), BusKind::Can) => protocol::is_harmless_on_can(frame, protocols),
            (RawFrame::Serial(bytes), BusKind::Rs485) => {
                let count = |bytes: usize| u32::try_from(bytes).unwrap_or(u32::MAX);
                let most = count(MAX_SERIAL_FRAME);
                Quantity::FrameLength.check(count(bytes.len()), (1, most))?;
                protocol::is_harmless_on_serial(bytes, protocols)
            }
            _ => return Err(Error::WrongBusKind { bus: index, kind }),
        };
        if !harmless && !raw.is_unsafe() {
            return Err(Error::RawNotHarmless { bus: index });
        }
        if raw.send(request.frame.clone()) { Ok(()) } else { Err(Error::QueueFull { bus: index }) }
    }

    pub(crate) fn raw_close(&mut self, now: Instant, index: u8) -> Result<()> {
        self.bus(index)?.raw.as_ref().ok_or(Error::RawNotOpen { bus: index })?;
        self.end_raw(now, index);
        Ok(())
    }

    /// Why raw frames may not be sent on a bus.
    fn refuse_raw(&self, bus: u8, unsafe_access: bool) -> Result<()> {
        self.refuse_latched()?;
        let here = || self.axes.iter().filter(|axis| axis.config.bus() == Some(bus));
        if unsafe_access && let Some(axis) = here().next() {
            return Err(Error::AxisOnBus { bus, axis: axis.index });
        }
        if let Some(axis) = here().find(|axis| axis.is_in_use()) {
            return Err(Error::NotIdle { axis: axis.index, state: axis.state() });
        }
        Ok(())
    }

    /// Closes each bus that may not be open any more: after an e-stop, where an axis is no longer
    /// idle, and where one has still to stop.
    #[inline]
    pub(crate) fn close_barred_raw(&mut self, now: Instant) {
        // Mostly none is open, and this is asked at every event.
        if self.buses.iter().any(|bus| bus.raw.is_some()) {
            self.close_raw(now, false);
        }
    }

    /// Closes those, or all.
    pub(crate) fn close_raw(&mut self, now: Instant, all: bool) {
        while let Some(bus) = self.buses.iter().find(|bus| {
            let refused = |access| self.refuse_raw(bus.index(), access).is_err();
            let stops =
                || !self.unstopped.stopped_at_rest_too().and(self.axes.on(bus.index())).is_empty();
            bus.raw
                .as_ref()
                .is_some_and(|raw| all || stops() || refused(raw.is_unsafe() || bus.is_borrowed()))
        }) {
            let index = bus.index();
            self.end_raw(now, index);
        }
    }

    /// Closes a bus for raw frames if it is open.
    pub(crate) fn end_raw(&mut self, now: Instant, bus: u8) {
        self.on_bus(now, bus, |bus, axes, out| bus.close_raw(now, axes, out));
    }
}
