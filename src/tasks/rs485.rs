//! One RS485 bus: carries bytes both ways and reports when the last bit of a frame has left.

use core::cell::Cell;

use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use gateway::{BusSetup, Event, Outgoing, PAUSE_BITS, Then, Transmit};
use host_protocol::BusState;

use crate::board;
use crate::line::{LineErrors, Overflow, Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// Bytes given to the core at once.
const CHUNK: usize = 32;

/// For ever: run the bus as configured, start it again when the configuration changes or the
/// transmitter hangs.
#[embassy_executor::task(pool_size = board::RS485_BUSES)]
pub async fn rs485(
    gateway: &'static SharedGateway,
    bus: u8,
    mut receiver: Receiver,
    mut sender: Sender,
) -> ! {
    let watch = Watch::new(TaskId::bus(bus));
    loop {
        let Some(setup) = gateway.other_bus_setup(bus, None, &watch).await else { continue };
        if let Err(error) = sender.set_bits_per_second(setup.bitrate) {
            defmt::warn!("bus {=u8}: {=u32} baud: {}", bus, setup.bitrate, error);
            gateway.other_bus_setup(bus, Some(setup), &watch).await;
            continue;
        }
        defmt::info!("bus {=u8}: RS485 at {=u32} baud", bus, setup.bitrate);
        report(gateway, bus, BusState::Active);
        // What has come is looked at first: when the line is free for the next frame, a stop too,
        // follows from it.
        let line = Line::default();
        select(
            receive(gateway, bus, &mut receiver, &line),
            send(gateway, bus, &mut sender, setup, &line, &watch),
        )
        .await;
    }
}

/// A serial port has no error counters.
fn report(gateway: &SharedGateway, bus: u8, state: BusState) {
    gateway.handle(Event::BusState { bus, state, transmit_errors: 0, receive_errors: 0 });
}

/// What the two halves of a line share.
#[derive(Default)]
struct Line {
    /// The slot of the frame that is being sent, while the core does not know that it has left.
    under_way: Cell<Option<u8>>,
    /// How much is heard when the echo of the latest frame is.
    echoed_at: Cell<u32>,
    /// How much is heard when the reply has come that a frame is kept for.
    answered_at: Cell<Option<u32>>,
    /// It has: the frame goes out.
    answered: Signal<NoopRawMutex, ()>,
}

impl Line {
    /// A frame of so many bytes begins.
    fn begins(&self, slot: u8, length: usize, heard: u32) {
        self.under_way.set(Some(slot));
        self.echoed_at.set(heard.wrapping_add(count(length)));
    }

    /// Tells the core that the frame under way has left, once.
    fn transmitted(&self, gateway: &SharedGateway, bus: u8) {
        if let Some(slot) = self.under_way.take() {
            gateway.handle(Event::Transmitted { bus, slot });
        }
    }
}

fn count(bytes: usize) -> u32 {
    u32::try_from(bytes).unwrap_or(u32::MAX)
}

/// Bytes from the bus to the core, our own echo included.
async fn receive(gateway: &SharedGateway, bus: u8, receiver: &mut Receiver, line: &Line) {
    let watch = Watch::new(TaskId::bus_receiver(bus));
    let budget = TaskBudget::new(Urgency::Bus).await;
    let mut chunk = [0; CHUNK];
    let (mut errors, mut overflows) = (LineErrors::default(), LineErrors::default());
    loop {
        let Some(result) = budget.wait(watch.wait(receiver.read(&mut chunk))).await else {
            continue;
        };
        let mut lost = receiver.events.take_errors();
        if let Some(so_far) = errors.add(lost) {
            defmt::warn!("bus {=u8}: {=u32} line errors so far", bus, so_far);
        }
        match result {
            Ok(0) => {}
            Ok(length) => {
                let bytes = chunk.get(..length).unwrap_or_default();
                defmt::trace!("bus {=u8}: heard {=[u8]:02x}", bus, bytes);
                // Where there was much to do a whole reply may be among them.
                if receiver.events.has_sent() {
                    line.transmitted(gateway, bus);
                }
                let is_answer = line.answered_at.get() == Some(receiver.events.heard());
                let then = match receiver.was_idle {
                    // Unless the core wants back what is kept for it.
                    true if is_answer && !gateway.may_want(bus) => Then::Frame,
                    true => Then::Idle,
                    false => Then::Bytes,
                };
                if then == Then::Frame {
                    line.answered_at.set(None);
                    line.answered.signal(());
                    // It goes first: what the core makes of the reply takes as long as a frame.
                    yield_now().await;
                }
                gateway.handle(Event::SerialReceived { bus, bytes, then });
            }
            Err(Overflow) => {
                lost += 1;
                if let Some(so_far) = overflows.add(1) {
                    defmt::warn!("bus {=u8}: {=u32} overflows so far", bus, so_far);
                }
            }
        }
        if lost > 0 {
            gateway.handle(Event::ReceiveOverflow { bus, lost });
        }
    }
}

/// Frames from the core to the bus, until the setup changes.
async fn send(
    gateway: &SharedGateway,
    bus: u8,
    sender: &mut Sender,
    setup: BusSetup,
    line: &Line,
    watch: &Watch,
) {
    let mut heard = None;
    loop {
        watch.check_in();
        let wants = gateway.may_want(bus);
        if wants && !gateway.awaits_reply(bus) {
            sender.between_bytes().await;
            // Each wait may have taken long where there is much to do.
            watch.check_in();
        }
        if gateway.bus_setup(bus) != Some(setup) {
            return;
        }
        match wants.then(|| gateway.poll_transmit(bus)).flatten() {
            Some(Transmit { slot, frame: Outgoing::Serial(bytes), behind_reply, .. }) => {
                defmt::trace!("bus {=u8}: sends {=[u8]:02x}", bus, bytes);
                if behind_reply {
                    line.answered.reset();
                    line.answered_at
                        .set(Some(line.echoed_at.get().wrapping_add(count(bytes.len()))));
                    if !is_answered(gateway, bus, slot, setup, line, watch).await {
                        continue;
                    }
                    sender.has_been_idle(PAUSE_BITS).await;
                    if gateway.bus_setup(bus) != Some(setup) {
                        return;
                    }
                }
                // Not even the echo of the frame before has come: the ring no longer takes what
                // comes.
                let before = heard.replace(sender.events.heard());
                if before == heard {
                    sender.events.ask_for_restart();
                }
                line.begins(slot, bytes.len(), sender.events.heard());
                if sender.send(&bytes).await.is_err() {
                    line.under_way.set(None);
                    defmt::warn!(
                        "bus {=u8}: {=usize} bytes did not leave in time",
                        bus,
                        bytes.len()
                    );
                    // The frame is lost: the core stops what was armed here and starts the bus
                    // again.
                    report(gateway, bus, BusState::BusOff);
                    gateway.other_bus_setup(bus, Some(setup), watch).await;
                    return;
                }
                line.transmitted(gateway, bus);
            }
            Some(Transmit { frame: Outgoing::Can(_), .. }) => {
                defmt::error!("bus {=u8}: a CAN frame for RS485", bus)
            }
            None => {
                // Nothing is kept here: it is given back at once.
                while let Some(slot) = wants.then(|| gateway.poll_cancel(bus)).flatten() {
                    gateway.handle(Event::Cancelled { bus, slot });
                }
                while watch.wait(gateway.bus_changed(bus)).await.is_none() {}
            }
        }
    }
}

/// Waits until the reply has come that the frame in `slot` is kept for. Returns false where the
/// core wants it back before, or the bus otherwise.
async fn is_answered(
    gateway: &SharedGateway,
    bus: u8,
    slot: u8,
    setup: BusSetup,
    line: &Line,
    watch: &Watch,
) -> bool {
    loop {
        match watch.wait(select(line.answered.wait(), gateway.bus_changed(bus))).await {
            Some(Either::First(())) => return true,
            Some(Either::Second(())) if gateway.bus_setup(bus) != Some(setup) => {
                line.answered_at.set(None);
                return false;
            }
            Some(Either::Second(())) if gateway.may_want(bus) => {
                let mut is_wanted_back = false;
                while let Some(wanted) = gateway.poll_cancel(bus) {
                    is_wanted_back |= wanted == slot;
                }
                if is_wanted_back {
                    line.answered_at.set(None);
                    gateway.handle(Event::Cancelled { bus, slot });
                    return false;
                }
            }
            _ => {}
        }
    }
}
