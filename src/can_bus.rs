//! A CAN bus between the core and its controller: starts the controller as the core wants it,
//! hands frames over and tells of events. It waits for nothing: the task that has given the core an
//! event hands over what follows from it.

use gateway::{BusSetup, Event, Gateway, Instant, Outgoing, Transmit};
use host_protocol::BusState;

use crate::board;
use crate::fdcan::{self, CanEvent, CanPort, Controller, ErrorState};
use crate::flight::Core;
use crate::line::LineErrors;

/// A CAN bus of the board.
pub struct CanBus {
    bus: u8,
    port: &'static mut (dyn CanPort + Send),
    /// How it runs, as the core has asked for it.
    setup: Option<BusSetup>,
    /// The core has asked for another one.
    is_stale: bool,
    controller: Option<Controller>,
    /// The error state that the core knows.
    reported: Option<ErrorState>,
    losses: LineErrors,
}

impl CanBus {
    /// A bus that does not run yet.
    pub fn new(bus: u8, port: &'static mut (dyn CanPort + Send)) -> Self {
        let losses = LineErrors::default();
        Self { bus, port, setup: None, is_stale: true, controller: None, reported: None, losses }
    }

    /// Cancels what the core has replaced and hands over what it wants sent, as long as the
    /// controller is on the bus and has room. Returns whether there was something. A bus that must
    /// run otherwise is left to its task.
    #[inline(never)]
    pub fn serve(&mut self, core: &mut Core, now: Instant) -> bool {
        if core.bus_setup(self.bus) != self.setup {
            self.is_stale = true;
            fdcan::look();
            return false;
        }
        let Some(controller) = &mut self.controller else { return false };
        if !core.may_want(now, self.bus) {
            return false;
        }
        let mut has_polled = false;
        while !controller.is_empty()
            && let Some(slot) = core.poll_cancel(now, self.bus)
        {
            controller.cancel(slot);
            has_polled = true;
        }
        let is_off = self.reported.is_some_and(|reported| reported.state == BusState::BusOff);
        let mut wants = !is_off;
        while wants
            && controller.has_room()
            && let Some(Transmit { slot, frame, is_alone, .. }) = &core.poll_transmit(now, self.bus)
        {
            has_polled = true;
            match frame {
                Outgoing::Can(frame) => {
                    defmt::trace!("bus {=u8}: sends {}", self.bus, frame);
                    controller.send(*slot, frame);
                }
                Outgoing::Serial(_) => {
                    defmt::error!("bus {=u8}: bytes for a CAN bus", self.bus);
                }
            }
            wants = !is_alone && core.may_want(now, self.bus);
        }
        has_polled
    }

    /// The next event for the core. What cannot wait comes first: the setup, then lost frames,
    /// which a full queue must not hide.
    pub fn next(&mut self, core: &Gateway) -> Option<Event<'static>> {
        if self.is_stale {
            self.is_stale = false;
            self.start(core.bus_setup(self.bus));
            return self.changed_error_state();
        }
        let controller =
            self.controller.as_ref().filter(|controller| controller.events.take_any())?;
        let events = controller.events;
        let event = self.next_of_controller();
        if event.is_some() {
            events.may_have_more();
        }
        event
    }

    fn next_of_controller(&mut self) -> Option<Event<'static>> {
        let bus = self.bus;
        let controller = self.controller.as_mut()?;
        match controller.events.take_lost() {
            0 => {}
            lost => {
                if let Some(so_far) = self.losses.add(lost) {
                    defmt::warn!("bus {=u8}: {=u32} received frames lost so far", bus, so_far);
                }
                return Some(Event::ReceiveOverflow { bus, lost });
            }
        }
        match controller.next() {
            Some(CanEvent::Transmitted(slot)) => Some(Event::Transmitted { bus, slot }),
            Some(CanEvent::Cancelled(slot)) => Some(Event::Cancelled { bus, slot }),
            Some(CanEvent::Received(words)) => match fdcan::received(words) {
                Some(frame) => {
                    defmt::trace!("bus {=u8}: heard {}", bus, frame);
                    Some(Event::CanReceived { bus, frame })
                }
                None => Some(Event::ReceiveOverflow { bus, lost: 1 }),
            },
            None if controller.events.take_error_state() => self.changed_error_state(),
            None => None,
        }
    }

    /// Has its task look where the error state has changed: nothing may say so.
    pub fn look(&self) {
        let now = self.controller.as_ref().map(Controller::error_state);
        if let Some(controller) = &self.controller
            && now != self.reported
        {
            controller.events.report_error_state();
        }
    }

    /// Starts the controller anew.
    #[inline(never)]
    fn start(&mut self, setup: Option<BusSetup>) {
        let bus = self.bus;
        (self.setup, self.controller, self.reported) = (setup, None, None);
        let Some(BusSetup { bitrate, mode, .. }) = setup else { return };
        let Some(timing) = board::CAN_TIMINGS.iter().find(|timing| timing.bitrate == bitrate)
        else {
            defmt::warn!("bus {=u8}: no timing for {=u32} bit/s", bus, bitrate);
            return;
        };
        defmt::info!("bus {=u8}: CAN at {=u32} bit/s, {}", bus, bitrate, mode);
        // Safety: the controller of before has just been dropped.
        self.controller = Some(unsafe { self.port.start(timing, mode) });
    }

    /// A changed error state. Bus-off: drops all frames first; the core then has the bus started
    /// again.
    #[inline(never)]
    fn changed_error_state(&mut self) -> Option<Event<'static>> {
        let controller = self.controller.as_mut()?;
        let now = controller.error_state();
        if self.reported == Some(now) {
            return None;
        }
        if controller.is_stopped() {
            controller.drop_all();
        }
        match (self.reported.map(|reported| reported.state), now.state) {
            (Some(before), state) if before == state => {}
            (_, BusState::Active) => defmt::info!("bus {=u8}: {}", self.bus, now),
            _ => defmt::warn!("bus {=u8}: {}", self.bus, now),
        }
        self.reported = Some(now);
        let ErrorState { state, transmit_errors, receive_errors } = now;
        Some(Event::BusState { bus: self.bus, state, transmit_errors, receive_errors })
    }
}
