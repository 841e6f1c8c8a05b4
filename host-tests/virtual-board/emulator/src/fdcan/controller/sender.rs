//! The controller as a sender.

use rigless::chip::can::Frame;
use rigless::time::VirtualNanos;

use super::{Controller, Kept, Presence, Untold};
use crate::fdcan::element::{EventType, Outgoing};
use crate::fdcan::errors::ErrorCode;
use crate::fdcan::registers::{cccr, ir};
use crate::fdcan::tx::{self, Attempt};

/// Bits that an error-passive sender leaves to others before it sends again.
const SUSPEND_BITS: u64 = 8;
/// Bits that TXP leaves to others after a frame that was sent.
const TRANSMIT_PAUSE_BITS: u64 = 2;

impl Controller {
    /// The frame that it wants to send next, its buffer, and since when it may.
    pub fn candidate(&mut self, now: VirtualNanos) -> Option<(usize, Outgoing, VirtualNanos)> {
        if !self.may_send() || self.kept.sending.is_some() {
            return None;
        }
        let Ok(chosen) = self.kept.transmitter.choose(&self.ram) else {
            self.restrict();
            return None;
        };
        let Some((index, outgoing)) = chosen else {
            self.kept.ready = None;
            return None;
        };
        let ready = *self.kept.ready.get_or_insert(now);
        Some((index, outgoing, ready.max(self.kept.suspended_until)))
    }

    /// It has won the bus with this buffer.
    pub fn begin(&mut self, index: usize) {
        self.kept.sending = Some(index);
    }

    /// Another node has won the bus from this buffer.
    pub fn lost_arbitration(&mut self, index: usize) {
        self.attempted(index, Attempt::Failed);
    }

    /// The frame that it sent has ended well; its start of frame was at `start`, the bus is free at
    /// `free`.
    pub fn sent(
        &mut self,
        frame: &Frame,
        start: VirtualNanos,
        free: VirtualNanos,
    ) -> Result<(), Untold> {
        let Some(index) = self.kept.sending.take() else { return Ok(()) };
        let flags = self.kept.errors.sent();
        self.kept.interrupts.raise(flags);
        let stored = self.store_event(index, frame, start);
        self.attempted(index, Attempt::Sent);
        self.suspend(free, true);
        stored
    }

    fn store_event(
        &mut self,
        index: usize,
        frame: &Frame,
        start: VirtualNanos,
    ) -> Result<(), Untold> {
        let marker = self.kept.transmitter.marker(&self.ram, index);
        let Some(marker) = marker else { return Ok(()) };
        let in_spite = self.kept.transmitter.is_to_cancel(index) || self.is_set(cccr::DAR);
        let kind = if in_spite { EventType::SentInSpiteOfCancellation } else { EventType::Sent };
        let timestamp = self.kept.timestamp.at(start);
        let Kept { events, interrupts, .. } = &mut self.kept;
        if events.store(&self.ram, frame, marker, kind, timestamp, interrupts) {
            Ok(())
        } else {
            self.kept.interrupts.raise(ir::MRAF);
            Err(("TXEFC", "an event beyond the end of the message RAM"))
        }
    }

    /// The frame that it sent has failed. The bus is free at `free`.
    pub fn send_failed(&mut self, code: ErrorCode, free: VirtualNanos) {
        let Some(index) = self.kept.sending.take() else { return };
        let flags = self.kept.errors.send_failed(code);
        self.kept.interrupts.raise(flags);
        self.attempted(index, Attempt::Failed);
        self.suspend(free, false);
        self.follow_bus_off();
    }

    /// It sent a start of frame on a line that stays recessive: a bit error, and in an active error
    /// flag another one in every bit, until it is error-passive. Returns the bits of such a
    /// flag.
    pub fn send_failed_on_short(&mut self) -> u64 {
        let Some(index) = self.kept.sending.take() else { return 0 };
        let mut flag_bits = 0;
        let mut flags = self.kept.errors.send_failed(ErrorCode::Bit0);
        while !self.kept.errors.passive() {
            flags |= self.kept.errors.send_failed(ErrorCode::Bit0);
            flag_bits += 1;
        }
        self.kept.interrupts.raise(flags);
        self.attempted(index, Attempt::Failed);
        self.follow_bus_off();
        flag_bits
    }

    /// After what it sent it leaves the bus to others for a while: from `free` on.
    pub fn suspend(&mut self, free: VirtualNanos, sent: bool) {
        let bits = if self.kept.errors.passive() {
            SUSPEND_BITS
        } else if sent && self.is_set(cccr::TXP) {
            TRANSMIT_PAUSE_BITS
        } else {
            0
        };
        self.kept.suspended_until = self.bit().map_or(free, |bit| bit.after(free, bits));
    }

    fn attempted(&mut self, index: usize, attempt: Attempt) {
        let once = self.is_set(cccr::DAR);
        let outcome = self.kept.transmitter.attempted(index, attempt, once);
        self.raise(outcome);
    }

    pub(super) fn raise(&mut self, outcome: tx::Outcome) {
        let flag = |condition, flag| if condition { flag } else { 0 };
        self.kept.interrupts.raise(
            flag(outcome.completed, ir::TC)
                | flag(outcome.cancelled, ir::TCF)
                | flag(outcome.fifo_empty, ir::TFE),
        );
    }

    fn follow_bus_off(&mut self) {
        if self.kept.errors.is_bus_off() {
            self.kept.cccr |= cccr::INIT;
            self.leave_bus();
        }
    }

    pub(super) fn leave_bus(&mut self) {
        self.kept.presence = Presence::Off;
        self.kept.sending = None;
        self.kept.ready = None;
        // What was to be cancelled at the end of its attempt: that is now.
        let outcome = self.kept.transmitter.left_bus();
        self.raise(outcome);
    }
}
