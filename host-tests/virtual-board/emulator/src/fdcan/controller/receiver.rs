//! The controller as a receiver.

use rigless::chip::can::{Fault, Frame};
use rigless::time::VirtualNanos;

use super::{Controller, Kept, Untold};
use crate::fdcan::errors::ErrorCode;
use crate::fdcan::registers::ir;
use crate::fdcan::rx::StoreError;

impl Controller {
    /// A frame from another node is valid; its start of frame was at `start`.
    pub fn received(&mut self, frame: &Frame, start: VirtualNanos) -> Result<(), Untold> {
        let flags = self.kept.errors.received();
        self.kept.interrupts.raise(flags);
        let timestamp = self.kept.timestamp.at(start);
        let Kept { receiver, interrupts, .. } = &mut self.kept;
        receiver.receive(&self.ram, frame, timestamp, interrupts).map_err(|error| match error {
            StoreError::Debug => ("SIDFC", "messages of the debug unit are not modelled"),
            StoreError::BeyondRam => {
                interrupts.raise(ir::MRAF);
                ("RXESC", "a frame beyond the end of the message RAM")
            }
        })
    }

    /// A frame from another node is destroyed; `first`: it was the first to say so.
    pub fn receive_failed(&mut self, code: ErrorCode, first: bool) {
        let flags = self.kept.errors.receive_failed(code, first);
        self.kept.interrupts.raise(flags);
    }

    /// The code with which a receiver calls a damaged frame.
    pub fn code_of(fault: Fault) -> ErrorCode {
        match fault {
            Fault::Stuff => ErrorCode::Stuff,
            Fault::Form => ErrorCode::Form,
            Fault::Crc => ErrorCode::Crc,
        }
    }
}
