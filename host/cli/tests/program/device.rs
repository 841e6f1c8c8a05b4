//! A serial device of this system, a pseudo terminal, with a simulated gateway at its other end.

use std::cell::RefCell;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use mgw_cli::run_on;
use mgw_client::Interrupt;
use mgw_sim::{SimTransport, Wiring, World};
use serialport::{SerialPort, TTYPort};

use crate::support::FOUR;

/// The link of the device, and that by which the gateway is configured and asked.
pub const LINK: u8 = 0;
pub const OTHER_LINK: u8 = 1;
/// How long threads wait for bytes.
pub const LOOK_EVERY: Duration = Duration::from_millis(1);

/// A gateway behind a device, which is asked for something now and then, and ends with its test.
pub struct Device<A, T> {
    pub name: String,
    asks: Option<Sender<A>>,
    server: Option<JoinHandle<T>>,
}

impl<A: Send + 'static, T: Send + 'static> Device<A, T> {
    /// `serve` serves until nobody can ask any more.
    pub fn open(serve: fn(TTYPort, &Receiver<A>) -> T) -> Self {
        let (mut gateway_end, program_end) = TTYPort::pair().expect("a pseudo terminal");
        gateway_end.set_timeout(LOOK_EVERY).expect("a timeout");
        let name = program_end.name().expect("it has a name");
        // Kept open, or the device hangs up between two runs of the program; without the lock that
        // keeps the program out.
        let kept = File::options().read(true).write(true).open(&name).expect("it is there");
        drop(program_end);
        let (asks, asked) = channel();
        let server = std::thread::spawn(move || {
            let served = serve(gateway_end, &asked);
            drop(kept);
            served
        });
        Self { name, asks: Some(asks), server: Some(server) }
    }

    pub fn ask(&self, ask: A) {
        self.asks.as_ref().expect("it runs").send(ask).expect("it runs");
    }

    /// Ends it, and says what it saw.
    pub fn close(mut self) -> T {
        drop(self.asks.take());
        self.server.take().expect("it runs").join().expect("the simulation goes on")
    }
}

impl<A, T> Drop for Device<A, T> {
    fn drop(&mut self) {
        drop(self.asks.take());
        let _ = self.server.take().map(JoinHandle::join);
    }
}

/// A gateway with four motors, configured by the file of the examples and these commands.
pub fn simulated(commands: &[&[&str]]) -> Rc<RefCell<World>> {
    let world = Rc::new(RefCell::new(World::new(Wiring::four_motors())));
    for arguments in [&["config", "apply", FOUR][..]].iter().chain(commands) {
        let transport = SimTransport::new(world.clone(), OTHER_LINK);
        let outcome = run_on(Box::new(transport), Interrupt::default(), arguments);
        assert_eq!(outcome.exit_code, 0, "{arguments:?}: {outcome:?}");
    }
    world
}

/// What the program has written by now.
pub fn read(device: &mut TTYPort) -> Vec<u8> {
    let mut buffer = [0; 512];
    match device.read(&mut buffer) {
        Ok(count) => buffer[..count].to_vec(),
        Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
            Vec::new()
        }
        Err(error) => panic!("{error}"),
    }
}
