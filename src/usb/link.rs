//! The two ends of the serial port.

use embassy_time::{Duration, with_timeout};
use embassy_usb::class::cdc_acm;
use embassy_usb::driver::EndpointError;

use super::Driver;

/// Bytes of a packet: the most of a bulk endpoint at full speed.
pub const PACKET: u16 = 64;
const PACKET_BYTES: usize = PACKET as usize;
/// How long the host may take to fetch one frame: about nine packets, which take it a millisecond
/// or two unless nobody reads.
const FRAME_DEADLINE: Duration = Duration::from_millis(50);

/// From the host.
pub struct Receiver {
    port: cdc_acm::Receiver<'static, Driver>,
}

impl Receiver {
    pub(super) fn new(port: cdc_acm::Receiver<'static, Driver>) -> Self {
        Self { port }
    }

    /// Waits for the next packet, through every absence of the host. Dropping the future loses
    /// nothing.
    pub async fn receive<'b>(&mut self, packet: &'b mut [u8; PACKET_BYTES]) -> &'b [u8] {
        let length = loop {
            self.port.wait_connection().await;
            if let Ok(length) = self.port.read_packet(packet).await {
                break length;
            }
        };
        packet.get(..length).unwrap_or_default()
    }
}

/// To the host.
pub struct Sender {
    port: cdc_acm::Sender<'static, Driver>,
}

impl Sender {
    pub(super) fn new(port: cdc_acm::Sender<'static, Driver>) -> Self {
        Self { port }
    }

    /// Hands a whole frame over, or drops what is left of it: the frame after it begins with a
    /// delimiter. Whether it was sent: not where no host has set the device up, nor where one does
    /// not fetch it in time, as it is suspended, unplugged, or no program reads.
    pub async fn send(&mut self, frame: &[u8]) -> bool {
        with_timeout(FRAME_DEADLINE, self.send_packets(frame)).await.is_ok_and(|sent| sent.is_ok())
    }

    async fn send_packets(&mut self, frame: &[u8]) -> Result<(), EndpointError> {
        for packet in frame.chunks(PACKET_BYTES) {
            self.port.write_packet(packet).await?;
        }
        if frame.len().is_multiple_of(PACKET_BYTES) {
            // After a full packet the host waits for more; an empty one tells it that this was all.
            self.port.write_packet(&[]).await?;
        }
        Ok(())
    }
}
