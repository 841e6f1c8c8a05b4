//! A client's connection to a simulated gateway, in virtual time.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use host_protocol::DEFAULT_BAUD;
use mgw_client::Transport;

use crate::world::World;

/// A world that several share: on one thread, or on many.
pub trait SharedWorld {
    /// Does something with it, while nobody else does.
    fn with<R>(&self, act: impl FnOnce(&mut World) -> R) -> R;
}

impl SharedWorld for Rc<RefCell<World>> {
    fn with<R>(&self, act: impl FnOnce(&mut World) -> R) -> R {
        act(&mut self.borrow_mut())
    }
}

impl SharedWorld for Arc<Mutex<World>> {
    fn with<R>(&self, act: impl FnOnce(&mut World) -> R) -> R {
        act(&mut self.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A host link of a [`World`] as a client's transport: waiting and sleeping let the world's time
/// pass.
///
/// Several transports may share one world; each of them moves it on.
#[derive(Clone)]
pub struct SimTransport<W = Rc<RefCell<World>>> {
    world: W,
    link: u8,
    /// Read from the link, not yet asked for.
    unread: Vec<u8>,
}

impl<W: SharedWorld> SimTransport<W> {
    /// The host link `link` of `world`.
    pub fn new(world: W, link: u8) -> Self {
        world.with(|world| world.set_host_baud(link, DEFAULT_BAUD));
        Self { world, link, unread: Vec::new() }
    }

    /// The world behind it.
    pub fn world(&self) -> &W {
        &self.world
    }
}

impl<W: SharedWorld> Transport for SimTransport<W> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.world.with(|world| world.host_send(self.link, bytes));
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let Self { world, link, unread } = self;
        world.with(|world| {
            let until = world.now() + micros(timeout);
            loop {
                unread.extend(world.host_receive(*link));
                if !unread.is_empty() {
                    let len = unread.len().min(buffer.len());
                    for (place, byte) in buffer.iter_mut().zip(unread.drain(..len)) {
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
        })
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.world.with(|world| world.now().as_micros()))
    }

    fn sleep(&mut self, duration: Duration) {
        self.world.with(|world| world.run_for(duration));
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.unread.clear();
        self.world.with(|world| world.host_reset(self.link));
        self.set_baud(DEFAULT_BAUD)
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.world.with(|world| world.set_host_baud(self.link, baud));
        Ok(())
    }
}

/// Rounded up: a wait that is not over must let time pass.
fn micros(duration: Duration) -> gateway::Duration {
    let micros = duration.as_nanos().div_ceil(1_000);
    gateway::Duration::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
}
