//! One RS485 bus: carries bytes both ways and reports when the last bit of a frame has left.

use core::cell::Cell;

use embassy_futures::select::select;
use gateway::{BusSetup, Event, Outgoing, Transmit};
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
        let under_way = Cell::new(None);
        select(
            receive(gateway, bus, &mut receiver, &under_way),
            send(gateway, bus, &mut sender, setup, &under_way, &watch),
        )
        .await;
    }
}

/// A serial port has no error counters.
fn report(gateway: &SharedGateway, bus: u8, state: BusState) {
    gateway.handle(Event::BusState { bus, state, transmit_errors: 0, receive_errors: 0 });
}

/// The slot of the frame that is being sent, while the core does not know that it has left.
type UnderWay = Cell<Option<u8>>;

/// Tells the core that the frame under way has left, once.
fn transmitted(gateway: &SharedGateway, bus: u8, under_way: &UnderWay) {
    if let Some(slot) = under_way.take() {
        gateway.handle(Event::Transmitted { bus, slot });
    }
}

/// Bytes from the bus to the core, our own echo included.
async fn receive(gateway: &SharedGateway, bus: u8, receiver: &mut Receiver, under_way: &UnderWay) {
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
                    transmitted(gateway, bus, under_way);
                }
                let idle = receiver.was_idle;
                gateway.handle(Event::SerialReceived { bus, bytes, idle });
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
    under_way: &UnderWay,
    watch: &Watch,
) {
    let mut heard = None;
    loop {
        watch.check_in();
        let wants = gateway.may_want(bus);
        if wants {
            sender.between_bytes().await;
            // Each wait may have taken long where there is much to do.
            watch.check_in();
        }
        if gateway.bus_setup(bus) != Some(setup) {
            return;
        }
        match wants.then(|| gateway.poll_transmit(bus)).flatten() {
            Some(Transmit { slot, frame: Outgoing::Serial(bytes), .. }) => {
                defmt::trace!("bus {=u8}: sends {=[u8]:02x}", bus, bytes);
                // Not even the echo of the frame before has come: the ring no longer takes what
                // comes.
                let before = heard.replace(sender.events.heard());
                if before == heard {
                    sender.events.ask_for_restart();
                }
                under_way.set(Some(slot));
                if sender.send(&bytes).await.is_err() {
                    under_way.set(None);
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
                transmitted(gateway, bus, under_way);
            }
            Some(Transmit { frame: Outgoing::Can(_), .. }) => {
                defmt::error!("bus {=u8}: a CAN frame for RS485", bus)
            }
            None => while watch.wait(gateway.bus_changed(bus)).await.is_none() {},
        }
    }
}
