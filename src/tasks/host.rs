//! One host link on a UART: bytes in, frames out.

use core::mem;

use gateway::Event;
use host_protocol::{DEFAULT_BAUD, MAX_FRAME, Pieces};

use crate::board;
use crate::line::{LineErrors, Overflow, Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::watchdog::{TaskId, Watch};

/// Bytes given to the core at once: hardly more than one request, as what follows from a stop leaves
/// before the next.
const PIECE: usize = 32;

/// Line errors without a byte after which a ring counts as stuck.
const SILENT_ERRORS: u32 = 16;

/// For ever: bytes from the host to the core.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn receive(gateway: &'static SharedGateway, link: u8, mut line: Receiver) -> ! {
    let watch = Watch::new(TaskId::link_receiver(link));
    let budget = TaskBudget::new(Urgency::Demand).await;
    let mut pieces = Pieces::<PIECE>::new();
    let (mut errors, mut overflows) = (LineErrors::default(), LineErrors::default());
    let (mut heard, mut silent_errors) = (0, 0);
    loop {
        let new_errors = line.events.take_errors();
        if let Some(so_far) = errors.add(new_errors) {
            defmt::warn!("host link {=u8}: {=u32} line errors so far", link, so_far);
        }
        // Perhaps the host has lost the rate: the core judges that.
        if new_errors > 0 && gateway.baud(link) != DEFAULT_BAUD {
            gateway.handle(Event::HostLineError { link });
        }
        let before = mem::replace(&mut heard, line.events.heard());
        silent_errors = if heard == before { silent_errors + new_errors } else { 0 };
        // Nothing but errors, not even wrong bytes: the ring no longer takes what comes.
        if silent_errors >= SILENT_ERRORS {
            silent_errors = 0;
            line.events.ask_for_restart();
        }
        let piece = match budget.wait(watch.wait(line.read(pieces.room()))).await {
            None => None,
            Some(Ok(length)) => pieces.add(length),
            Some(Err(Overflow)) => {
                if let Some(so_far) = overflows.add(1) {
                    defmt::warn!("host link {=u8}: {=u32} overflows so far", link, so_far);
                }
                // What follows is the rest of some frame: this ends what had come of one.
                pieces.end()
            }
        };
        if let Some(bytes) = piece {
            gateway.handle(Event::HostBytes { link, bytes });
        }
    }
}

/// For ever: frames from the core to the host, at the rate that the core wants when the last has
/// left.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn send(gateway: &'static SharedGateway, link: u8, mut line: Sender) -> ! {
    let watch = Watch::new(TaskId::link_sender(link));
    let mut baud = DEFAULT_BAUD;
    loop {
        watch.check_in();
        let before = mem::replace(&mut baud, gateway.baud(link));
        if baud != before {
            match line.set_bits_per_second(baud) {
                Ok(()) => defmt::info!("host link {=u8}: {=u32} baud", link, baud),
                Err(error) => {
                    defmt::warn!("host link {=u8}: {=u32} baud: {}", link, baud, error);
                }
            }
        }
        gateway.save(|| watch.check_in()).await;
        let room = line.message().first_chunk_mut::<MAX_FRAME>();
        let Some(length) = room.and_then(|frame| gateway.poll_host(link, frame)) else {
            while watch.wait(gateway.link_changed(link)).await.is_none() {}
            continue;
        };
        if line.send_held(length).await.is_err() {
            defmt::warn!(
                "host link {=u8}: a frame of {=usize} bytes did not leave in time",
                link,
                length
            );
        }
    }
}
