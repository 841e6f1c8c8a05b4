//! The device end of a USB cable: what a host can do to it, one transaction at a time.

use serde::{Deserialize, Serialize};

/// DATA0 or DATA1: which packet of an endpoint this is, so that one sent twice is known (USB 2.0
/// §8.6).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Toggle {
    /// DATA0.
    #[default]
    Data0,
    /// DATA1.
    Data1,
}

impl Toggle {
    /// That of the packet after it.
    #[must_use]
    pub const fn next(self) -> Self {
        match self {
            Self::Data0 => Self::Data1,
            Self::Data1 => Self::Data0,
        }
    }
}

/// How a function answers bytes (USB 2.0 §8.4.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Handshake {
    /// Taken, or known from before.
    Ack,
    /// Not now.
    Nak,
    /// The endpoint is halted, or the request is refused.
    Stall,
    /// Nothing: it is not there, has another address, has no such endpoint, or is not ready for a
    /// SETUP.
    NoResponse,
}

/// How a function answers when it is asked for bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Input {
    /// These. They stay its next packet until the host has acknowledged them.
    Data(Toggle, Vec<u8>),
    /// It has none.
    Nak,
    /// The endpoint is halted, or the request is refused.
    Stall,
    /// Nothing, as above.
    NoResponse,
}

/// The device end of a USB cable at full speed, as the host's end drives it. The model of a
/// controller offers it for the time of a call: what that does to its registers and interrupts
/// happens at the instant of the call.
///
/// `address` is whom the host speaks to; a function with another address does not respond.
/// `endpoint` is a number without the bit of its direction.
pub trait UsbFunction {
    /// Whether it shows itself to the host by its pull-up on D+. Without a cable, too.
    fn is_pulled_up(&self) -> bool;

    /// The cable, and its voltage. Without it the bus is idle, so that [`UsbFunction::suspend`]
    /// follows after 3 ms; nothing else does.
    fn set_attached(&mut self, attached: bool);

    /// The host has begun a reset (SE0): the address is 0 again.
    fn bus_reset(&mut self);

    /// The host has ended the reset.
    fn bus_reset_ended(&mut self) {}

    /// The bus has been idle for 3 ms.
    fn suspend(&mut self);

    /// The host resumes a suspended bus: it drives K, and frames follow 20 ms later.
    fn resume(&mut self);

    /// A frame begins, one a millisecond; its number has eleven bits.
    fn start_of_frame(&mut self, number: u16);

    /// A SETUP transaction: [`Handshake::Ack`], or no response.
    fn setup(&mut self, address: u8, endpoint: u8, data: [u8; 8]) -> Handshake;

    /// An OUT transaction.
    fn out(&mut self, address: u8, endpoint: u8, toggle: Toggle, data: &[u8]) -> Handshake;

    /// An IN token.
    fn input(&mut self, address: u8, endpoint: u8) -> Input;

    /// The host has acknowledged the bytes of the last [`UsbFunction::input`].
    fn input_acknowledged(&mut self, address: u8, endpoint: u8);
}
