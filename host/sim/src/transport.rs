//! A client's connection to a simulated gateway, in virtual time.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use host_protocol::DEFAULT_BAUD;
use mgw_client::Transport;

use crate::world::World;

/// A host link of a [`World`] as a client's transport: waiting and sleeping let the world's time
/// pass.
///
/// Several transports may share one world; each of them moves it on.
#[derive(Clone)]
pub struct SimTransport {
    world: Rc<RefCell<World>>,
    link: u8,
    /// Read from the link, not yet asked for.
    unread: Vec<u8>,
}

impl SimTransport {
    /// The host link `link` of `world`.
    pub fn new(world: Rc<RefCell<World>>, link: u8) -> Self {
        world.borrow_mut().set_host_baud(link, DEFAULT_BAUD);
        Self { world, link, unread: Vec::new() }
    }

    /// The world behind it.
    pub fn world(&self) -> &Rc<RefCell<World>> {
        &self.world
    }
}

impl Transport for SimTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.world.borrow_mut().host_send(self.link, bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut world = self.world.borrow_mut();
        let until = world.now() + micros(timeout);
        loop {
            self.unread.extend(world.host_receive(self.link));
            if !self.unread.is_empty() {
                let len = self.unread.len().min(buffer.len());
                for (place, byte) in buffer.iter_mut().zip(self.unread.drain(..len)) {
                    *place = byte;
                }
                return Ok(len);
            }
            if world.now() >= until {
                return Ok(0);
            }
            let next = world.next_event().unwrap_or(until);
            world.run_until(next.min(until));
        }
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.world.borrow().now().as_micros())
    }

    fn sleep(&mut self, duration: Duration) {
        self.world.borrow_mut().run_for(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.unread.clear();
        self.world.borrow_mut().host_reset(self.link);
        self.set_baud(DEFAULT_BAUD)
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.world.borrow_mut().set_host_baud(self.link, baud);
        Ok(())
    }
}

fn micros(duration: Duration) -> gateway::Duration {
    gateway::Duration::from_micros(u64::try_from(duration.as_micros()).unwrap_or(u64::MAX))
}
