//! A control transfer: setup, data and status (USB 2.0 §8.5.3).

use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::Transaction;
use super::pipe::{MOST_ERRORS, PACKET, Retry};
use crate::usb::function::{Handshake, Toggle};

/// The bit of bmRequestType that says that the data come from the device.
const FROM_DEVICE: u8 = 0x80;

/// A request with its data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Control {
    /// bmRequestType, bRequest, wValue, wIndex, wLength.
    pub setup: [u8; 8],
    /// What is sent to the device, `wLength` bytes.
    pub data: Vec<u8>,
}

impl Control {
    /// A request for at most `length` bytes.
    #[must_use]
    pub fn read(request_type: u8, request: u8, value: u16, index: u16, length: u16) -> Self {
        Self {
            setup: setup(request_type | FROM_DEVICE, request, value, index, length),
            data: Vec::new(),
        }
    }

    /// A request with data, or without.
    ///
    /// # Panics
    ///
    /// On more than 65535 bytes.
    #[must_use]
    pub fn write(request_type: u8, request: u8, value: u16, index: u16, data: &[u8]) -> Self {
        let length = u16::try_from(data.len()).expect("a length of sixteen bits");
        Self { setup: setup(request_type, request, value, index, length), data: data.to_vec() }
    }

    fn is_read(&self) -> bool {
        self.setup[0] & FROM_DEVICE != 0
    }

    fn length(&self) -> usize {
        usize::from(u16::from_le_bytes([self.setup[6], self.setup[7]]))
    }
}

fn setup(request_type: u8, request: u8, value: u16, index: u16, length: u16) -> [u8; 8] {
    let ([v0, v1], [i0, i1], [l0, l1]) =
        (value.to_le_bytes(), index.to_le_bytes(), length.to_le_bytes());
    [request_type, request, v0, v1, i0, i1, l0, l1]
}

/// How a control transfer has ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Ended {
    /// Well; with what the device has sent.
    Done(Vec<u8>),
    /// The device refuses.
    Stalled,
    /// It did not answer three times in a row.
    NoResponse,
    /// It has left the bus, or the bus was reset.
    Gone,
}

/// Its stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    Setup,
    Data,
    Status,
}

/// One that is under way.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Progress {
    control: Control,
    stage: Stage,
    toggle: Toggle,
    /// Bytes of the data that have been sent or received.
    moved: usize,
    received: Vec<u8>,
    errors: u8,
    repeated: bool,
    /// After a NAK: when it goes on.
    pub retry: Option<VirtualNanos>,
}

impl Progress {
    /// At its beginning.
    pub fn new(control: Control) -> Self {
        let (stage, toggle) = (Stage::Setup, Toggle::Data1);
        Self {
            control,
            stage,
            toggle,
            moved: 0,
            received: Vec::new(),
            errors: 0,
            repeated: false,
            retry: None,
        }
    }

    /// Its next transaction.
    pub fn next(&self) -> Transaction {
        match (self.stage, self.control.is_read()) {
            (Stage::Setup, _) => Transaction::Setup(self.control.setup),
            (Stage::Data, true) | (Stage::Status, false) => Transaction::In { control: true },
            (Stage::Status, true) => {
                Transaction::Out { control: true, toggle: Toggle::Data1, data: Vec::new() }
            }
            (Stage::Data, false) => {
                let rest = &self.control.data[self.moved..];
                let data = rest[..rest.len().min(PACKET.into())].to_vec();
                Transaction::Out { control: true, toggle: self.toggle, data }
            }
        }
    }

    /// The function has answered without bytes; the transaction ended then.
    pub fn answered(&mut self, end: VirtualNanos, answer: Handshake) -> Option<Ended> {
        self.retry = None;
        self.errors = if answer == Handshake::NoResponse { self.errors + 1 } else { 0 };
        match answer {
            Handshake::Ack => return self.acknowledged(),
            Handshake::Nak => self.retry = Retry::later(end),
            Handshake::Stall => return Some(Ended::Stalled),
            Handshake::NoResponse if self.errors == MOST_ERRORS => return Some(Ended::NoResponse),
            Handshake::NoResponse => {}
        }
        None
    }

    fn acknowledged(&mut self) -> Option<Ended> {
        match self.stage {
            Stage::Setup if self.control.length() == 0 => self.stage = Stage::Status,
            Stage::Setup => self.stage = Stage::Data,
            Stage::Data => {
                self.moved = self.control.data.len().min(self.moved + usize::from(PACKET));
                self.toggle = self.toggle.next();
                if self.moved == self.control.data.len() {
                    self.stage = Stage::Status;
                }
            }
            Stage::Status => return Some(Ended::Done(std::mem::take(&mut self.received))),
        }
        None
    }

    /// Bytes have arrived and are acknowledged.
    pub fn arrived(&mut self, toggle: Toggle, data: Vec<u8>) -> Option<Ended> {
        self.errors = 0;
        let expected = if self.stage == Stage::Status { Toggle::Data1 } else { self.toggle };
        self.repeated = toggle != expected;
        if self.repeated {
            return None;
        }
        if self.stage == Stage::Status {
            return Some(Ended::Done(std::mem::take(&mut self.received)));
        }
        self.toggle = toggle.next();
        let is_short = data.len() < usize::from(PACKET);
        self.received.extend(data);
        if is_short || self.received.len() >= self.control.length() {
            self.stage = Stage::Status;
        }
        None
    }

    /// Whether the bytes that arrived last were dropped as repeated.
    pub fn takes_for_repeated(&self) -> bool {
        self.repeated
    }
}
