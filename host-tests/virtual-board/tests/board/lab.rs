//! A board with the simulator's four motors, a probe on each CAN bus, and a computer at each host
//! link.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::LazyLock;
use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisParameter, AxisState, Error, Event, Setpoint, Trip, TripReason};
use mgw_client::{Client, ClientError, Hold, Transport};
use mgw_sim::{Motor, MotorEvent};
use virtual_board::board::Board;
use virtual_board::machine::{Builder, CanNode, CanPort, Machine, Snapshot};
use virtual_board::nodes::Probe;
use virtual_board::outside::Outside;
use virtual_board::transport::BoardTransport;
use virtual_board::usual::{self, REPLY_WINDOW};

use crate::gaps;
use crate::reaction::Reaction;
use crate::wire::{self, OnWire};

/// The axes, in the order of the motors.
pub const RMD: u8 = 0;
pub const THRUSTER: u8 = 1;
pub const D5: u8 = 2;
pub const RMD_RS485: u8 = 3;
pub const AXES: [u8; 4] = [RMD, THRUSTER, D5, RMD_RS485];
/// The names of the motors.
pub const NAMES: [&str; 4] = ["RMD on CAN", "thruster", "D5", "RMD on RS485"];

/// The buses, as the gateway numbers them.
pub const BUS_RMD_AND_THRUSTER: u8 = 0;
pub const BUS_D5: u8 = 1;
/// The last one.
pub fn bus_rs485() -> u8 {
    Board::chosen().rs485_bus()
}

/// What stops each motor: 0x81 (RMD V3.6 §2.16), TC 0 (thruster manual §1.3), speed 0 (D5 manual,
/// quick start 5).
pub const STOPS: [&str; 4] = [
    "141#8100000000000000",
    "30B#5443000000000000",
    "00B#D50B050320000033",
    "3E0108810000000000000032A5",
];

/// Validity of a setpoint, the default of an axis.
pub const TTL: Duration = Duration::from_millis(100);
/// The own timeout of the motors that can be told one.
pub const MOTOR_TIMEOUT: Duration = Duration::from_secs(1);
/// Speeds at which the motors turn, rad/s: the thruster at a tenth of its 3000 min⁻¹.
pub const SPEEDS_RAD_S: [f64; 4] = [2.0, 31.416, 2.0, 2.0];
/// How often a lab renews its setpoints: before the gateway refreshes one, after 20 ms. Where both
/// come within a few µs, a recording has them in one order, and the image may have them in the
/// other.
const RENEWAL: Duration = Duration::from_millis(18);
/// The seed of everything random outside the board.
pub const SEED: u64 = 1;

/// A board with its buses and axes configured. Every lab starts there; switched on once in a
/// process.
static CONFIGURED: LazyLock<Snapshot> = LazyLock::new(|| {
    let mut lab = Lab::power_on(SEED);
    lab.configure();
    lab.into_snapshot()
});

/// The board, what hangs on it, and a client on host link 0.
pub struct Lab {
    pub machine: Rc<RefCell<Machine>>,
    pub outside: Outside,
    pub probes: [CanNode<Probe>; 2],
    pub client: Client<BoardTransport>,
}

/// A board with everything on its ports, before it is switched on.
pub fn wired(seed: u64) -> (Builder, Outside, [CanNode<Probe>; 2]) {
    wire(Machine::builder(), seed)
}

/// The same with a board that is to be another one than usual.
pub fn wire(mut board: Builder, seed: u64) -> (Builder, Outside, [CanNode<Probe>; 2]) {
    let outside = Outside::four_motors(&mut board, seed);
    let probes =
        [CanPort::Bus0, CanPort::Bus1].map(|port| board.can_node(port, Probe::new(), None));
    (board, outside, probes)
}

impl Lab {
    /// Switches a board on and says hello.
    pub fn power_on(seed: u64) -> Self {
        let (board, outside, probes) = wired(seed);
        Self::around(board.power_on(), outside, probes)
    }

    /// A board whose buses and axes are configured.
    pub fn configured() -> Self {
        Self::resume(&CONFIGURED)
    }

    /// The board as it stands, nobody in command.
    pub fn into_snapshot(mut self) -> Snapshot {
        self.client.release_authority().expect("released");
        let mut machine = self.machine.borrow_mut();
        machine.snapshot()
    }

    /// A board as it stood.
    pub fn resume(snapshot: &Snapshot) -> Self {
        let (board, outside, probes) = wired(SEED);
        Self::around(board.resume(snapshot), outside, probes)
    }

    /// Says hello to a board on host link 0.
    pub fn around(machine: Machine, outside: Outside, probes: [CanNode<Probe>; 2]) -> Self {
        let machine = Rc::new(RefCell::new(machine));
        let client = connect(&machine, &outside, 0);
        Self { machine, outside, probes, client }
    }

    /// A client on the other host link.
    pub fn second_client(&self) -> Client<BoardTransport> {
        connect(&self.machine, &self.outside, 1)
    }

    /// Configures the buses and the axes, and the own timeouts of the motors that can be told.
    pub fn configure(&mut self) {
        [BUS_RMD_AND_THRUSTER, BUS_D5, bus_rs485()]
            .into_iter()
            .for_each(|bus| self.configure_bus(bus));
        AXES.into_iter().for_each(|axis| self.configure_axis(axis));
    }

    /// Starts a bus at the usual rate of its motors.
    pub fn configure_bus(&mut self, bus: u8) {
        let (_, bitrate, protocols) = usual::buses()[usize::from(bus.min(2))];
        self.client.configure_bus(bus, bitrate, protocols, false, REPLY_WINDOW).expect("a bus");
    }

    /// Configures an axis, and the own timeout of its motor if that can be told.
    pub fn configure_axis(&mut self, axis: u8) {
        let usual = usual::axes()[usize::from(axis)];
        usual.configure(&mut self.client, axis).expect("parameters");
        if usual.has_motor_timeout() {
            self.provision_timeout(axis);
        }
    }

    /// Tells a motor its own timeout.
    pub fn provision_timeout(&mut self, axis: u8) {
        let ms = u32::try_from(MOTOR_TIMEOUT.as_millis()).expect("small");
        self.client.provision_motor_timeout(axis, ms).expect("the motor's own timeout");
    }

    /// Lets the setpoints of an axis be valid for longer.
    pub fn set_ttl(&mut self, axis: u8, ttl: Duration) {
        let us = u32::try_from(ttl.as_micros()).expect("a TTL");
        usual::set_axis(&mut self.client, axis, &[(AxisParameter::TtlUs, us)]).expect("a TTL");
    }

    /// Arms axes; what each will be told from then on.
    pub fn arm(&mut self, axes: &[u8]) -> Vec<Hold> {
        axes.iter()
            .map(|&axis| {
                let ttl = self.client.axis_ttl(axis).expect("its TTL");
                Hold {
                    axis,
                    epoch: self.client.arm(axis).expect("armed").epoch,
                    setpoint: turning(axis),
                    ttl,
                }
            })
            .collect()
    }

    /// Arms axes and lets their motors come up to speed.
    pub fn moving(&mut self, axes: &[u8]) -> Vec<Hold> {
        let holds = self.arm(axes);
        self.keep(&holds, Duration::from_millis(300));
        for axis in axes {
            self.assert_turning(*axis);
        }
        holds
    }

    /// Asserts that a motor turns as fast as it was told to.
    #[track_caller]
    pub fn assert_turning(&self, axis: u8) {
        let (speed, wanted) =
            (self.motor(axis, Motor::speed_rad_s), SPEEDS_RAD_S[usize::from(axis)]);
        assert!((speed - wanted).abs() < 0.05 * wanted, "axis {axis}: {speed} rad/s");
    }

    /// Goes on telling the axes what to do. One that trips meanwhile refuses, and the others are
    /// told all the same.
    pub fn keep(&mut self, holds: &[Hold], duration: Duration) {
        let end = self.now() + duration;
        while self.now() < end {
            let next = (self.now() + RENEWAL).min(end);
            for hold in holds {
                match self.client.set(hold.axis, hold.epoch, hold.setpoint, hold.ttl) {
                    Ok(()) | Err(ClientError::Gateway(Error::Tripped { .. })) => {}
                    Err(error) => panic!("axis {} at {:?}: {error:?}", hold.axis, self.now()),
                }
            }
            let rest = next.saturating_sub(self.now());
            self.run_for(rest);
        }
    }

    /// Stays in command without a setpoint.
    pub fn stay(&mut self, duration: Duration) {
        self.client.hold(duration, |_| Ok(ControlFlow::Continue(()))).expect("the link lives");
    }

    /// Lets time pass without a word from the host.
    pub fn run_for(&self, duration: Duration) {
        self.machine.borrow_mut().run_for(duration);
    }

    pub fn now(&self) -> Duration {
        self.machine.borrow().now()
    }

    pub fn report(&mut self, axis: u8) -> AxisReport {
        self.client.read_state(axis).expect("a report")
    }

    /// Why an axis tripped, and whether its stop is confirmed.
    pub fn trip(&mut self, axis: u8) -> Option<(TripReason, bool)> {
        let report = self.report(axis);
        let confirmed = report.state == AxisState::Tripped { confirmed: true };
        report.trip.map(|trip| (trip.reason, confirmed))
    }

    /// What the gateway has told since the last time.
    pub fn events(&mut self) -> Vec<Event> {
        let next = |_| {
            self.client.poll_event(Duration::ZERO).expect("the link").map(|message| message.event)
        };
        (0..).map_while(next).collect()
    }

    pub fn motor<T>(&self, axis: u8, look: impl FnOnce(&Motor) -> T) -> T {
        let mut machine = self.machine.borrow_mut();
        look(self.outside.motor(&mut machine, usize::from(axis)))
    }

    /// What a motor has logged since an instant.
    pub fn motor_log(&self, axis: u8, since: Duration) -> Vec<MotorEvent> {
        let since = since.as_micros();
        self.motor(axis, |motor| {
            let entries = motor.log().entries();
            entries
                .filter(|entry| u128::from(entry.time_us) >= since)
                .map(|entry| entry.what)
                .collect()
        })
    }

    /// Asserts that a motor came to rest since an instant and stands, and that its own timeout did
    /// not strike before that.
    #[track_caller]
    pub fn assert_stopped_by_gateway(&self, axis: u8, since: Duration) {
        let log = self.motor_log(axis, since);
        let first = log
            .iter()
            .find(|event| matches!(event, MotorEvent::Stopped { .. } | MotorEvent::Timeout { .. }));
        assert!(matches!(first, Some(MotorEvent::Stopped { .. })), "axis {axis}: {log:?}");
        self.assert_standing(axis);
    }

    /// Asserts that a motor stands, as far as its log calls that so.
    #[track_caller]
    pub fn assert_standing(&self, axis: u8) {
        let speed = self.motor(axis, Motor::speed_rad_s);
        assert!(speed.abs() < 0.01, "axis {axis}: {speed} rad/s");
    }

    /// What was on a bus since an instant, in order. On RS485 only what the gateway sent.
    pub fn wire(&self, bus: u8, since: Duration) -> Vec<OnWire> {
        wire_of(&mut self.machine.borrow_mut(), &self.outside, bus, since)
    }

    /// The first frame on its bus since an instant that reads like this and arrived.
    #[track_caller]
    pub fn first(&self, bus: u8, since: Duration, text: &str) -> OnWire {
        wire::find(&self.wire(bus, since), text)
            .unwrap_or_else(|error| panic!("bus {bus}: {error}"))
            .clone()
    }

    /// The first stop of an axis since an instant.
    #[track_caller]
    pub fn first_stop(&self, axis: u8, since: Duration) -> OnWire {
        self.first(bus_of(axis), since, STOPS[usize::from(axis)])
    }

    /// How all axes have reacted to a cause, with so long before a stop is decided on.
    #[track_caller]
    pub fn reactions(&self, cause: &str, at: Duration, within: Duration) -> Vec<Reaction> {
        Reaction::of_all(cause, at, within, |bus| self.wire(bus, at))
    }
}

/// No test may meet a gap of the emulator that nobody knows.
impl Drop for Lab {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let met = gaps::met(&mut self.machine.borrow_mut());
            gaps::check_known(&met, gaps::known()).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

fn connect(machine: &Rc<RefCell<Machine>>, outside: &Outside, link: u8) -> Client<BoardTransport> {
    let transport = BoardTransport::new(machine, outside.hosts[usize::from(link)]);
    // Any number that differs from that of the session before.
    let session =
        u32::try_from(transport.now().as_micros()).expect("within an hour") + u32::from(link);
    Client::connect_as(transport, session, 1).expect("hello")
}

/// What was on a bus of a board since an instant.
pub fn wire_of(machine: &mut Machine, outside: &Outside, bus: u8, since: Duration) -> Vec<OnWire> {
    let port = match bus {
        BUS_RMD_AND_THRUSTER => CanPort::Bus0,
        BUS_D5 => CanPort::Bus1,
        _ => {
            let sent = machine.line(outside.rs485).sent();
            let begin = sent.partition_point(|sent| sent.first_bit < since);
            return wire::of_rs485(bus, &sent[begin..]);
        }
    };
    let records = machine.can(port).log();
    records
        .iter()
        .map(|record| wire::of_can(bus, record))
        .filter(|sent| sent.first_bit >= since)
        .collect()
}

/// The bus of an axis.
pub fn bus_of(axis: u8) -> u8 {
    usual::axes()[usize::from(axis)].bus
}

/// What makes a motor turn at its speed of [`SPEEDS_RAD_S`].
pub fn turning(axis: u8) -> Setpoint {
    usual::turning(usual::axes()[usize::from(axis)].protocol)
}

/// The gateway's refusal.
pub fn refused<T: std::fmt::Debug>(result: Result<T, ClientError>) -> Error {
    match result {
        Err(ClientError::Gateway(error)) => error,
        other => panic!("{other:?}"),
    }
}

/// The trips among events, by axis.
pub fn trips(events: &[Event]) -> Vec<(u8, TripReason)> {
    let mut trips: Vec<(u8, TripReason)> = events
        .iter()
        .filter_map(|event| match event {
            Event::Tripped { axis, trip: Trip { reason, .. } } => Some((*axis, *reason)),
            _ => None,
        })
        .collect();
    trips.sort_by_key(|(axis, _)| *axis);
    trips
}
