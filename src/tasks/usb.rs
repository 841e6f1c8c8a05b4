//! The host link on USB: the device itself, bytes in, frames out, and the way into the bootloader.
//!
//! Frames go out in a task of their own: what comes in may demand a stop, what goes out must not
//! take its time.

use core::future::pending;
use core::pin::pin;

use embassy_executor::Spawner;
use embassy_futures::join::{join, join4};
use gateway::Event;
use host_protocol::{DELIMITER, MAX_FRAME};

use crate::board::UsbPort;
use crate::line::LineErrors;
use crate::shared_gateway::SharedGateway;
use crate::task_budget::{TaskBudget, Urgency};
use crate::usb::{self, PACKET, Receiver, Sender};
use crate::watchdog::{TaskId, Watch};

/// For ever. Where the chip's USB does not start, the other links go on without it.
#[embassy_executor::task]
pub async fn usb(gateway: &'static SharedGateway, link: u8, port: UsbPort, spawner: Spawner) {
    let Some((driver, serial)) = port.start().await else {
        defmt::error!("host link {=u8}: the USB of this chip does not start", link);
        return;
    };
    let (mut device, receiver, sender) = usb::device(driver, serial, gateway);
    defmt::info!("host link {=u8}: USB, serial number {=str}", link, serial);
    spawner.spawn(defmt::unwrap!(usb_sender(gateway, link, sender)));
    join4(
        device.run(),
        receive(gateway, link, receiver),
        usb::bootloader::follow_requests(gateway),
        check_in(TaskId::USB),
    )
    .await;
}

/// For ever: frames from the core to the host.
#[embassy_executor::task]
async fn usb_sender(gateway: &'static SharedGateway, link: u8, sender: Sender) {
    join(send(gateway, link, sender), check_in(TaskId::link_sender(link))).await;
}

/// For ever: says that the task comes round. What it carries may wait for ever for a host.
async fn check_in(task: TaskId) -> ! {
    let watch = Watch::new(task);
    loop {
        watch.wait(pending::<()>()).await;
    }
}

/// For ever: bytes from the host to the core.
async fn receive(gateway: &SharedGateway, link: u8, mut receiver: Receiver) {
    let budget = TaskBudget::new(Urgency::Demand).await;
    let mut packet = [0; PACKET as usize];
    loop {
        let mut bytes = budget.wait(pin!(receiver.receive(&mut packet))).await;
        while !bytes.is_empty() {
            let (frame, rest) = bytes.split_at(first_frame(bytes));
            gateway.handle(Event::HostBytes { link, bytes: frame });
            bytes = rest;
            // A host that never stops writing must leave the processor to the others.
            budget.spend_one_of_many().await;
        }
    }
}

/// The length of the first frame in these bytes, with the delimiters around it; all of them where
/// none ends.
fn first_frame(bytes: &[u8]) -> usize {
    let is_delimiter = |byte: &u8| *byte == DELIMITER;
    let begin = bytes.iter().position(|byte| !is_delimiter(byte)).unwrap_or(bytes.len());
    let length = bytes.iter().skip(begin).position(is_delimiter);
    length.map_or(bytes.len(), |length| begin + length + 1)
}

/// For ever: frames from the core to the host.
async fn send(gateway: &SharedGateway, link: u8, mut sender: Sender) {
    let mut frame = [0; MAX_FRAME];
    let mut dropped = LineErrors::default();
    loop {
        gateway.save(|| ()).await;
        let Some(length) = gateway.poll_host(link, &mut frame) else {
            gateway.link_changed(link).await;
            continue;
        };
        if !sender.send(frame.get(..length).unwrap_or_default()).await
            && let Some(so_far) = dropped.add(1)
        {
            defmt::info!(
                "host link {=u8}: {=u32} frames dropped so far, as no host took them",
                link,
                so_far
            );
        }
    }
}
