//! The examples of the client library, each for a moment on the simulated gateway, in virtual time.

#[path = "../../../host/client/examples/impedance.rs"]
#[allow(dead_code, reason = "its main is the program")]
mod impedance;
#[path = "../../../host/client/examples/jitter.rs"]
#[allow(dead_code, reason = "its main is the program")]
mod jitter;
#[path = "../../../host/client/examples/sine.rs"]
#[allow(dead_code, reason = "its main is the program")]
mod sine;

use std::cell::RefCell;
use std::io;
use std::pin::pin;
use std::rc::Rc;
use std::sync::mpsc::{Sender, channel};
use std::task::{Context, Waker};
use std::time::Duration;

use host_protocol::requests::Stop;
use host_protocol::{AxisState, Call, Deframer, Event, Kind, Setpoint, StopTarget};
use mgw_cli::run_on;
use mgw_client::{AsyncClient, Client, ClientError, Interrupt, Transport};
use mgw_sim::{SimTransport, Wiring, World};

const CONFIGURATION: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/../host/cli/examples/four-motors.toml");
/// Axes of that configuration that turn at any velocity: RMD, D5, and RMD on RS485. A thruster has
/// a lowest.
const RMD: u8 = 0;
const AXES: [u8; 3] = [RMD, 2, 3];
const LASTS: Duration = Duration::from_millis(500);

/// A gateway with four motors, configured.
fn world() -> Rc<RefCell<World>> {
    let world = Rc::new(RefCell::new(World::new(Wiring::four_motors())));
    let transport = Box::new(SimTransport::new(world.clone(), 1));
    let outcome = run_on(transport, Interrupt::default(), &["config", "apply", CONFIGURATION]);
    assert_eq!(outcome.exit_code, 0, "{outcome:?}");
    world
}

fn client() -> Client<SimTransport> {
    Client::connect(SimTransport::new(world(), 0)).unwrap()
}

fn connect() -> AsyncClient {
    let make = || Ok(Box::new(SimTransport::new(world(), 0)) as _);
    pollster::block_on(AsyncClient::connect(make)).unwrap()
}

/// Whether they come to rest.
fn rest(gateway: &mut Client<SimTransport>, axes: &[u8]) -> bool {
    gateway.pause(Duration::from_secs(2)).unwrap();
    axes.iter().all(|axis| {
        let state = gateway.read_state(*axis).unwrap().state;
        matches!(state, AxisState::Idle | AxisState::Holding)
    })
}

#[test]
fn the_sine_turns_its_axes_and_stops_them() {
    let mut gateway = client();
    let said = sine::run(&mut gateway, &AXES, LASTS).unwrap();
    assert!(said.contains("rounds of 3 axes"), "{said}");
    assert!(rest(&mut gateway, &AXES));
    let world = gateway.transport().world().borrow();
    let moved = |axis: &u8| world.motor(usize::from(*axis)).position_rad().abs() > 0.01;
    assert!(AXES.iter().all(moved));
}

/// In virtual time nothing is late, and at 3 Mbaud every answer is back within its period.
#[test]
fn the_loop_at_1_khz_keeps_its_grid() {
    let mut gateway = client();
    gateway.set_baud(3_000_000).unwrap();
    let said = jitter::run(&mut gateway, &[RMD], LASTS).unwrap();
    assert!(said.starts_with("500 rounds of 1ms, 0 left out"), "{said}");
    assert!(rest(&mut gateway, &[RMD]));
}

#[test]
fn the_impedance_loop_follows_its_point_and_stops() {
    let gateway = connect();
    let said = pollster::block_on(impedance::run(&gateway, RMD, LASTS)).unwrap();
    // A motor that stays where it is ends up 0.2 rad from the point.
    let (rounds, rest) = said.split_once(" rounds, at most ").expect("two numbers");
    let furthest: f32 = rest.split(' ').next().unwrap().parse().unwrap();
    assert!(rounds.parse::<u32>().unwrap() > 50 && (0.001..0.15).contains(&furthest), "{said}");
}

/// What was asked for is done in its turn, events come meanwhile, and errors come back.
#[test]
fn an_async_client_arms_cycles_stops_and_tells_events() {
    let gateway = connect();
    pollster::block_on(async {
        assert_eq!(gateway.hello().board.as_str(), "simulated");
        gateway.arm_together(&[RMD]).await.unwrap();
        gateway.stop(StopTarget::All).await.unwrap();
        loop {
            if let Event::StateChanged { axis: RMD, state: AxisState::Stopping } =
                gateway.event().await.unwrap().event
            {
                break;
            }
        }
        let refused = gateway.arm(99).await;
        assert!(matches!(refused, Err(ClientError::Gateway(_))), "{refused:?}");
    });
}

/// It does not wait for its turn: what moves stops, and nothing that moves is sent any more.
#[test]
fn an_interrupt_ends_what_an_async_client_does() {
    let gateway = connect();
    pollster::block_on(async {
        gateway.arm(RMD).await.unwrap();
        gateway.interrupt().raise();
        let refused = gateway.arm(RMD).await;
        assert!(matches!(refused, Err(ClientError::Interrupted { armed: true })), "{refused:?}");
    });
}

/// Tells of each frame that is sent.
struct Told(SimTransport, Sender<Vec<u8>>);

impl Transport for Told {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let _ = self.1.send(bytes.to_vec());
        self.0.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.receive(buffer, timeout)
    }

    fn now(&self) -> Duration {
        self.0.now()
    }

    fn sleep(&mut self, duration: Duration) {
        self.0.sleep(duration);
    }

    fn reconnect(&mut self) -> io::Result<()> {
        self.0.reconnect()
    }
}

/// Nor does it wait for a call.
#[test]
fn an_interrupt_of_an_async_client_is_followed_while_nothing_is_asked() {
    let (told, frames) = channel();
    let make = move || Ok(Box::new(Told(SimTransport::new(world(), 0), told)) as _);
    let gateway = pollster::block_on(AsyncClient::connect(make)).unwrap();
    pollster::block_on(gateway.arm(RMD)).unwrap();
    while frames.try_recv().is_ok() {}
    gateway.interrupt().raise();
    let frame = frames.recv_timeout(Duration::from_secs(60)).expect("a frame");
    let mut deframer = Deframer::new();
    let mut heard = frame.iter().filter_map(|byte| {
        let frame = deframer.push(*byte)?.expect("a whole one");
        Some((frame.kind, frame.number))
    });
    assert_eq!(heard.next(), Some((Kind::Request, Stop::NUMBER)));
}

/// What an interrupt has stopped stays stopped; what is armed after it was followed may move.
#[test]
fn a_client_goes_on_after_an_interrupt() {
    let interrupt = Interrupt::default();
    let transport = SimTransport::new(world(), 0);
    let mut gateway = Client::connect_heeding(transport, interrupt.clone()).unwrap();
    let turn = Setpoint::Velocity { velocity_rad_s: 2.0 };
    let before = gateway.arm(RMD).unwrap().epoch;
    gateway.set(RMD, before, turn, LASTS / 5).unwrap();
    interrupt.raise();
    gateway.resume().unwrap();
    assert!(!interrupt.is_raised());
    let refused = gateway.set(RMD, before, turn, LASTS / 5);
    assert!(matches!(refused, Err(ClientError::Gateway(_))), "{refused:?}");
    assert!(rest(&mut gateway, &[RMD]));
    let after = gateway.arm(RMD).unwrap().epoch;
    gateway.set(RMD, after, turn, LASTS / 5).unwrap();
    // And is followed again.
    interrupt.raise();
    let ended = gateway.set(RMD, after, turn, LASTS / 5);
    assert!(matches!(ended, Err(ClientError::Interrupted { armed: true })), "{ended:?}");
}

/// What waits behind another request lives no longer for it.
#[test]
fn a_setpoint_that_waited_longer_than_it_lives_is_not_sent() {
    let gateway = connect();
    let epoch = pollster::block_on(gateway.arm(RMD)).unwrap().epoch;
    let (go_on, held_up) = channel::<()>();
    let mut busy = pin!(gateway.with(move |_| {
        let _ = held_up.recv();
        Ok(())
    }));
    let (turn, ttl) = (Setpoint::Velocity { velocity_rad_s: 1.0 }, Duration::from_millis(20));
    let mut set = pin!(gateway.set(RMD, epoch, turn, ttl));
    let mut context = Context::from_waker(Waker::noop());
    assert!(busy.as_mut().poll(&mut context).is_pending());
    assert!(set.as_mut().poll(&mut context).is_pending());
    std::thread::sleep(ttl);
    go_on.send(()).unwrap();
    let late = pollster::block_on(set);
    assert!(matches!(late, Err(ClientError::NoAnswer { after, .. }) if after == ttl), "{late:?}");
    let state = pollster::block_on(gateway.read_state(RMD)).unwrap().state;
    assert_eq!(state, AxisState::Armed);
}

#[test]
fn a_task_that_panics_ends_the_client_with_an_error() {
    let gateway = connect();
    pollster::block_on(async {
        let failed = gateway.with(|_| -> Result<(), ClientError> { panic!("on purpose") }).await;
        assert!(matches!(failed, Err(ClientError::Transport(_))), "{failed:?}");
        assert!(matches!(gateway.estop().await, Err(ClientError::Transport(_))));
    });
}

#[test]
fn a_port_that_cannot_be_opened_is_an_error() {
    let failed = pollster::block_on(AsyncClient::open("/dev/no-such-gateway"));
    assert!(matches!(failed, Err(ClientError::Connect(_))), "{failed:?}");
}
