//! The program on a serial device whose bytes arrive changed now and then: a pseudo terminal of
//! this system, with a simulated gateway at its other end in wall-clock time. What a motor did is
//! asserted by the simulator's clock.

use std::fs::File;
use std::io::{Read, Write};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use host_protocol::Incident;
use mgw_client::Client;
use mgw_sim::{MotorEvent, SimTransport};
use serialport::{SerialPort, TTYPort};

use crate::device::{Device, LINK, LOOK_EVERY, OTHER_LINK, read, simulated};
use crate::support::{Process, json, mgw};

/// Up to this speed a motor counts as standing, unless configured otherwise.
const STANDSTILL_RAD_S: f64 = 0.105;
/// Of a thousand bytes so many arrive changed: one frame in ten or so.
const CHANGED_OF_1000: u32 = 3;
/// The most time that passes between two looks.
const AT_ONCE: Duration = Duration::from_millis(20);
/// So long that a machine that is busy with other things trips nothing: the rhythm of setpoints is
/// shown in virtual time.
const PATIENT: [&[&str]; 2] = [
    &["config", "gateway", "link_silence_us=10000000"],
    &["config", "axis", "0", "ttl_us=10000000"],
];

/// What the simulator says at the end.
struct Seen {
    moved: bool,
    speed_rad_s: f64,
    trips: usize,
}

fn serve(mut device: TTYPort, until: &Receiver<()>) -> Seen {
    let world = simulated(&PATIENT);
    let mut random = fastrand::Rng::with_seed(1);
    let mut spoil = |bytes: &mut [u8]| {
        for byte in bytes {
            if random.u32(..1_000) < CHANGED_OF_1000 {
                *byte ^= random.u8(1..);
            }
        }
    };
    let mut before = Instant::now();
    while until.try_recv() != Err(TryRecvError::Disconnected) {
        let mut bytes = read(&mut device);
        spoil(&mut bytes);
        // A busy machine slows the gateway down; it keeps nobody waiting meanwhile.
        let passed = before.elapsed().min(AT_ONCE);
        before = Instant::now();
        let mut world = world.borrow_mut();
        world.run_for(passed);
        world.host_send(LINK, &bytes);
        let mut answers = world.host_receive(LINK);
        spoil(&mut answers);
        device.write_all(&answers).expect("it is read");
    }
    let mut client =
        Client::connect(SimTransport::new(world.clone(), OTHER_LINK)).expect("a clean line");
    let trips = client.incidents().expect("they are told");
    let trips =
        trips.iter().filter(|incident| matches!(incident, Incident::Tripped { .. })).count();
    let world = world.borrow();
    let moved =
        world.motor(0).log().entries().any(|entry| matches!(entry.what, MotorEvent::Moving { .. }));
    Seen { moved, speed_rad_s: world.motor(0).speed_rad_s(), trips }
}

#[test]
fn a_motion_on_a_serial_line_with_errors_trips_nothing_and_ends_in_a_stop() {
    let device = Device::open(serve);
    let outcome = mgw(&["--port", &device.name, "set", "0", "velocity", "2", "--for", "1"]);
    let seen = device.close();
    outcome.success();
    assert!(seen.moved && seen.speed_rad_s.abs() <= STANDSTILL_RAD_S, "{} rad/s", seen.speed_rad_s);
    assert_eq!(seen.trips, 0);
}

#[test]
fn ctrl_c_and_stop_on_a_serial_line_with_errors_stop_the_motor() {
    let device = Device::open(serve);
    let mut host = Process::start(&["--port", &device.name, "set", "0", "velocity", "2"]);
    // The first state that is active may be that of a motor that has only begun to turn.
    for _ in 0..2 {
        host.wait_for("motion", |line| line.contains("active").then_some(()));
    }
    assert_eq!(host.interrupt(), Some(0));
    mgw(&["--port", &device.name, "stop", "0"]).success();
    let seen = device.close();
    assert!(seen.moved && seen.speed_rad_s.abs() <= STANDSTILL_RAD_S, "{} rad/s", seen.speed_rad_s);
    assert_eq!(seen.trips, 0);
}

#[test]
fn a_port_that_another_program_uses_is_refused_with_the_name_of_that_program() {
    let (mut other_end, port) = TTYPort::pair().expect("a pseudo terminal");
    let name = port.name().expect("it has a name");
    drop(port);
    let mut user = Process::start(&["--port", &name, "stop"]);
    // Until it has opened the port and writes its stop, reading fails.
    let end = Instant::now() + Duration::from_secs(60);
    while other_end.read_exact(&mut [0]).is_err() {
        assert!(Instant::now() < end, "it writes nothing");
        std::thread::sleep(LOOK_EVERY);
    }
    let error = mgw(&["--json", "--port", &name, "info"]).failure(1);
    user.kill();
    let error = &json(&error)["error"];
    assert_eq!(error["name"], "port_in_use");
    let text = error["message"].as_str().unwrap();
    assert!(text.starts_with(&format!("{name} is in use by mgw (process ")), "{text}");
}

#[test]
fn a_port_behind_which_nothing_answers_is_named() {
    let (_other_end, port) = TTYPort::pair().expect("a pseudo terminal");
    let name = port.name().expect("it has a name");
    let kept = File::options().read(true).write(true).open(&name).expect("it is there");
    drop(port);
    let text = mgw(&["--port", &name, "info"]).failure(1);
    assert!(text.contains(&format!("no gateway answered at {name} within 2000 ms")), "{text}");
    drop(kept);
}
