//! The board on which a recording is played: nobody there but what the recording had say something.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;
use std::time::Duration;

use gateway::{Gateway, Instant};
use host_protocol::{BusMode, ProtocolSet};
use mgw_client::Client;

use super::answers::{Answers, CanMotors, LineMotors, PICOS_PER_NANO};
use super::desk::{Desk, Done, Memory};
use super::stimulus::{Cause, Line as On, NOTICED, Pace, Stimulus, nanos};
use super::{Images, ReplayError};
use crate::host_uart::HostUart;
use crate::machine::{Builder, CanNode, Held, Line, Machine, UartPort};
use crate::nodes::instant;
use crate::transport::BoardTransport;
use crate::usb_session;
use crate::usual::REPLY_WINDOW;

/// Every call that tells the core of something.
const HANDLE: &str = "gateway::gateway::Gateway::handle";
/// What a board takes to start.
const START: Duration = Duration::from_millis(200);
/// Any session.
const SESSION: u32 = 0x5E55_1011;
/// What is no frame.
const NOISE: [u8; 2] = [0x55, 0];
/// For the core to be told of something that is under way.
const SOON: Duration = Duration::from_millis(5);
/// What it takes until it is ready for the begin of a recording, µs of its own clock: to start, to have
/// its buses set up, and to be enumerated.
pub const fn ready_us(usb: bool) -> u64 {
    if usb { 1_200_000 } else { 400_000 }
}

/// The host link on USB, and how fast it is.
pub const USB: u8 = 2;
const USB_PACE: Pace = Pace { bit: Duration::from_nanos(83), noticed: NOTICED };

/// The board.
pub struct Stage {
    machine: Machine,
    desk: Desk,
    motors: Vec<CanNode<CanMotors>>,
    rs485: Line<LineMotors>,
    hosts: [Line<HostUart>; 2],
    /// What a bit takes on each bus.
    bits: Vec<Duration>,
    /// Of the host links on UARTs.
    host: Pace,
    /// Where the core lies.
    core: u64,
    /// When the gateway's clock is at 0, ns of the machine's. Before it was switched on: while the
    /// chip starts, the timer is faster than it says.
    zero_ns: i64,
}

impl Stage {
    /// A board that has started and runs its buses as this core has them, shortly before `begin`;
    /// with an open serial port on its USB, where `usb` says so.
    pub fn new(
        images: &Images,
        core: &Gateway,
        begin: Instant,
        usb: bool,
    ) -> Result<Self, ReplayError> {
        let board = images.board;
        let mut builder = Builder::of(board, &images.firmware)?.beside(&images.resume)?;
        let ports = board.can_ports.iter();
        let motors =
            ports.map(|port| builder.can_node(*port, CanMotors::default(), None)).collect();
        let rs485 = builder.line(UartPort::Rs485, LineMotors::default());
        let hosts =
            [UartPort::Host0, UartPort::Host1].map(|port| builder.line(port, HostUart::new()));
        let mut machine = builder.power_on();
        if let Some(ahead) = begin.as_micros().checked_sub(ready_us(usb)) {
            machine.start_ahead(ahead, Builder::of(board, &images.firmware)?.power_on());
        }
        machine.run_for(START);
        if usb {
            usb_session::connect(&mut machine);
        }
        let machine = Rc::new(RefCell::new(machine));
        let mut client = Client::connect_as(BoardTransport::new(&machine, hosts[0]), SESSION, 1)?;
        let mut bits = Vec::new();
        for bus in 0..board.rs485_bus() + 1 {
            let Some(setup) = core.bus_setup(bus) else {
                bits.push(Duration::ZERO);
                continue;
            };
            if setup.mode != BusMode::Normal {
                return Err(ReplayError::OpenBus(bus));
            }
            client.configure_bus(bus, setup.bitrate, ProtocolSet::of(&[]), false, REPLY_WINDOW)?;
            bits.push(Duration::from_secs(1) / setup.bitrate);
        }
        client.release_authority()?;
        drop(client);
        let machine = Rc::try_unwrap(machine).map_err(|_| ()).expect("the client is gone");
        let mut machine = machine.into_inner();
        let (core, zero_ns) = (0, 0);
        let desk = Desk::start(images)?;
        let bit = Duration::from_nanos(machine.line(hosts[0]).settings().bit_ps / PICOS_PER_NANO);
        let host = Pace { bit, noticed: NOTICED };
        let mut stage = Self { machine, desk, motors, rs485, hosts, bits, host, core, zero_ns };
        stage.run_for(SOON);
        let sent_ns = nanos(stage.machine.now());
        stage.send_host(0, &NOISE);
        let held = stage.hold(SOON).ok_or(ReplayError::NoCore)?;
        let found = held.arguments[..2].iter().find(|word| board.statics.contains(word));
        stage.core = u64::from(*found.ok_or(ReplayError::NoCore)?);
        stage.zero_ns = nanos(held.at) - nanos(told(&held));
        let noise = Cause::Host { link: 0, bytes: NOISE.to_vec() };
        let noticed_ns = nanos(held.at) - sent_ns - nanos(noise.lasts(bit));
        stage.host.noticed = Duration::from_nanos(noticed_ns.try_into().unwrap_or_default());
        stage.machine.let_go();
        stage.run_for(SOON);
        Ok(stage)
    }

    fn run_for(&mut self, duration: Duration) {
        self.machine.run_for(duration);
    }

    /// Not back: `ns` of the gateway's time.
    fn run_to(&mut self, ns: i64) {
        let rest = ns + self.zero_ns - nanos(self.machine.now());
        self.run_for(Duration::from_nanos(rest.try_into().unwrap_or_default()));
    }

    fn hold(&mut self, limit: Duration) -> Option<Held> {
        self.machine.hold_at(HANDLE, limit)
    }

    /// A snapshot of the core as it lies there, while none of its calls runs.
    fn take(&mut self, given: &[u8]) -> Result<Done, ReplayError> {
        let Range { start, end } = self.machine.board().statics;
        let bytes = self.machine.read_memory(start.into(), (end - start) as usize);
        self.desk.work(&Memory { at: start.into(), bytes, core: self.core }, given)
    }

    /// How fast a line is.
    pub fn pace(&self, line: On) -> Pace {
        match line {
            On::Bus(bus) => Pace { bit: self.bits[usize::from(bus)], noticed: NOTICED },
            On::Host(USB) => USB_PACE,
            On::Host(_) => self.host,
        }
    }

    /// Runs until that begins, ns of the gateway's time, if it has not, and has it happen.
    pub fn play(&mut self, begin: i64, stimulus: &Stimulus) {
        self.run_to(begin);
        match &stimulus.cause {
            Cause::Frame { bus, frame } => {
                let (at, node) = (instant(self.machine.now()), self.motors[usize::from(*bus)]);
                self.machine.drive_node(node, |motors, _| motors.send(at, frame));
            }
            Cause::Bytes { bytes, damaged, .. } => {
                let rs485 = self.rs485;
                self.machine
                    .drive_line(rs485, |motors, on| motors.line.disturb(bytes, *damaged, on));
            }
            Cause::Host { link: USB, bytes } => self.machine.usb().send(bytes),
            Cause::Host { link, bytes } => self.send_host(usize::from(*link), bytes),
            Cause::Cable { bus, cable } => {
                let port = self.motors[usize::from(*bus)].port();
                self.machine.wire_can(port, *cable);
            }
            Cause::EStop { open } => self.machine.open_e_stop(*open),
        }
    }

    fn send_host(&mut self, link: usize, bytes: &[u8]) {
        self.machine.line(self.hosts[link]).send(bytes);
    }

    /// Has this core take the place of the one that runs, when the first of these is told of.
    pub fn exchange(
        &mut self,
        core: &[u8],
        (begin, first): &(i64, Stimulus),
    ) -> Result<Done, ReplayError> {
        self.play(*begin, first);
        self.hold(SOON).ok_or(ReplayError::NotTold)?;
        let done = self.take(core)?;
        self.machine.write_memory(self.core, &done.laid_out);
        self.machine.let_go();
        Ok(done)
    }

    /// The motors answer as they have answered, bus by bus.
    pub fn answer(&mut self, answers: &[Answers]) {
        let zero_ns = self.zero_ns;
        for ((node, answers), bit) in self.motors.iter().zip(answers).zip(&self.bits) {
            let bit_ps = u64::try_from(bit.as_nanos() * 1_000).unwrap_or_default();
            self.machine.node(*node).answer(answers.clone(), zero_ns, bit_ps);
        }
        let line = self.machine.line(self.rs485);
        if let Some(answers) = answers.last() {
            line.answer(answers.clone(), zero_ns);
        }
    }

    /// Runs to the end of the recording, and until the core is told of something, or for a while,
    /// and takes it.
    pub fn end(&mut self, end: Instant) -> Result<Vec<u8>, ReplayError> {
        self.run_to(nanos(Duration::from_micros(end.as_micros())));
        self.hold(SOON);
        Ok(self.take(&[])?.taken)
    }
}

/// The time that a call of [`HANDLE`] was given: a number of µs behind the core and what is
/// returned.
fn told(held: &Held) -> Duration {
    let [.., low, high] = held.arguments;
    Duration::from_micros(u64::from(low) | u64::from(high) << 32)
}
