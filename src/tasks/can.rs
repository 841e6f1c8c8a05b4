//! One CAN bus: starts the controller as the core wants it, and carries frames and error states.

use embassy_futures::select::{Either, select};
use gateway::{BusSetup, Event, Outgoing, Transmit};
use host_protocol::BusState;

use crate::board;
use crate::fdcan::{CanEvent, CanPort, Controller, ErrorState};
use crate::line::LineErrors;
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// For ever: run the bus as configured, start it again when the configuration changes.
#[embassy_executor::task(pool_size = board::CAN_BUSES)]
pub async fn can(gateway: &'static SharedGateway, bus: u8, port: &'static mut dyn CanPort) -> ! {
    let watch = Watch::new(TaskId::bus(bus));
    let budget = TaskBudget::new(Urgency::Bus).await;
    let mut current = None;
    loop {
        current = gateway.other_bus_setup(bus, current, &watch).await;
        let Some(setup) = current else { continue };
        let Some(timing) = board::CAN_TIMINGS.iter().find(|timing| timing.bitrate == setup.bitrate)
        else {
            defmt::warn!("bus {=u8}: no timing for {=u32} bit/s", bus, setup.bitrate);
            continue;
        };
        defmt::info!("bus {=u8}: CAN at {=u32} bit/s", bus, setup.bitrate);
        CanBus {
            gateway,
            bus,
            controller: port.start(timing),
            reported: None,
            losses: LineErrors::default(),
        }
        .run(setup, &watch, &budget)
        .await;
    }
}

/// A bus while it runs with one setup.
struct CanBus<'d> {
    gateway: &'static SharedGateway,
    bus: u8,
    controller: Controller<'d>,
    /// The error state that the core knows.
    reported: Option<ErrorState>,
    losses: LineErrors,
}

impl CanBus<'_> {
    /// Until the setup changes.
    async fn run(mut self, setup: BusSetup, watch: &Watch, budget: &TaskBudget) {
        self.follow_error_state().await;
        let mut followed = false;
        while self.gateway.bus_setup_to_poll(self.bus) == Some(setup) {
            self.cancel();
            self.send();
            // A full queue must not keep the other tasks waiting; what another task's event brings
            // about counts there.
            if core::mem::take(&mut followed) {
                budget.spend().await;
            } else {
                budget.pause().await;
            }
            if let Either::Second(event) = budget.wait(self.next(watch)).await {
                self.follow(event).await;
                self.report_losses();
                followed = true;
                // What follows from it takes as long again, and a demand may have come.
                budget.pause().await;
            }
        }
    }

    /// Waits until the core wants something or the controller does something. The core goes first:
    /// what it wants may be a stop, and a frame that has come can wait. Meanwhile nothing may
    /// say that the error state changes: each pulse looks.
    async fn next(&mut self, watch: &Watch) -> Either<(), CanEvent> {
        loop {
            let changed = self.gateway.bus_changed(self.bus);
            if let Some(next) = watch.wait(select(changed, self.controller.next())).await {
                return next;
            }
            self.follow_error_state().await;
        }
    }

    /// Tells the core what the controller did.
    async fn follow(&mut self, event: CanEvent) {
        let bus = self.bus;
        match event {
            CanEvent::Transmitted(slot) => self.gateway.handle(Event::Transmitted { bus, slot }),
            CanEvent::Cancelled(slot) => self.gateway.handle(Event::Cancelled { bus, slot }),
            CanEvent::Received(frame) => {
                defmt::trace!("bus {=u8}: heard {}", bus, frame);
                self.gateway.handle(Event::CanReceived { bus, frame });
            }
            CanEvent::ErrorState => self.follow_error_state().await,
            // The controller keeps these for itself.
            CanEvent::CancellationFinished => {}
        }
    }

    /// Cancels what the core has replaced.
    fn cancel(&mut self) {
        while let Some(slot) = self.gateway.poll_cancel(self.bus) {
            self.controller.cancel(slot);
        }
    }

    /// Hands over what the core wants sent, as long as the controller is on the bus and has room.
    fn send(&mut self) {
        let off = self.reported.is_some_and(|reported| reported.state == BusState::BusOff);
        while !off && self.controller.has_room() {
            match self.gateway.poll_transmit(self.bus) {
                Some(Transmit { slot, frame: Outgoing::Can(frame) }) => {
                    defmt::trace!("bus {=u8}: sends {}", self.bus, frame);
                    self.controller.send(slot, frame);
                }
                Some(Transmit { frame: Outgoing::Serial(_), .. }) => {
                    defmt::error!("bus {=u8}: bytes for a CAN bus", self.bus);
                }
                None => break,
            }
        }
    }

    /// Reports a changed error state. Bus-off: cancels all frames first; the core then has the bus
    /// started again.
    async fn follow_error_state(&mut self) {
        let now = self.controller.error_state();
        if self.reported == Some(now) {
            return;
        }
        if self.controller.is_stopped() {
            self.controller.cancel_all().await;
        }
        self.log_state(now);
        self.reported = Some(now);
        let ErrorState { state, transmit_errors, receive_errors } = now;
        self.gateway.handle(Event::BusState {
            bus: self.bus,
            state,
            transmit_errors,
            receive_errors,
        });
    }

    fn log_state(&self, now: ErrorState) {
        match (self.reported.map(|reported| reported.state), now.state) {
            (Some(before), state) if before == state => {}
            (_, BusState::Active) => defmt::info!("bus {=u8}: {}", self.bus, now),
            _ => defmt::warn!("bus {=u8}: {}", self.bus, now),
        }
    }

    fn report_losses(&mut self) {
        let lost = self.controller.take_lost();
        if lost > 0 {
            if let Some(so_far) = self.losses.add(lost) {
                defmt::warn!("bus {=u8}: {=u32} received frames lost so far", self.bus, so_far);
            }
            self.gateway.handle(Event::ReceiveOverflow { bus: self.bus, lost });
        }
    }
}
