//! The board as a USB device: a serial port (CDC-ACM) that is a host link, and an interface by
//! which an update tool sends the board into its ROM bootloader (DFU).

pub mod bootloader;
mod description;
mod detach;
mod guard;
mod link;

use embassy_usb::UsbDevice;
use embassy_usb::class::cdc_acm::{CdcAcmClass, State};
use static_cell::{ConstStaticCell, StaticCell};

use crate::board::UsbDriver;
use crate::shared_gateway::SharedGateway;
use detach::Detach;
use guard::Guarded;
pub use link::{PACKET, Receiver, Sender};

/// The chip's driver, guarded.
type Driver = Guarded<UsbDriver>;

/// Room for the configuration: 53 bytes of serial port, 26 of DFU, 9 of its own.
const CONFIGURATION: usize = 128;
/// Room for the device capabilities: 5 bytes, and 7 for USB 2.1.
const CAPABILITIES: usize = 32;
/// Room for a control transfer; the longest is a string of 24 characters in UTF-16.
const CONTROL: usize = 64;

/// The device, and the two ends of its serial port. Once; `serial` is the board's serial number.
pub fn device(
    driver: UsbDriver,
    serial: &'static str,
    gateway: &'static SharedGateway,
) -> (UsbDevice<'static, Driver>, Receiver, Sender) {
    static CONFIGURATION_BUFFER: ConstStaticCell<[u8; CONFIGURATION]> =
        ConstStaticCell::new([0; CONFIGURATION]);
    static CAPABILITIES_BUFFER: ConstStaticCell<[u8; CAPABILITIES]> =
        ConstStaticCell::new([0; CAPABILITIES]);
    static CONTROL_BUFFER: ConstStaticCell<[u8; CONTROL]> = ConstStaticCell::new([0; CONTROL]);
    static PORT: StaticCell<State<'static>> = StaticCell::new();
    static DETACH: StaticCell<Detach> = StaticCell::new();

    let mut builder = embassy_usb::Builder::new(
        Guarded::new(driver),
        description::device(serial),
        CONFIGURATION_BUFFER.take(),
        CAPABILITIES_BUFFER.take(),
        &mut [],
        CONTROL_BUFFER.take(),
    );
    let port = CdcAcmClass::new(&mut builder, PORT.init(State::new()), PACKET);
    Detach::add_to(&mut builder, &DETACH, gateway);
    let (sender, receiver) = port.split();
    (builder.build(), Receiver::new(receiver), Sender::new(sender))
}
