//! What the device says that it is.

use embassy_usb::Config;

/// pid.codes' number for tests. It may not be handed out: a product made of this takes a
/// number of their own, here and in host/udev.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

/// As a program that lists serial ports shows it.
const MANUFACTURER: &str = "Motor gateway";
const NAME: &str = "Motor gateway";

/// Version of the firmware as bcdDevice has it, 0xJJMN: major, minor, patch.
const RELEASE: u16 = digit(env!("CARGO_PKG_VERSION_MAJOR")) << 8
    | digit(env!("CARGO_PKG_VERSION_MINOR")) << 4
    | digit(env!("CARGO_PKG_VERSION_PATCH"));

/// A number below ten.
const fn digit(text: &str) -> u16 {
    let &[digit] = text.as_bytes() else { panic!("a part of the version has more than one digit") };
    assert!(digit.is_ascii_digit());
    (digit - b'0') as u16
}

/// The device with this serial number. Powered by the board, so it takes nothing from the cable.
pub fn device(serial: &'static str) -> Config<'static> {
    let mut config = Config::new(VENDOR, PRODUCT);
    config.device_release = RELEASE;
    config.manufacturer = Some(MANUFACTURER);
    config.product = Some(NAME);
    config.serial_number = Some(serial);
    config.self_powered = true;
    config.max_power = 0;
    config
}
