//! How every board sets its UARTs up.

use embassy_stm32::gpio::Pull;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Uart};

use crate::dma_memory::Buffer;
use crate::line::{self, Receiver, Sender};

/// Bitrate of the host links.
pub const HOST_BITS_PER_SECOND: u32 = 921_600;
/// Bytes of each host link's DMA ring: 2.8 ms at 921600 baud.
pub const HOST_RING: usize = 256;
/// Bytes of an RS485 bus's DMA ring: 1.28 ms at 2 Mbaud.
pub const RS485_RING: usize = 256;
/// The longest message to a host, and on an RS485 bus, bytes.
pub const HOST_MESSAGE: usize = host_protocol::MAX_FRAME;
pub const RS485_MESSAGE: usize = gateway::port::MAX_SERIAL;
/// Lead and tail of the RS485 driver-enable in sixteenths of a bit: one bit each. The driver uses
/// one value for both.
const DRIVER_ENABLE_SIXTEENTHS: u8 = 16;

/// 8N1 at a bitrate.
pub fn config(bits_per_second: u32) -> usart::Config {
    let mut config = usart::Config::default();
    config.baudrate = bits_per_second;
    // An open input reads as an idle line.
    config.rx_pull = Pull::Up;
    config.de_assertion_time = DRIVER_ENABLE_SIXTEENTHS;
    config.de_deassertion_time = DRIVER_ENABLE_SIXTEENTHS;
    config
}

/// The two halves of a host link, with a ring of [`HOST_RING`] bytes and room for a message of
/// [`HOST_MESSAGE`].
pub fn host_line<T: line::Instance>(
    uart: Uart<'static, Async>,
    ring: Buffer,
    message: Buffer,
) -> (Receiver, Sender) {
    let (sender, receiver) = uart.split();
    let sender = Sender::new::<T>(sender, message, HOST_BITS_PER_SECOND);
    (Receiver::with_delimiters::<T>(receiver, ring), sender)
}

/// The two halves of an RS485 bus that was set up with this bitrate, with a ring of [`RS485_RING`]
/// bytes and room for a message of [`RS485_MESSAGE`].
pub fn rs485_line<T: line::Instance>(
    uart: Uart<'static, Async>,
    ring: Buffer,
    message: Buffer,
    bits_per_second: u32,
) -> (Receiver, Sender) {
    let (sender, receiver) = uart.split();
    (Receiver::new::<T>(receiver, ring), Sender::new::<T>(sender, message, bits_per_second))
}
