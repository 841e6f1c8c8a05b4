//! A running controller: frames in by slot, events out, error state, cancellation.

use embassy_stm32::can::Can;
use embassy_stm32::pac;
use embassy_stm32::pac::can::Fdcan;
use embedded_can::Id;
use gateway::port::TRANSMIT_SLOTS;
use host_protocol::{BusState, CanFrame};

use super::can_events::{CanEvent, CanEvents, Instance};
use super::element;
use super::message_ram::MessageRam;

/// How often a bit is read that the controller sets within a few of its clocks; a bound, not a
/// measure of time.
const REGISTER_POLLS: usize = 1000;

/// Error state and counters.
#[derive(Clone, Copy, PartialEq, Eq, defmt::Format)]
pub struct ErrorState {
    /// The state.
    pub state: BusState,
    /// Transmit error counter, TEC.
    pub transmit_errors: u16,
    /// Receive error counter, REC.
    pub receive_errors: u16,
}

/// A frame in the controller.
#[derive(Clone, Copy)]
struct Held {
    id: Id,
    /// Its place in the transmit queue.
    place: usize,
    /// Its cancellation was asked for, or comes by itself where it does not leave at once, and its
    /// fate is not known yet.
    cancel_requested: bool,
    /// What has become of it, where another frame has taken its place since: the registers speak
    /// of that one now.
    fate: Option<Fate>,
}

/// What becomes of a frame in the controller.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    Transmitted,
    Cancelled,
}

impl Held {
    fn fate(&self, registers: Fdcan) -> Option<Fate> {
        let told = || {
            // In this order: a frame that leaves although it was to be cancelled sets both at once,
            // and between two reads in the other order would count as cancelled.
            let cancelled = registers.txbcf().read();
            let sent = registers.txbto().read();
            if sent.to(self.place) {
                Some(Fate::Transmitted)
            } else {
                (self.cancel_requested && cancelled.cf(self.place)).then_some(Fate::Cancelled)
            }
        };
        self.fate.or_else(told)
    }
}

/// A controller on its bus. Off the bus again when dropped.
pub struct Controller {
    registers: Fdcan,
    message_ram: MessageRam,
    /// What its interrupt has reported.
    pub events: &'static CanEvents,
    /// Holds the clock and the pins.
    _driver: Can<'static>,
    /// What has not left at once is cancelled (DAR).
    once: bool,
    /// The frames in the controller, by slot.
    held: [Option<Held>; TRANSMIT_SLOTS],
    /// A frame that may not join them yet.
    waiting: Option<(u8, CanFrame)>,
}

impl Controller {
    pub(super) fn new<T: Instance>(driver: Can<'static>, once: bool) -> Self {
        Self {
            registers: T::registers(),
            message_ram: T::message_ram(),
            events: T::events(),
            _driver: driver,
            once,
            held: [None; TRANSMIT_SLOTS],
            waiting: None,
        }
    }

    /// The next event; the slot of a frame that was sent or cancelled is free again then. A
    /// cancelled frame makes room for a stop: it comes first.
    pub fn next(&mut self) -> Option<CanEvent> {
        if self.events.take_cancellation_finished()
            && let Some(slot) = self.take_cancelled()
        {
            return Some(CanEvent::Cancelled(slot));
        }
        loop {
            match self.events.take()? {
                CanEvent::Transmitted(slot) if !self.release(slot) => {}
                event => return Some(event),
            }
        }
    }

    /// Asks for the cancellation of a frame. It is reported as sent or as cancelled.
    pub fn cancel(&mut self, slot: u8) {
        if self.waiting.take_if(|(waiting, _)| *waiting == slot).is_some() {
            self.events.report(CanEvent::Cancelled(slot));
        } else if let Some(Some(held @ Held { fate: None, .. })) =
            self.held.get_mut(usize::from(slot))
        {
            held.cancel_requested = true;
            let place = held.place;
            self.registers.txbcr().write(|w| w.set_cr(place, true));
        }
    }

    /// Frees the slot of a frame that was cancelled before it was sent; one that was sent all the
    /// same is reported as such.
    fn take_cancelled(&mut self) -> Option<u8> {
        let registers = self.registers;
        let is_cancelled = |held: &Held| held.fate(registers) == Some(Fate::Cancelled);
        let (slot, held) = (0u8..)
            .zip(&mut self.held)
            .find(|(_, held)| held.as_ref().is_some_and(is_cancelled))?;
        *held = None;
        // Another one may be cancelled too.
        self.events.report_cancellation();
        self.send_waiting();
        Some(slot)
    }

    /// Whether a frame can be taken over.
    pub fn has_room(&self) -> bool {
        self.waiting.is_none()
    }

    /// Whether it holds no frame.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_none() && self.held.iter().all(Option::is_none)
    }

    /// Sends a frame as soon as the bus allows.
    pub fn send(&mut self, slot: u8, frame: &CanFrame) {
        if !self.launch(slot, frame) {
            self.waiting = Some((slot, *frame));
        }
    }

    /// Moves the waiting frame into the controller, where it may join those that are there.
    fn send_waiting(&mut self) {
        if let Some((slot, frame)) = self.waiting
            && self.launch(slot, &frame)
        {
            self.waiting = None;
        }
    }

    /// Moves a frame into the controller unless its slot is taken or a frame of the same id is
    /// there: the controller might send the later one first, and so a setpoint after the stop that
    /// replaces it. Returns whether it has.
    fn launch(&mut self, slot: u8, frame: &CanFrame) -> bool {
        let status = self.registers.txfqs().read();
        let overtakes = self.held.iter().flatten().any(|held| held.id == frame.id());
        let place = usize::from(status.tfqpi());
        let taken = self.held.get(usize::from(slot)).is_none_or(Option::is_some);
        if overtakes || taken || status.tfqf() || !self.note_fate(place) {
            return false;
        }
        if let Some(held) = self.held.get_mut(usize::from(slot)) {
            let cancel_requested = self.once;
            *held = Some(Held { id: frame.id(), place, cancel_requested, fate: None });
        }
        self.message_ram.put(place, element::to_send(frame, slot));
        self.registers.txbar().write(|w| w.set_ar(place, true));
        true
    }

    /// Notes what has become of the frame that was in a place: the request of the next one there
    /// clears what TXBCF and TXBTO say of it. A stop need not wait until the task has come to
    /// it. False if neither says anything yet.
    fn note_fate(&mut self, place: usize) -> bool {
        let registers = self.registers;
        self.held.iter_mut().flatten().filter(|held| held.place == place).all(|held| {
            held.fate = held.fate(registers);
            held.fate.is_some()
        })
    }

    /// Frees the slot of a sent frame; false if it held none.
    fn release(&mut self, slot: u8) -> bool {
        let held = self.held.get_mut(usize::from(slot)).and_then(Option::take).is_some();
        self.send_waiting();
        held
    }

    /// Drops every frame that a stopped controller has not sent. None is reported as sent any more.
    pub fn drop_all(&mut self) {
        self.waiting = None;
        self.held = [None; TRANSMIT_SLOTS];
        self.wipe();
    }

    /// Takes the controller off the bus.
    fn leave_bus(&mut self) {
        self.registers.cccr().modify(|w| w.set_init(true));
        // INIT crosses clock domains; nothing that depends on it may be written before it reads
        // back.
        for _ in 0..REGISTER_POLLS {
            if self.registers.cccr().read().init() {
                break;
            }
        }
    }

    /// Resets the transmit queue and the FIFOs: the effect of CCE, which needs INIT (RM0433 and
    /// RM0440, FDCAN chapter, software initialisation). The controller is off the bus
    /// afterwards.
    fn wipe(&mut self) {
        self.leave_bus();
        self.registers.cccr().modify(|w| w.set_cce(true));
        for _ in 0..REGISTER_POLLS {
            if self.registers.txbrp().read().0 == 0 {
                break;
            }
        }
        self.registers.cccr().modify(|w| w.set_cce(false));
    }

    /// The error state now. A controller that stopped after a failed access to its message RAM
    /// counts as off the bus.
    pub fn error_state(&self) -> ErrorState {
        let status = self.registers.psr().read();
        let counters = self.registers.ecr().read();
        let state = if status.bo() || self.registers.cccr().read().asm() {
            BusState::BusOff
        } else if status.ep() {
            BusState::Passive
        } else if status.ew() {
            BusState::Warning
        } else {
            BusState::Active
        };
        ErrorState {
            state,
            transmit_errors: counters.tec().into(),
            receive_errors: counters.rec().into(),
        }
    }

    /// Whether the controller has stopped: it takes part in the bus again once it has been started
    /// again.
    pub fn is_stopped(&self) -> bool {
        let control = self.registers.cccr().read();
        control.init() || control.asm()
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        // Two controllers share one clock gate: with the other one running this one would go on.
        self.registers.ie().write_value(pac::can::regs::Ie(0));
        self.leave_bus();
        // Nor would the next start, which resets the block only where the other one does not run, end
        // its restricted operation.
        self.registers.cccr().modify(|w| w.set_asm(false));
    }
}
