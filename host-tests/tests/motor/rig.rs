//! A board without a configuration, its motors, and a host whose cable or whose motor's supply is
//! cut after so many frames.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use host_protocol::{BootReason, DEFAULT_BAUD, Protocol};
use mgw_cli::{Outcome, run_on};
use mgw_client::{Interrupt, Transport};
use mgw_sim::{BOARD, Injection, SimTransport, Station, Wiring, World};

/// The motor whose settings are changed.
pub const MOTOR: usize = 0;
/// After this the gateway has forgotten a host that is gone, and an RMD has restarted.
const LATER: Duration = Duration::from_secs(3);

/// What stands before the configuration that a command could not take back.
const FILE_FOLLOWS: &str = "that does it:\n";

/// What is cut, and after how many frames: of the host, or of the gateway on its buses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    Never,
    /// The cable to the host, after so many messages of it.
    Cable(usize),
    /// The supply of the motor, after so many frames of the gateway.
    Power(usize),
    /// This frame of the gateway is missed by the motor, and no other.
    Frame(usize),
    /// The supply of the gateway, after so many frames of it, for a moment.
    Gateway(usize),
}

pub struct Rig {
    pub world: Rc<RefCell<World>>,
    /// What the gateway sent on its buses.
    pub sent: Rc<RefCell<Vec<String>>>,
}

/// What counts frames, and cuts.
struct Cutter {
    world: Rc<RefCell<World>>,
    sent: Rc<RefCell<Vec<String>>>,
    cut: Cut,
    messages: Rc<RefCell<usize>>,
    unread: Vec<u8>,
}

impl Rig {
    /// With these motors, each with the dialect of an RMD by its number.
    pub fn with(motors: &[(u8, Protocol, u8, u8)]) -> Self {
        let wired = motors.iter().fold(Wiring::on(&BOARD), |wiring, (bus, protocol, node, _)| {
            wiring.with(*bus, *protocol, *node)
        });
        let mut world = World::new(wired);
        for (index, (_, protocol, _, dialect)) in motors.iter().enumerate() {
            world.inject(index, Injection::RmdDialect(*dialect));
            world.inject(index, Injection::Encoder(*protocol == Protocol::Thruster));
        }
        Self { world: Rc::new(RefCell::new(world)), sent: Rc::default() }
    }

    /// Runs a command on a host link, until it ends; how many messages it sent.
    pub fn run_until(&self, cut: Cut, words: &[&str]) -> (Outcome, usize) {
        self.sent.borrow_mut().clear();
        self.world.borrow_mut().trace();
        self.world.borrow_mut().set_host_baud(0, DEFAULT_BAUD);
        let messages = Rc::default();
        let transport = Cutter {
            world: self.world.clone(),
            sent: self.sent.clone(),
            cut,
            messages: Rc::clone(&messages),
            unread: Vec::new(),
        };
        let outcome = run_on(Box::new(transport), Interrupt::default(), words);
        let messages = *messages.borrow();
        (outcome, messages)
    }

    pub fn run(&self, words: &[&str]) -> Outcome {
        self.run_until(Cut::Never, words).0
    }

    /// Cable and supply are there again, after a while, and what the command has said that is to be
    /// done is done.
    pub fn mend(&self, outcome: &Outcome) {
        {
            let mut world = self.world.borrow_mut();
            world.host_reset(0);
            world.power_cycle(MOTOR);
            world.inject(MOTOR, Injection::Unplugged(false));
            world.run_for(LATER);
        }
        let told = outcome.failure.as_ref().and_then(|(_, text)| text.split_once(FILE_FOLLOWS));
        if let Some((_, text)) = told {
            static FILES: AtomicUsize = AtomicUsize::new(0);
            let number = FILES.fetch_add(1, Ordering::Relaxed);
            let name = format!("mgw-taken-back-{}-{number}.toml", std::process::id());
            let file = std::env::temp_dir().join(name);
            std::fs::write(&file, text).unwrap();
            let apply = ["config", "apply", file.to_str().unwrap()];
            let mut applied = self.run(&apply);
            if applied.failure.as_ref().is_some_and(|(name, _)| name == "RestartOwed") {
                // As the refusal says; the axis that was lent is the only one.
                assert_eq!(self.run(&["motor", "0", "reset", "--yes"]).exit_code, 0);
                applied = self.run(&apply);
            }
            assert_eq!(applied.exit_code, 0, "{applied:?}: {text}");
            std::fs::remove_file(file).unwrap();
            self.world.borrow_mut().run_for(LATER);
        }
    }

    /// Whether a motor is found there, by a command of a host of its own.
    pub fn finds(&self, target: &str) -> bool {
        let transport = Box::new(SimTransport::new(self.world.clone(), 1));
        let words = ["motor", target, "id"];
        let found = run_on(transport, Interrupt::default(), &words).exit_code == 0;
        self.world.borrow_mut().run_for(LATER);
        found
    }

    /// Asserts that no shaft has turned.
    pub fn assert_still(&self) {
        for motor in self.world.borrow().motors() {
            assert!(motor.position_rad().abs() < 1e-9, "it has turned");
        }
    }
}

impl Cutter {
    fn is_cut(&self) -> bool {
        matches!(self.cut, Cut::Cable(after) if *self.messages.borrow() > after)
    }

    fn note_frames(&mut self) {
        let mut world = self.world.borrow_mut();
        let frames = world.trace();
        let frames = frames.iter().filter(|entry| entry.from == Station::Gateway);
        let mut sent = self.sent.borrow_mut();
        for frame in frames {
            sent.push(frame.wire.to_string());
            if self.cut == Cut::Power(sent.len()) {
                world.power_cycle(MOTOR);
                world.inject(MOTOR, Injection::Unplugged(true));
            }
            if let Cut::Frame(missed) = self.cut {
                let is_next = sent.len() + 1 == missed;
                if is_next || sent.len() == missed {
                    world.inject(MOTOR, Injection::Unplugged(is_next));
                }
            }
            if self.cut == Cut::Gateway(sent.len()) {
                world.reset(BootReason::PowerOn, "");
            }
        }
    }
}

impl Transport for Cutter {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        *self.messages.borrow_mut() += 1;
        if !self.is_cut() {
            self.world.borrow_mut().host_send(0, bytes);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let span = gateway::Duration::from_micros(u64::try_from(timeout.as_micros()).unwrap());
        let until = self.world.borrow().now() + span;
        loop {
            let arrived = self.world.borrow_mut().host_receive(0);
            if !self.is_cut() {
                self.unread.extend(arrived);
            }
            if !self.unread.is_empty() {
                let len = self.unread.len().min(buffer.len());
                for (place, byte) in buffer.iter_mut().zip(self.unread.drain(..len)) {
                    *place = byte;
                }
                return Ok(len);
            }
            if self.world.borrow().now() >= until {
                return Ok(0);
            }
            let next = self.world.borrow_mut().next_event().unwrap_or(until);
            self.world.borrow_mut().run_until(next.min(until));
            self.note_frames();
        }
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.world.borrow().now().as_micros())
    }

    fn sleep(&mut self, duration: Duration) {
        let _ = self.receive_nothing(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.unread.clear();
        Ok(())
    }

    fn set_baud(&mut self, _: u32) -> io::Result<()> {
        Ok(())
    }
}

impl Cutter {
    /// Time passes frame by frame, and what arrives stays unread.
    fn receive_nothing(&mut self, duration: Duration) -> Option<()> {
        let span = gateway::Duration::from_micros(u64::try_from(duration.as_micros()).ok()?);
        let until = self.world.borrow().now() + span;
        while self.world.borrow().now() < until {
            let next = self.world.borrow_mut().next_event().unwrap_or(until);
            self.world.borrow_mut().run_until(next.min(until));
            self.note_frames();
        }
        Some(())
    }
}
