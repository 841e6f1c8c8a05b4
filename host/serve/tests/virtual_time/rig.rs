//! Programs with the client library, the multiplexer, and the simulated gateway behind a cable of
//! 921600 bit/s, in virtual time.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::rc::Rc;
use std::time::Duration;

use mgw_client::host_protocol::{
    AxisParameter, AxisState, BootReason, Call, Deframer, Error, Frame, Kind, MAX_FRAME, Protocol,
    ProtocolSet, Setpoint, TripReason, Value, encode,
};
use mgw_client::{Client, ClientError, Transport};
use mgw_serve::{Multiplexer, News, ProgramId};
use mgw_sim::{Wiring, World};

/// How often the server looks.
const TURN: Duration = Duration::from_micros(200);
/// How long a byte takes at 921600 bit/s.
const BYTE: Duration = Duration::from_nanos(10_851);
/// The host link of the server.
const LINK: u8 = 0;
/// A setpoint that outlives the silence of its host.
pub const LONG: Duration = Duration::from_millis(1_900);
pub const TURNING: Setpoint = Setpoint::Velocity { velocity_rad_s: 2.0 };

pub struct Rig {
    pub world: World,
    pub multiplexer: Multiplexer,
    /// What each program has been sent; nothing for one that does not read.
    inboxes: BTreeMap<ProgramId, VecDeque<u8>>,
    deaf: Vec<ProgramId>,
    pub plugged: bool,
    pub news: Vec<News>,
    /// Of a thousand frames on the cable so many get lost to the gateway, and from it.
    pub lost_per_mille: [u32; 2],
    luck: fastrand::Rng,
    /// The requests on the cable: when, of which kind and number.
    pub cable: Vec<(Duration, Kind, u16)>,
    /// When each of them has passed, where nothing else holds them up: with its number.
    pub passed: Vec<(Duration, u16)>,
}

/// A rig that several programs share.
#[derive(Clone)]
pub struct Bench(pub Rc<RefCell<Rig>>);

/// A program's way to the server.
pub struct Wire {
    bench: Bench,
    pub id: ProgramId,
}

pub type Program = Client<Wire>;

impl Rig {
    fn now(&self) -> Duration {
        Duration::from_micros(self.world.now().as_micros())
    }

    fn is_lost(&mut self, way: usize) -> bool {
        self.luck.u32(..1_000) < self.lost_per_mille[way]
    }

    /// Passes on what there is, without time passing.
    fn pump(&mut self) {
        let now = self.now();
        let mut received = self.world.host_receive(LINK);
        if !received.is_empty() && self.is_lost(1) {
            received.clear();
        }
        if self.plugged {
            self.multiplexer.cable_bytes(now, &received);
        }
        self.multiplexer.tick(now);
        while self.plugged
            && let Some(frame) = self.multiplexer.poll_cable(now)
        {
            if let Some(Ok(Frame { kind, number, .. })) = Deframer::new().take(&mut &frame[..]) {
                self.cable.push((now, kind, number));
                let begins = self.passed.last().map_or(now, |(before, _)| now.max(*before));
                let bytes = u32::try_from(frame.len()).unwrap();
                self.passed.push((begins + bytes * BYTE, number));
            }
            if !self.is_lost(0) {
                self.world.host_send(LINK, &frame);
            }
        }
        for (id, inbox) in self.inboxes.iter_mut().filter(|(id, _)| !self.deaf.contains(id)) {
            while let Some(frame) = self.multiplexer.poll_program(*id) {
                inbox.extend(frame);
            }
        }
        self.news.extend(self.multiplexer.take_news());
    }
}

impl Bench {
    /// A server with a gateway of four motors, of which axis 0 is configured.
    pub fn new() -> Self {
        let mut rig = Rig {
            world: World::new(Wiring::four_motors()),
            multiplexer: Multiplexer::new(100),
            inboxes: BTreeMap::new(),
            deaf: Vec::new(),
            plugged: true,
            news: Vec::new(),
            lost_per_mille: [0; 2],
            luck: fastrand::Rng::with_seed(1),
            cable: Vec::new(),
            passed: Vec::new(),
        };
        rig.multiplexer.cable_opened(Duration::ZERO);
        let bench = Self(Rc::new(RefCell::new(rig)));
        let mut program = bench.program();
        configure(&mut program);
        program.release_authority().unwrap();
        bench.close(&program);
        bench
    }

    /// One more program.
    pub fn program(&self) -> Program {
        self.try_program().unwrap()
    }

    pub fn try_program(&self) -> Result<Program, ClientError> {
        Client::connect_as(self.wire(), 7, 1)
    }

    /// A connection on which nothing has been said.
    pub fn wire(&self) -> Wire {
        let mut rig = self.0.borrow_mut();
        let now = rig.now();
        let id = rig.multiplexer.program_opened(now, true);
        rig.inboxes.insert(id, VecDeque::new());
        drop(rig);
        Wire { bench: self.clone(), id }
    }

    /// A program ends: nothing more comes from it.
    pub fn close(&self, program: &Program) {
        let id = program.transport().id;
        let mut rig = self.0.borrow_mut();
        rig.multiplexer.program_closed(id);
        rig.inboxes.remove(&id);
    }

    pub fn set_reads(&self, id: ProgramId, reads: bool) {
        let mut rig = self.0.borrow_mut();
        rig.deaf.retain(|deaf| *deaf != id || !reads);
        if !reads {
            rig.deaf.push(id);
        }
    }

    pub fn run(&self, span: Duration) {
        let end = self.now() + span;
        while self.now() < end {
            self.turn();
        }
    }

    fn turn(&self) {
        let mut rig = self.0.borrow_mut();
        rig.world.run_for(TURN);
        rig.pump();
    }

    pub fn now(&self) -> Duration {
        self.0.borrow().now()
    }

    pub fn unplug(&self) {
        let mut rig = self.0.borrow_mut();
        let now = rig.now();
        rig.plugged = false;
        rig.world.host_reset(LINK);
        rig.multiplexer.cable_closed(now);
    }

    pub fn plug(&self) {
        let mut rig = self.0.borrow_mut();
        let now = rig.now();
        rig.plugged = true;
        rig.world.host_receive(LINK);
        rig.multiplexer.cable_opened(now);
    }

    pub fn reset(&self) {
        self.0.borrow_mut().world.reset(BootReason::Watchdog, "");
    }

    /// The speed of the motor of axis 0, rad/s.
    pub fn speed(&self) -> f64 {
        self.run(Duration::from_millis(100));
        self.0.borrow().world.motor(0).speed_rad_s()
    }

    /// Whether the connection of a program is to end.
    pub fn is_over(&self, id: ProgramId) -> bool {
        self.0.borrow().multiplexer.is_over(id)
    }

    /// The last trip of axis 0.
    pub fn trip(&self) -> Option<TripReason> {
        let mut watcher = self.program();
        let report = watcher.read_state(0).unwrap();
        self.close(&watcher);
        matches!(report.state, AxisState::Tripped { .. })
            .then(|| report.trip.map(|trip| trip.reason))?
    }
}

impl Transport for Wire {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut rig = self.bench.0.borrow_mut();
        let now = rig.now();
        rig.multiplexer.program_bytes(now, self.id, bytes);
        rig.pump();
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let end = self.bench.now() + timeout;
        loop {
            let mut rig = self.bench.0.borrow_mut();
            let over = rig.multiplexer.is_over(self.id);
            let Some(inbox) = rig.inboxes.get_mut(&self.id) else {
                return Err(io::ErrorKind::UnexpectedEof.into());
            };
            if !inbox.is_empty() {
                let count = inbox.len().min(buffer.len());
                for (place, byte) in buffer.iter_mut().zip(inbox.drain(..count)) {
                    *place = byte;
                }
                return Ok(count);
            }
            drop(rig);
            if over {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if self.bench.now() >= end {
                return Ok(0);
            }
            self.bench.turn();
        }
    }

    fn now(&self) -> Duration {
        self.bench.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.bench.run(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.id = self.bench.wire().id;
        Ok(())
    }
}

pub fn configure(program: &mut Program) {
    let protocols = ProtocolSet::of(&[Protocol::Rmd, Protocol::Thruster]);
    let window = Duration::from_millis(5);
    program.configure_bus(0, 1_000_000, protocols, false, window).unwrap();
    let values = [
        (AxisParameter::Bus, Value::Unsigned(0)),
        (AxisParameter::Protocol, Value::Unsigned(1)),
        (AxisParameter::Node, Value::Unsigned(1)),
        (AxisParameter::StopAction, Value::Unsigned(2)),
        (AxisParameter::TtlUs, Value::Unsigned(2_000_000)),
        (AxisParameter::AllowUnknownMotorTimeout, Value::Bool(true)),
    ];
    for (parameter, value) in values {
        program.configure_axis(0, parameter, value).unwrap();
    }
}

/// Arms axis 0 and turns it, with a setpoint that outlives the silence of the link.
pub fn turn(program: &mut Program) -> u32 {
    let epoch = program.arm(0).unwrap().epoch;
    program.set(0, epoch, TURNING, LONG).unwrap();
    epoch
}

/// The frame of a request.
pub fn frame<C: Call>(sequence: u16, request: &C) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = encode(Kind::Request, sequence, C::NUMBER, request, &mut out).unwrap();
    out[..length].to_vec()
}

/// The error that a call was answered with.
pub fn refusal<T>(result: Result<T, ClientError>) -> Error {
    match result {
        Err(ClientError::Gateway(error)) => error,
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("it was done"),
    }
}
