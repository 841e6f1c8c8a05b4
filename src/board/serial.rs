//! How every board sets its UARTs up.

use embassy_stm32::gpio::Pull;
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{self, Uart};

use crate::line::{self, Receiver, Sender};

/// Bitrate of the host links.
pub const HOST_BITS_PER_SECOND: u32 = 921_600;
/// Bytes of each host link's DMA ring: 2.8 ms at 921600 baud.
pub const HOST_RING: usize = 256;
/// Bytes of an RS485 bus's DMA ring: 1.28 ms at 2 Mbaud.
pub const RS485_RING: usize = 256;
/// Lead and tail of the RS485 driver-enable in sixteenths of a bit: one bit each. The driver uses one value for both.
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

/// The two halves of a host link.
pub fn host_line<T: line::Instance>(
    uart: Uart<'static, Async>,
    ring: &'static mut [u8; HOST_RING],
) -> (Receiver, Sender) {
    let (sender, receiver) = uart.split();
    (Receiver::with_delimiters::<T>(receiver, ring), Sender::new::<T>(sender, HOST_BITS_PER_SECOND))
}

/// The two halves of an RS485 bus that was set up with this bitrate.
pub fn rs485_line<T: line::Instance>(
    uart: Uart<'static, Async>,
    ring: &'static mut [u8; RS485_RING],
    bits_per_second: u32,
) -> (Receiver, Sender) {
    let (sender, receiver) = uart.split();
    (Receiver::new::<T>(receiver, ring), Sender::new::<T>(sender, bits_per_second))
}
