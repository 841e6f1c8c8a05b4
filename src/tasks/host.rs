//! One host link on a UART: bytes in, frames out.

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Timer, with_timeout};
use gateway::Event;
use host_protocol::MAX_FRAME;

use crate::board;
use crate::line::{LineErrors, Receiver, Sender};
use crate::shared_gateway::SharedGateway;
use crate::turn::{Turn, Urgency};
use crate::watchdog::{Life, Watch};

/// Bytes given to the core at once.
const CHUNK: usize = 128;
/// Longest wait for the end of a frame before what has come is taken: 92 bytes at 921600 baud, less than a ring holds.
const REST: Duration = Duration::from_millis(1);
/// Rest after a line error, so that a floating or noisy line does not take the processor.
const ERROR_PAUSE: Duration = Duration::from_micros(100);

/// For ever: bytes from the host to the core.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn receive(gateway: &'static SharedGateway, link: u8, mut line: Receiver) -> ! {
    let life = Watch::new(Life::link_receiver(link));
    let turn = Turn::of(Urgency::Demand).await;
    let mut chunk = [0; CHUNK];
    let mut errors = LineErrors::default();
    loop {
        if let Some(so_far) = errors.add(line.events.take_errors()) {
            defmt::warn!("host link {=u8}: {=u32} line errors so far", link, so_far);
        }
        match turn.wait(life.alive(select(line.bytes.read(&mut chunk), line.events.delimiter()))).await {
            Some(Either::First(Ok(length))) => {
                let bytes = chunk.get(..length).unwrap_or_default();
                gateway.handle(Event::HostBytes { link, bytes });
                // On a busy line there is always another byte: the others must have the processor in between.
                turn.end().await;
                // The rest of a frame is taken with its end, not a byte at a time.
                let _ = turn.wait(with_timeout(REST, line.events.delimiter())).await;
            }
            Some(Either::First(Err(error))) => {
                defmt::warn!("host link {=u8}: {}", link, error);
                Timer::after(ERROR_PAUSE).await;
            }
            // A whole frame may lie in the ring: read again at once.
            Some(Either::Second(())) | None => {}
        }
    }
}

/// For ever: frames from the core to the host.
#[embassy_executor::task(pool_size = board::HOST_UARTS)]
pub async fn send(gateway: &'static SharedGateway, link: u8, mut line: Sender) -> ! {
    let life = Watch::new(Life::link_sender(link));
    let mut frame = [0; MAX_FRAME];
    loop {
        life.show();
        gateway.save().await;
        let Some(length) = gateway.poll_host(link, &mut frame) else {
            while life.alive(gateway.link_changed(link)).await.is_none() {}
            continue;
        };
        if line.send(frame.get(..length).unwrap_or_default()).await.is_err() {
            defmt::warn!("host link {=u8}: a frame of {=usize} bytes did not leave in time", link, length);
        }
    }
}
