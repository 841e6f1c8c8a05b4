//! The client library and the image, over the UARTs.

use std::ops::ControlFlow;

use host_protocol::requests::Ping;
use host_protocol::{Call, Kind, MAX_FRAME, Setpoint, StopTarget, encode};
use mgw_client::{Client, Hold};

use super::*;
use crate::board::Board;
use crate::outside::Outside;
use crate::usual::{self, Axis};

const TTL: Duration = Duration::from_millis(100);

/// A board with one RMD motor on its RS485 line.
fn board(bitrate: u32) -> (Rc<RefCell<Machine>>, Outside) {
    let mut builder = Machine::builder();
    let motor = usual::rmd(2, 1, bitrate);
    let outside = Outside::connect(&mut builder, &[motor], 1).unwrap();
    (Rc::new(RefCell::new(builder.power_on())), outside)
}

/// That board with its motor, at the usual rate, configured on host link 0.
fn configured() -> (Rc<RefCell<Machine>>, Outside, Client<BoardTransport>) {
    let (machine, outside) = board(115_200);
    let mut client = client(&machine, &outside, 0);
    configure(&mut client);
    (machine, outside, client)
}

fn client(
    machine: &Rc<RefCell<Machine>>,
    outside: &Outside,
    link: usize,
) -> Client<BoardTransport> {
    let session = u32::try_from(link).unwrap();
    Client::connect_as(BoardTransport::new(machine, outside.hosts[link]), session, 1).unwrap()
}

/// The motor on the RS485 line as axis 0, at the usual 115200 baud.
fn configure(client: &mut Client<BoardTransport>) {
    usual::start_rmd_bus(client, 2, 115_200).unwrap();
    Axis::rmd(2).configure(client, 0).unwrap();
}

#[test]
fn the_image_answers_hello_on_both_links() {
    let (machine, outside) = board(115_200);
    let first = client(&machine, &outside, 0);
    let mut second = client(&machine, &outside, 1);
    assert_eq!(first.hello().board, Board::chosen().name());
    assert_eq!(first.hello().buses.len(), 3);
    second.ping().unwrap();
    let settings = machine.borrow_mut().line(outside.hosts[1]).settings();
    assert_eq!(settings.bits_per_second(), 917_431);
}

/// One bit of lead and of tail (src/board/nucleo_h743zi.rs), and 100 MHz / 868.
#[test]
fn the_image_drives_the_transceiver() {
    let (machine, outside, _client) = configured();
    let settings = machine.borrow_mut().line(outside.rs485).settings();
    let enable = settings.driver_enable.expect("driver enable is on");
    assert_eq!((enable.assertion, enable.deassertion, enable.active_low), (16, 16, false));
    assert_eq!(settings.bits_per_second(), 115_207);
}

#[test]
fn a_motor_on_rs485_is_moved_and_stopped() {
    let (machine, outside, mut client) = configured();
    client.provision_motor_timeout(0, 1_000).unwrap();
    let epoch = client.arm(0).unwrap().epoch;
    let hold =
        Hold { axis: 0, epoch, setpoint: Setpoint::Velocity { velocity_rad_s: 2.0 }, ttl: TTL };
    client
        .hold_setpoints(&[hold], Duration::from_millis(500), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    let speed = outside.motor(&mut machine.borrow_mut(), 0).speed_rad_s();
    assert!((speed - 2.0).abs() < 0.05, "{speed} rad/s");
    client.stop(StopTarget::Axis(0)).unwrap();
    client.transport_mut().sleep(Duration::from_secs(1));
    assert_eq!(outside.motor(&mut machine.borrow_mut(), 0).speed_rad_s(), 0.0);
    assert!(machine.borrow_mut().line(outside.rs485).sent().iter().all(|sent| sent.driven));
}

#[test]
fn a_motor_at_another_rate_is_no_motor() {
    let (machine, outside) = board(500_000);
    let mut client = client(&machine, &outside, 0);
    configure(&mut client);
    client.provision_motor_timeout(0, 1_000).unwrap_err();
    assert_eq!(outside.motor(&mut machine.borrow_mut(), 0).log().entries().count(), 0);
}

/// The delimiter wakes the firmware in the middle of a stream: without the character match it would
/// wait for a pause of the line, or for half its ring of 256 bytes, which the rounds reach at
/// different places.
#[test]
fn a_request_inside_a_stream_is_answered_at_once() {
    let (machine, outside) = board(115_200);
    let host = outside.hosts[0];
    client(&machine, &outside, 0).ping().unwrap();
    let mut machine = machine.borrow_mut();
    for round in 0..4 {
        machine.line(host).send(&ping_frame(0x7000 + round));
        machine.line(host).send(&[b'x'; 100]);
        assert!(
            machine
                .run_until(Duration::from_millis(5), |machine| machine.line(host).has_received())
        );
        assert!(machine.line(host).unsent() > 50, "round {round}: the stream has only begun");
        machine.run_for(Duration::from_millis(5));
        machine.line(host).clear();
    }
}

fn ping_frame(sequence: u16) -> Vec<u8> {
    let mut frame = [0; MAX_FRAME];
    let length = encode(Kind::Request, sequence, Ping::NUMBER, &Ping {}, &mut frame).unwrap();
    frame[..length].to_vec()
}

/// Two runs with the same orders are the same run.
#[test]
fn runs_are_repeatable() {
    let run = || {
        let (machine, outside, mut client) = configured();
        client.provision_motor_timeout(0, 1_000).unwrap();
        let sent = machine.borrow_mut().line(outside.rs485).sent().to_vec();
        let digest = machine.borrow_mut().access_digest();
        (sent, digest)
    };
    assert_eq!(run(), run());
}

/// From a snapshot in mid-motion on, the copy lives as the original does.
#[test]
fn a_board_and_its_motor_go_on_from_a_snapshot() {
    let (machine, outside, mut client) = configured();
    client.provision_motor_timeout(0, 1_000).unwrap();
    let epoch = client.arm(0).unwrap().epoch;
    client.set(0, epoch, Setpoint::Velocity { velocity_rad_s: 2.0 }, TTL).unwrap();
    let snapshot = machine.borrow_mut().snapshot();
    let life = |machine: &mut Machine, outside: &Outside| {
        machine.run_for(Duration::from_millis(1_500));
        let log: Vec<_> = outside.motor(machine, 0).log().entries().copied().collect();
        let position = outside.motor(machine, 0).position_rad().to_bits();
        (log, position, machine.line(outside.rs485).sent().to_vec(), machine.access_digest())
    };
    let mut builder = Machine::builder();
    let motor = usual::rmd(2, 1, 115_200);
    let other = Outside::connect(&mut builder, &[motor], 1).unwrap();
    let copy = life(&mut builder.resume(&snapshot), &other);
    let original = life(&mut machine.borrow_mut(), &outside);
    assert!(
        original.0.iter().any(|entry| entry.what.to_string().starts_with("stopped")),
        "{:?}",
        original.0
    );
    assert!(copy == original);
}
