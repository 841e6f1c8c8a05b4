//! Names of the board's ports, and typed handles to what hangs there.

use std::marker::PhantomData;

/// The CAN buses of the board, as the gateway numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CanPort {
    /// FDCAN1.
    Bus0,
    /// FDCAN2.
    Bus1,
    /// FDCAN3, which only the NUCLEO-G474RE has.
    Bus2,
}

impl CanPort {
    /// Its place among the part's FDCANs.
    pub const fn index(self) -> usize {
        match self {
            Self::Bus0 => 0,
            Self::Bus1 => 1,
            Self::Bus2 => 2,
        }
    }
}

/// The serial ports of the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UartPort {
    /// Host link 0, on a real board the ST-LINK's virtual COM port.
    Host0,
    /// Host link 1.
    Host1,
    /// The last bus, to an RS485 transceiver.
    Rs485,
}

/// A node on a CAN bus, of type `P`.
pub struct CanNode<P> {
    port: CanPort,
    index: usize,
    peer: PhantomData<fn() -> P>,
}

impl<P> CanNode<P> {
    pub(super) const fn new(port: CanPort, index: usize) -> Self {
        Self { port, index, peer: PhantomData }
    }

    /// Its bus.
    pub const fn port(self) -> CanPort {
        self.port
    }

    /// Its place among the nodes there.
    pub const fn index(self) -> usize {
        self.index
    }
}

impl<P> Clone for CanNode<P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for CanNode<P> {}

/// The far end of a serial line, of type `P`.
pub struct Line<P> {
    port: UartPort,
    peer: PhantomData<fn() -> P>,
}

impl<P> Line<P> {
    pub(super) const fn new(port: UartPort) -> Self {
        Self { port, peer: PhantomData }
    }

    /// Its port.
    pub const fn port(self) -> UartPort {
        self.port
    }
}

impl<P> Clone for Line<P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P> Copy for Line<P> {}
