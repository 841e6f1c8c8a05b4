//! The controller itself: its registers, its part in the bus, and what frames do to it.

use rigless::chip::can::{Fault, Frame};
use rigless::device::DeviceContext;
use rigless::snapshot::store;
use rigless::soc::stm32h743::generated::fdcan1::Register;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::BitTime;
use super::element::{EventType, Outgoing};
use super::errors::{ErrorCode, Errors};
use super::event_fifo::EventFifo;
use super::interrupts::Interrupts;
use super::registers::{cccr, field, ir, reset};
use super::rx::{Receiver, StoreError};
use super::timestamp::Timestamp;
use super::tx::{self, Attempt, Transmitter};
use super::wire::Recessive;
use crate::message_ram::MessageRam;

/// Recessive bits that make a sequence: the bus is idle.
pub const SEQUENCE_BITS: u64 = 11;
/// Sequences that a controller which went bus-off waits for.
const RECOVERY_SEQUENCES: u16 = 129;
/// Bits that an error-passive sender leaves to others before it sends again.
const SUSPEND_BITS: u64 = 8;
/// Bits that TXP leaves to others after a frame that was sent.
const TRANSMIT_PAUSE_BITS: u64 = 2;

/// Whether the controller takes part in the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Presence {
    /// INIT is set.
    Off,
    /// INIT is clear; the line must have been recessive for so many sequences more, counted from an instant on.
    Waiting {
        /// Sequences still to come.
        left: u16,
        /// The end of the last one, or when INIT was cleared.
        since: VirtualNanos,
    },
    /// Yes.
    On,
}

/// What the controller does on the bus: the codes of PSR.ACT.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Activity {
    /// Waiting for the bus to be idle, or off.
    Synchronizing = 0b00,
    /// Neither sender nor receiver.
    Idle = 0b01,
    /// Receiving.
    Receiver = 0b10,
    /// Sending.
    Transmitter = 0b11,
}

/// What the controller could not do as the part does.
pub type Untold = (&'static str, &'static str);

/// The registers and state that are kept by value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Kept {
    cccr: u32,
    nbtp: u32,
    dbtp: u32,
    test: u32,
    rwd: u32,
    tocc: u32,
    tdcr: u32,
    interrupts: Interrupts,
    errors: Errors,
    receiver: Receiver,
    transmitter: Transmitter,
    events: EventFifo,
    timestamp: Timestamp,
    presence: Presence,
    /// The buffer on the bus.
    sending: Option<usize>,
    /// Since when there has been something to send.
    ready: Option<VirtualNanos>,
    suspended_until: VirtualNanos,
}

impl Kept {
    const RESET: Self = Self {
        cccr: reset::CCCR,
        nbtp: reset::NBTP,
        dbtp: reset::DBTP,
        test: 0,
        rwd: 0,
        tocc: reset::TOCC,
        tdcr: 0,
        interrupts: Interrupts { flags: 0, enabled: 0, select: 0, line_enable: 0 },
        errors: Errors::RESET,
        receiver: Receiver::RESET,
        transmitter: Transmitter::RESET,
        events: EventFifo::RESET,
        timestamp: Timestamp::RESET,
        presence: Presence::Off,
        sending: None,
        ready: None,
        suspended_until: VirtualNanos(0),
    };
}

/// One controller.
#[derive(Debug)]
pub struct Controller {
    kept: Kept,
    /// The kernel clock.
    kernel_hz: u64,
    ram: MessageRam,
}

store!(Controller { values: [kept, kernel_hz], parts: [], built: [ram] });

impl Controller {
    /// Out of reset.
    pub fn new(ram: MessageRam) -> Self {
        Self { kept: Kept::RESET, kernel_hz: 0, ram }
    }

    /// A reset: of the part or of the controller alone. The kernel clock is another's.
    pub fn reset(&mut self) {
        self.kept = Kept::RESET;
    }

    /// The kernel clock changed.
    pub fn follow_clock(&mut self, now: VirtualNanos, hz: u64) {
        self.kernel_hz = hz;
        self.follow_bit(now);
    }

    /// The nominal bit, from NBTP and the kernel clock; `None` while that stands.
    pub fn bit(&self) -> Option<BitTime> {
        let nbtp = self.kept.nbtp;
        let prescaler = u64::from(field(nbtp, 16, 9)) + 1;
        let before_sample = u64::from(field(nbtp, 8, 8)) + 1;
        let after_sample = u64::from(field(nbtp, 0, 7)) + 1;
        BitTime::of_cycles(prescaler * (1 + before_sample + after_sample), self.kernel_hz)
    }

    fn follow_bit(&mut self, now: VirtualNanos) {
        let bit = self.bit();
        self.kept.timestamp.follow(now, bit);
    }

    fn is_set(&self, bit: u32) -> bool {
        self.kept.cccr & bit != 0
    }

    /// Whether it takes part in the bus.
    pub fn is_on(&self) -> bool {
        self.kept.presence == Presence::On
    }

    /// Whether it acknowledges what it receives: not when it only monitors.
    pub fn acknowledges(&self) -> bool {
        self.is_on() && !self.is_set(cccr::MON)
    }

    /// Whether its error flags destroy frames.
    pub fn is_error_active(&self) -> bool {
        self.acknowledges() && !self.kept.errors.passive()
    }

    /// The levels of its interrupt lines.
    pub fn lines(&self) -> [bool; 2] {
        self.kept.interrupts.lines()
    }
}

/// As a sender.
impl Controller {
    /// The frame that it wants to send next, its buffer, and since when it may.
    pub fn candidate(&mut self, now: VirtualNanos) -> Option<(usize, Outgoing, VirtualNanos)> {
        if !self.acknowledges() || self.kept.sending.is_some() {
            return None;
        }
        let Ok(chosen) = self.kept.transmitter.choose(&self.ram) else {
            self.kept.interrupts.raise(ir::MRAF);
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

    /// The frame that it sent has ended well; its start of frame was at `start`, the bus is free at `free`.
    pub fn sent(&mut self, frame: &Frame, start: VirtualNanos, free: VirtualNanos) -> Result<(), Untold> {
        let Some(index) = self.kept.sending.take() else { return Ok(()) };
        let flags = self.kept.errors.sent();
        self.kept.interrupts.raise(flags);
        let stored = self.store_event(index, frame, start);
        self.attempted(index, Attempt::Sent);
        self.suspend(free, true);
        stored
    }

    fn store_event(&mut self, index: usize, frame: &Frame, start: VirtualNanos) -> Result<(), Untold> {
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

    /// It sent a start of frame on a line that stays recessive: a bit error, and in an active error flag another one in
    /// every bit, until it is error-passive. Returns the bits of such a flag.
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

    fn raise(&mut self, outcome: tx::Outcome) {
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

    fn leave_bus(&mut self) {
        self.kept.presence = Presence::Off;
        self.kept.sending = None;
        self.kept.ready = None;
        // What was to be cancelled at the end of its attempt: that is now.
        let outcome = self.kept.transmitter.left_bus();
        self.raise(outcome);
    }
}

/// As a receiver.
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

/// On the way to the bus.
impl Controller {
    /// Counts the sequences for which the line has been recessive. True if it has joined.
    pub fn count_recessive(&mut self, line: Option<Recessive>) -> bool {
        while let Some(end) =
            self.sequence_end(line).filter(|end| line.is_some_and(|line| *end <= line.until))
        {
            let Presence::Waiting { left, .. } = &mut self.kept.presence else { return false };
            *left -= 1;
            let done = *left == 0;
            let left = *left;
            if self.kept.errors.is_bus_off() {
                self.kept.errors.recessive_sequence();
            }
            if done {
                let flags = self.kept.errors.joined();
                self.kept.interrupts.raise(flags);
                self.kept.presence = Presence::On;
                return true;
            }
            self.kept.presence = Presence::Waiting { left, since: end };
        }
        false
    }

    /// When the sequence ends that runs now, if nobody starts before.
    pub fn next_sequence(&self, line: Option<Recessive>) -> Option<VirtualNanos> {
        self.sequence_end(line.filter(|line| !line.over))
    }

    fn sequence_end(&self, line: Option<Recessive>) -> Option<VirtualNanos> {
        let Presence::Waiting { since, .. } = self.kept.presence else { return None };
        Some(self.bit()?.after(since.max(line?.since), SEQUENCE_BITS))
    }

    /// Sequences counted on the way back from bus-off.
    fn counted(&self) -> Option<u16> {
        match self.kept.presence {
            Presence::Waiting { left, .. } if self.kept.errors.is_bus_off() => {
                Some(RECOVERY_SEQUENCES - left)
            }
            _ => None,
        }
    }

    /// CSR was set and nothing is pending any more: stops, once the bus is idle. True if it did.
    pub fn stop_clock(&mut self, bus_is_idle: bool) -> bool {
        let asked = self.is_set(cccr::CSR) && !self.is_set(cccr::CSA);
        if !asked || self.kept.transmitter.is_pending() || !(bus_is_idle || self.is_set(cccr::INIT)) {
            return false;
        }
        self.kept.cccr |= cccr::CSA | cccr::INIT;
        self.leave_bus();
        true
    }

    /// What follows from time alone. Returns when to look again.
    pub fn pass_time(&mut self, now: VirtualNanos) -> Option<VirtualNanos> {
        if self.kept.timestamp.take_wrap(now) {
            self.kept.interrupts.raise(ir::TSW);
        }
        self.kept.timestamp.next_wrap(now)
    }
}

/// Seen from the processor.
impl Controller {
    /// What a register reads, and what reading does.
    pub fn read(&mut self, register: Register, now: VirtualNanos, activity: Activity) -> u32 {
        match register {
            Register::FdcanEcr => {
                let counted = self.counted();
                self.kept.errors.read_ecr(counted)
            }
            Register::FdcanPsr => self.kept.errors.read_psr(activity as u32),
            _ => self.peek(register, now, activity),
        }
    }

    /// What a register reads, with nothing changed.
    pub fn peek(&self, register: Register, now: VirtualNanos, activity: Activity) -> u32 {
        let Kept { interrupts, receiver, transmitter, events, .. } = &self.kept;
        match register {
            Register::FdcanCrel => reset::CREL,
            Register::FdcanEndn => reset::ENDN,
            Register::FdcanDbtp => self.kept.dbtp,
            Register::FdcanTest => self.kept.test,
            Register::FdcanRwd => self.kept.rwd,
            Register::FdcanCccr => self.kept.cccr,
            Register::FdcanNbtp => self.kept.nbtp,
            Register::FdcanTscc => self.kept.timestamp.config(),
            Register::FdcanTscv => u32::from(self.kept.timestamp.at(now)),
            Register::FdcanTocc => self.kept.tocc,
            Register::FdcanTocv => reset::TOCV,
            Register::FdcanEcr => self.kept.errors.ecr(self.counted()),
            Register::FdcanPsr => self.kept.errors.psr(activity as u32),
            Register::FdcanTdcr => self.kept.tdcr,
            Register::FdcanIr => interrupts.flags,
            Register::FdcanIe => interrupts.enabled,
            Register::FdcanIls => interrupts.select,
            Register::FdcanIle => interrupts.line_enable,
            Register::FdcanGfc => receiver.filters.global,
            Register::FdcanSidfc => receiver.filters.standard,
            Register::FdcanXidfc => receiver.filters.extended,
            Register::FdcanXidam => receiver.filters.extended_mask,
            Register::FdcanHpms => receiver.high_priority(),
            Register::FdcanNdat1 => receiver.new_data(0),
            Register::FdcanNdat2 => receiver.new_data(1),
            Register::FdcanRxf0c => receiver.fifos[0].config,
            Register::FdcanRxf0s => receiver.fifo_status(0, interrupts),
            Register::FdcanRxbc => receiver.buffers,
            Register::FdcanRxf1c => receiver.fifos[1].config,
            Register::FdcanRxf1s => receiver.fifo_status(1, interrupts),
            Register::FdcanRxesc => receiver.element_sizes,
            Register::FdcanTxbc => transmitter.config,
            Register::FdcanTxfqs => transmitter.status(),
            Register::FdcanTxesc => transmitter.element_size,
            Register::FdcanTxbrp => transmitter.pending(),
            Register::FdcanTxbcr => transmitter.cancel_requests(),
            Register::FdcanTxbto => transmitter.sent(),
            Register::FdcanTxbcf => transmitter.cancelled(),
            Register::FdcanTxbtie => transmitter.sent_interrupts,
            Register::FdcanTxbcie => transmitter.cancelled_interrupts,
            Register::FdcanTxefc => events.config,
            Register::FdcanTxefs => events.status(interrupts),
            // Acknowledgements and requests read 0 once they are carried out; so do the registers of TTCAN.
            _ => 0,
        }
    }

    /// A register is written.
    pub fn write(&mut self, register: Register, value: u32, context: &mut DeviceContext<'_>) {
        let now = context.now();
        match register {
            Register::FdcanCccr => self.write_cccr(value, context),
            Register::FdcanTscv => self.kept.timestamp.clear(now),
            // The timeout counter does not run: enabling it is refused below.
            Register::FdcanTocv => {}
            Register::FdcanIr => self.kept.interrupts.clear(value),
            Register::FdcanIe => self.kept.interrupts.enable(value),
            Register::FdcanIls => self.kept.interrupts.select_lines(value),
            Register::FdcanIle => self.kept.interrupts.enable_lines(value),
            Register::FdcanNdat1 => self.kept.receiver.clear_new_data(0, value),
            Register::FdcanNdat2 => self.kept.receiver.clear_new_data(1, value),
            Register::FdcanRxf0a => self.kept.receiver.acknowledge(0, value),
            Register::FdcanRxf1a => self.kept.receiver.acknowledge(1, value),
            Register::FdcanTxefa => self.kept.events.acknowledge(value),
            Register::FdcanTxbtie => self.kept.transmitter.sent_interrupts = value,
            Register::FdcanTxbcie => self.kept.transmitter.cancelled_interrupts = value,
            Register::FdcanTxbar if !self.is_set(cccr::CCE) => {
                if !self.kept.transmitter.request(value) {
                    context.tell("TXBAR", "a request for the FIFO away from its put index");
                }
            }
            Register::FdcanTxbcr if !self.is_set(cccr::CCE) => {
                let outcome = self.kept.transmitter.cancel(value, self.kept.sending);
                self.raise(outcome);
            }
            Register::FdcanTxbar | Register::FdcanTxbcr => {
                context.tell(name(register), "written while CCE is set");
            }
            Register::FdcanTest if !self.is_set(cccr::TEST) => {
                if value != self.kept.test {
                    context.tell("TEST", "written while CCCR.TEST is clear");
                }
            }
            _ => self.write_configuration(register, value, context),
        }
    }

    /// The registers that can be written only while INIT and CCE are set.
    fn write_configuration(&mut self, register: Register, value: u32, context: &mut DeviceContext<'_>) {
        if self.kept.cccr & (cccr::INIT | cccr::CCE) != cccr::INIT | cccr::CCE {
            context.tell(name(register), "written without INIT and CCE, so it keeps what it holds");
            return;
        }
        let Kept { receiver, transmitter, events, timestamp, .. } = &mut self.kept;
        match register {
            Register::FdcanNbtp => {
                self.kept.nbtp = value & 0xFFFF_FF7F;
                self.follow_bit(context.now());
            }
            // Bit rates of CAN FD and their delay compensation: nothing uses them, as FDOE is refused.
            Register::FdcanDbtp => self.kept.dbtp = value,
            Register::FdcanTdcr => self.kept.tdcr = value,
            Register::FdcanTest => {
                self.kept.test = value;
                context.tell("TEST", "test modes are not modelled");
            }
            Register::FdcanRwd => {
                self.kept.rwd = value & 0xFF;
                if self.kept.rwd != 0 {
                    context.tell("RWD", "the watchdog of the message RAM is not modelled");
                }
            }
            Register::FdcanTscc => {
                if !timestamp.configure(context.now(), value) {
                    context.tell("TSCC", "the external timestamp counter is not modelled");
                }
            }
            Register::FdcanTocc => {
                self.kept.tocc = value & 0xFFFF_0007;
                if value & 1 != 0 {
                    context.tell("TOCC", "the timeout counter is not modelled");
                }
            }
            Register::FdcanGfc => receiver.filters.global = value & 0x3F,
            Register::FdcanSidfc => receiver.filters.standard = value & 0x00FF_FFFC,
            Register::FdcanXidfc => receiver.filters.extended = value & 0x007F_FFFC,
            Register::FdcanXidam => receiver.filters.extended_mask = value & 0x1FFF_FFFF,
            Register::FdcanRxf0c => receiver.fifos[0].config = value & 0xFF7F_FFFC,
            Register::FdcanRxf1c => receiver.fifos[1].config = value & 0xFF7F_FFFC,
            Register::FdcanRxbc => receiver.buffers = value & 0x0000_FFFC,
            Register::FdcanRxesc => receiver.element_sizes = value & 0x0000_0777,
            Register::FdcanTxbc => transmitter.config = value & 0x7F3F_FFFC,
            Register::FdcanTxesc => transmitter.element_size = value & 0x7,
            Register::FdcanTxefc => events.config = value & 0x3F3F_FFFC,
            // Read-only registers keep what they hold; TTCAN is refused.
            Register::FdcanCrel
            | Register::FdcanEndn
            | Register::FdcanEcr
            | Register::FdcanPsr
            | Register::FdcanHpms
            | Register::FdcanRxf0s
            | Register::FdcanRxf1s
            | Register::FdcanTxfqs
            | Register::FdcanTxbrp
            | Register::FdcanTxbto
            | Register::FdcanTxbcf
            | Register::FdcanTxefs => {}
            _ => context.tell(name(register), "TTCAN is not modelled"),
        }
    }

    fn write_cccr(&mut self, value: u32, context: &mut DeviceContext<'_>) {
        let old = self.kept.cccr;
        let configurable = old & (cccr::INIT | cccr::CCE) == cccr::INIT | cccr::CCE;
        let mut new = old & (cccr::CSA | cccr::INIT | cccr::CCE);
        new = new & !cccr::INIT | value & (cccr::INIT | cccr::CSR);
        // CCE follows only while INIT is set, and ends with it.
        if old & cccr::INIT != 0 {
            new = new & !cccr::CCE | value & cccr::CCE;
        }
        if new & cccr::INIT == 0 {
            new &= !cccr::CCE;
        }
        if new & cccr::CSR == 0 {
            new &= !cccr::CSA;
        }
        new |= if configurable { value & cccr::PROTECTED } else { old & cccr::PROTECTED };
        new |= value & cccr::SET_PROTECTED & if configurable { u32::MAX } else { old };
        for (bits, reason) in [
            (cccr::FDOE | cccr::BRSE | cccr::NISO, "CAN FD is not modelled"),
            (cccr::ASM, "restricted operation is not modelled"),
            (cccr::TEST, "test modes are not modelled"),
        ] {
            if new & !old & bits != 0 {
                context.tell("CCCR", reason);
            }
        }
        self.kept.cccr = new;
        if new & !old & cccr::CCE != 0 {
            self.kept.receiver.restart();
            self.kept.transmitter.restart();
            self.kept.events.restart();
        }
        if new & !old & cccr::INIT != 0 {
            self.leave_bus();
        } else if old & !new & cccr::INIT != 0 {
            let left = if self.kept.errors.is_bus_off() { RECOVERY_SEQUENCES } else { 1 };
            self.kept.presence = Presence::Waiting { left, since: context.now() };
        }
    }
}

/// The name of a register in the emulator's table.
fn name(register: Register) -> &'static str {
    use rigless::soc::Layout;
    register.spec().name
}
