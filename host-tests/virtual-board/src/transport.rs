//! The client library's transport over a host link of the board, in virtual time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::DEFAULT_BAUD;
use mgw_client::Transport;

use crate::host_uart::HostUart;
use crate::machine::{Line, Machine};

/// How often a waiting client looks for bytes at first: two bytes' time. The longer it has waited,
/// the less often, so that what comes is late by a small part of what it took to come.
const LOOK: Duration = Duration::from_micros(20);
/// That part.
const LATE_BY: u32 = 16;
/// How often it looks at least.
const LAZY_LOOK: Duration = Duration::from_millis(1);

/// What the computer speaks on.
#[derive(Clone, Copy)]
pub(crate) enum Link {
    /// The line on which that computer hangs.
    Uart(Line<HostUart>),
    /// The serial port on USB.
    Usb,
}

/// A host link of a board as a client's transport: waiting and sleeping let the board run.
///
/// Several transports may share one board; each of them moves it on.
#[derive(Clone)]
pub struct BoardTransport {
    machine: Rc<RefCell<Machine>>,
    link: Link,
    /// Taken from the line, not yet asked for.
    unread: VecDeque<u8>,
}

impl BoardTransport {
    /// Over the line on which that computer hangs.
    pub fn new(machine: &Rc<RefCell<Machine>>, line: Line<HostUart>) -> Self {
        Self { machine: Rc::clone(machine), link: Link::Uart(line), unread: VecDeque::new() }
    }

    /// Over USB, where the serial port is open.
    pub fn usb(machine: &Rc<RefCell<Machine>>) -> Self {
        Self { machine: Rc::clone(machine), link: Link::Usb, unread: VecDeque::new() }
    }

    /// The board behind it.
    pub fn machine(&self) -> &Rc<RefCell<Machine>> {
        &self.machine
    }
}

impl Transport for BoardTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut machine = self.machine.borrow_mut();
        match self.link {
            Link::Uart(line) => machine.line(line).send(bytes),
            Link::Usb => machine.usb().send(bytes),
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut machine = self.machine.borrow_mut();
        let start = machine.now();
        loop {
            self.unread.extend(match self.link {
                Link::Uart(line) => machine.line(line).take(),
                Link::Usb => machine.usb().take(),
            });
            if !self.unread.is_empty() {
                let count = self.unread.len().min(buffer.len());
                for (place, byte) in buffer.iter_mut().zip(self.unread.drain(..count)) {
                    *place = byte;
                }
                return Ok(count);
            }
            let waited = machine.now().saturating_sub(start);
            let Some(left) = timeout.checked_sub(waited).filter(|left| !left.is_zero()) else {
                return Ok(0);
            };
            let look = (waited / LATE_BY).clamp(LOOK, LAZY_LOOK);
            machine.run_for(look.min(left));
        }
    }

    fn now(&self) -> Duration {
        self.machine.borrow().now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        match self.link {
            Link::Uart(line) => self.machine.borrow_mut().line(line).set_baud(baud),
            Link::Usb => return Err(io::ErrorKind::Unsupported.into()),
        }
        Ok(())
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.unread.clear();
        let mut machine = self.machine.borrow_mut();
        match self.link {
            Link::Uart(line) => {
                let host = machine.line(line);
                host.clear();
                host.set_baud(DEFAULT_BAUD);
            }
            Link::Usb => machine.usb().clear(),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
