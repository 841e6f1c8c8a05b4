//! The requests of raw access to a bus: what may be sent there, and when (GUARANTEES G2).

use crate::axis::Axis;
use crate::bus::Raw;
use crate::gateway::Gateway;
use crate::motor::{self, Touch};
use crate::requests::Result;
use heapless::Vec;
use host_protocol::{AxisState, BusKind, Error, Quantity, RawFrame, requests};

impl Gateway {
    pub(crate) fn raw_open(&mut self, bus: u8) -> Result<()> {
        if self.bus(bus)?.config().is_none() {
            return Err(Error::BusNotConfigured { bus });
        }
        let moving = |axis: &&Axis| {
            axis.config.bus() == Some(bus)
                && matches!(
                    axis.state,
                    AxisState::Arming
                        | AxisState::Armed
                        | AxisState::Active
                        | AxisState::Stopping
                        | AxisState::Tripped { confirmed: false }
                )
        };
        if let Some(axis) = self.axes.iter().find(moving) {
            return Err(Error::AxisArmed { axis: axis.index });
        }
        let holds = |axis: &&Axis| axis.config.bus() == Some(bus) && axis.state == AxisState::Holding;
        if let Some(axis) = self.axes.iter().find(holds) {
            return Err(Error::NotIdle { axis: axis.index, state: axis.state });
        }
        self.bus_mut(bus)?.raw.get_or_insert_with(Raw::new);
        Ok(())
    }

    pub(crate) fn raw_send(&mut self, request: &requests::RawSend) -> Result<()> {
        let index = request.bus;
        let unknown = self.unknown_bus(index);
        let bus = self.buses.get_mut(usize::from(index)).ok_or(unknown)?;
        let kind = bus.kind();
        let raw = bus.raw.as_mut().ok_or(Error::RawNotOpen { bus: index })?;
        match (&request.frame, kind) {
            (RawFrame::Can(_), BusKind::Can) | (RawFrame::Serial(_), BusKind::Rs485) => {}
            _ => return Err(Error::WrongBusKind { bus: index, kind }),
        }
        if matches!(&request.frame, RawFrame::Serial(bytes) if bytes.is_empty()) {
            #[allow(clippy::cast_precision_loss)]
            let max = host_protocol::MAX_SERIAL_FRAME as f32;
            return Err(Error::OutOfRange { quantity: Quantity::FrameLength, value: 0.0, min: 1.0, max });
        }
        let completed = match &request.frame {
            RawFrame::Serial(bytes) => raw.completed_by(bytes.as_slice()),
            RawFrame::Can(_) => Vec::new(),
        };
        let touches = |axis: &Axis, is: fn(Touch) -> bool| {
            axis.config.bus() == Some(index)
                && match &request.frame {
                    RawFrame::Can(frame) => motor::touched_by_can(frame, &axis.config).is_some_and(is),
                    RawFrame::Serial(_) => {
                        let mut touches = completed
                            .iter()
                            .filter_map(|frame| motor::touched_by_serial(frame, &axis.config));
                        touches.any(is)
                    }
                }
        };
        // The rules of native commands; nothing on a bus with raw access is armed.
        if let Some(axis) = self.axes.iter().find(|axis| touches(axis, |touch| touch == Touch::Moves)) {
            return Err(Error::NotArmed { axis: axis.index, state: axis.state });
        }
        let is_tripped = |axis: &Axis| matches!(axis.state, AxisState::Tripped { .. });
        let changed = |axis: &&Axis| is_tripped(axis) && touches(axis, |_| true);
        if let Some(axis) = self.axes.iter().find(changed) {
            return Err(Error::NotIdle { axis: axis.index, state: axis.state });
        }
        if !raw.send(request.frame.clone()) {
            return Err(Error::QueueFull { bus: index });
        }
        for axis in &mut self.axes {
            if touches(axis, |touch| touch == Touch::Changes { timeout: true }) {
                axis.forget_motor_timeout();
            }
        }
        Ok(())
    }

    pub(crate) fn close_raw(&mut self) {
        for bus in &mut self.buses {
            bus.raw = None;
        }
    }
}
