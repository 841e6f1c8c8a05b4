//! How every board sets its UARTs up.

use embassy_stm32::gpio::Pull;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Uart};
use host_protocol::DEFAULT_BAUD;

use crate::dma_memory::Buffer;
use crate::line::{self, Receiver, Sender};

/// The rates of the host links.
pub const HOST_BAUDS: [u32; 5] = [DEFAULT_BAUD, 1_000_000, 1_500_000, 2_000_000, 3_000_000];
/// How far a rate may be off, per mille: two ends together stay below 2 per cent where the other is
/// as good. A receiver bears 3.3 per cent (RM0433 and RM0440, "Tolerance of the USART receiver").
const MOST_OFF: u32 = 11;
/// Bytes of each host link's DMA ring: 3.4 ms at 3 Mbaud.
pub const HOST_RING: usize = 1024;
/// Bytes of an RS485 bus's DMA ring: 1.28 ms at 2 Mbaud.
pub const RS485_RING: usize = 256;
/// The longest message to a host, and on an RS485 bus, bytes.
pub const HOST_MESSAGE: usize = host_protocol::MAX_FRAME;
pub const RS485_MESSAGE: usize = gateway::port::MAX_SERIAL;
/// Lead and tail of the RS485 driver-enable in sixteenths of a bit: one bit each. The driver uses
/// one value for both.
const DRIVER_ENABLE_SIXTEENTHS: u8 = 16;

/// Whether this clock of a UART, divided by whole numbers, gives all [`HOST_BAUDS`].
pub const fn gives_host_bauds(clock_hz: u32) -> bool {
    let mut rest = HOST_BAUDS.as_slice();
    while let [baud, others @ ..] = rest {
        let given = clock_hz / ((clock_hz + *baud / 2) / *baud);
        if given.abs_diff(*baud) > *baud / 1_000 * MOST_OFF {
            return false;
        }
        rest = others;
    }
    true
}

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
    let sender = Sender::new::<T>(sender, message, DEFAULT_BAUD);
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
