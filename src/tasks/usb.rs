//! The host link on USB: the device itself, bytes in, frames out, and the way into the bootloader.

use core::future::pending;

use embassy_futures::join::join5;
use gateway::Event;
use host_protocol::MAX_FRAME;

use crate::board::UsbPort;
use crate::line::LineErrors;
use crate::shared_gateway::SharedGateway;
use crate::turn::{Turn, Urgency};
use crate::usb::{self, PACKET, Receiver, Sender};
use crate::watchdog::{Life, Watch};

/// For ever. Where the chip's USB does not start, the other links go on without it.
#[embassy_executor::task]
pub async fn usb(gateway: &'static SharedGateway, link: u8, port: UsbPort) {
    let Some((driver, serial)) = port.start().await else {
        defmt::error!("host link {=u8}: the USB of this chip does not start", link);
        return;
    };
    let (mut device, receiver, sender) = usb::device(driver, serial, gateway);
    defmt::info!("host link {=u8}: USB, serial number {=str}", link, serial);
    join5(
        device.run(),
        receive(gateway, link, receiver),
        send(gateway, link, sender),
        usb::bootloader::follow_requests(gateway),
        show_life(),
    )
    .await;
}

/// For ever: shows that the task comes round. What it carries may wait for ever for a host.
async fn show_life() -> ! {
    let life = Watch::new(Life::USB);
    loop {
        life.alive(pending::<()>()).await;
    }
}

/// For ever: bytes from the host to the core.
async fn receive(gateway: &SharedGateway, link: u8, mut receiver: Receiver) {
    let turn = Turn::of(Urgency::Demand).await;
    let mut packet = [0; PACKET as usize];
    loop {
        let bytes = turn.wait(receiver.receive(&mut packet)).await;
        gateway.handle(Event::HostBytes { link, bytes });
        // A host that never stops writing must leave the processor to the others.
        turn.end().await;
    }
}

/// For ever: frames from the core to the host.
async fn send(gateway: &SharedGateway, link: u8, mut sender: Sender) {
    let mut frame = [0; MAX_FRAME];
    let mut dropped = LineErrors::default();
    loop {
        let Some(length) = gateway.poll_host(link, &mut frame) else {
            gateway.link_changed(link).await;
            continue;
        };
        if sender.send(frame.get(..length).unwrap_or_default()).await.is_err()
            && let Some(so_far) = dropped.add(1)
        {
            defmt::info!("host link {=u8}: {=u32} frames dropped so far, as no host took them", link, so_far);
        }
    }
}
