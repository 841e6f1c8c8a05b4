//! The image behind TCP: who gets a host UART, who is refused, what happens when a client goes.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};

use super::*;

/// Ping with sequence 1, worked out by hand in the host protocol's vectors.
const PING: [u8; 12] = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];
/// The image has booted.
const BOOTED: Duration = Duration::from_millis(20);

struct Rig {
    server: Server,
    addresses: [SocketAddr; 2],
    elapsed: Duration,
    log: Vec<String>,
}

impl Rig {
    fn new() -> Self {
        let listeners = [0, 1].map(|_| TcpListener::bind("127.0.0.1:0").unwrap());
        let addresses = [0, 1].map(|link: usize| listeners[link].local_addr().unwrap());
        let mut board = Machine::builder();
        let outside = Outside::four_motors(&mut board, 1);
        let mut machine = board.power_on();
        machine.run_for(BOOTED);
        let server = Server::new(listeners, machine, outside).unwrap();
        Self { server, addresses, elapsed: Duration::ZERO, log: Vec::new() }
    }

    /// Takes turns, each a millisecond of virtual time, until `done` says so.
    fn turn_until(&mut self, mut done: impl FnMut(&[String]) -> bool) {
        for _ in 0..20_000 {
            self.elapsed += Duration::from_millis(1);
            let log = &mut self.log;
            self.server.turn(self.elapsed, &mut |line: &str| log.push(line.into())).unwrap();
            if done(&self.log) {
                return;
            }
            thread::yield_now();
        }
        panic!("it never happened; the log is {:#?}", self.log);
    }

    /// The stream, and what the log says of it.
    fn connect(&mut self, link: usize) -> (TcpStream, String) {
        let stream = TcpStream::connect(self.addresses[link]).unwrap();
        stream.set_nonblocking(true).unwrap();
        let lines = self.log.len();
        self.turn_until(|log| log.len() > lines);
        (stream, self.log.last().unwrap().clone())
    }

    /// Asks for a ping's reply and waits for it: delimiters around something.
    fn ping(&mut self, stream: &mut TcpStream) -> Vec<u8> {
        stream.write_all(&PING).unwrap();
        let mut received = Vec::new();
        self.turn_until(|_| {
            let mut bytes = [0; 1_024];
            if let Ok(length) = stream.read(&mut bytes) {
                received.extend(&bytes[..length]);
            }
            received.len() > 2 && received.starts_with(&[0]) && received.ends_with(&[0])
        });
        received
    }
}

#[test]
fn each_host_uart_has_a_socket_of_its_own() {
    let mut rig = Rig::new();
    for link in [1, 0] {
        let (mut stream, line) = rig.connect(link);
        assert!(line.ends_with(&format!("connected to host link {link}")), "{line}");
        // Kind reply, sequence 1, behind the first COBS code.
        assert_eq!(rig.ping(&mut stream)[2..4], [0x02, 0x01]);
    }
}

#[test]
fn a_uart_has_one_client_at_a_time() {
    let mut rig = Rig::new();
    let (first, _) = rig.connect(0);
    let (mut second, line) = rig.connect(0);
    assert!(line.ends_with("refused: host link 0 is in use"), "{line}");
    assert_eq!(second.read(&mut [0; 1]).unwrap_or(0), 0, "closed");
    drop(first);
    rig.turn_until(|log| {
        log.last().is_some_and(|line| line.ends_with("has left: host link 0 is free"))
    });
    let (mut third, line) = rig.connect(0);
    assert!(line.ends_with("connected to host link 0"), "{line}");
    rig.ping(&mut third);
}

/// Time follows the caller's clock; after a long pause of the process it does not run after it.
#[test]
fn the_board_keeps_pace_and_gives_up_on_a_long_pause() {
    let mut rig = Rig::new();
    let start = rig.server.machine().now();
    let now = |rig: &mut Rig| rig.server.machine().now() - start;
    rig.turn_until(|log| log.is_empty());
    // A look may end an instruction early or late.
    let near =
        |time: Duration, expected: Duration| time.abs_diff(expected) < Duration::from_micros(1);
    assert!(near(now(&mut rig), Duration::from_millis(1)));
    rig.elapsed = Duration::from_millis(9);
    rig.turn_until(|_| true);
    assert!(near(now(&mut rig), Duration::from_millis(10)));
    rig.elapsed = Duration::from_secs(10);
    rig.turn_until(|_| true);
    assert!(near(now(&mut rig), Duration::from_millis(20)), "{:?}", now(&mut rig));
    rig.turn_until(|_| true);
    assert!(near(now(&mut rig), Duration::from_millis(21)), "{:?}", now(&mut rig));
}

#[test]
fn a_computer_that_is_too_slow_says_so() {
    let mut rig = Rig::new();
    rig.turn_until(|_| true);
    rig.elapsed += Duration::from_millis(300);
    rig.turn_until(|log| !log.is_empty());
    // The pause, the millisecond of the turn, less the 10 ms that it made up for.
    let line =
        "this computer was 291 ms too slow for one second of the board: setpoints may expire";
    assert_eq!(rig.log, [line]);
    rig.log.clear();
    let later = rig.elapsed + Duration::from_secs(2);
    while rig.elapsed < later {
        rig.turn_until(|_| true);
    }
    assert_eq!(rig.log, [] as [String; 0], "once");
}

/// The firmware logs to RTT, and polls nothing that has not been configured: what is left is the
/// log of a second.
#[test]
fn records_that_nobody_reads_are_thrown_away() {
    let mut rig = Rig::new();
    let rs485 = rig.server.outside.rs485;
    rig.turn_until(|_| true);
    while rig.elapsed < Duration::from_millis(1_300) {
        rig.elapsed += Duration::from_millis(8);
        rig.turn_until(|_| true);
    }
    assert!(rig.server.machine().now() > rig.server.tidied);
    assert!(rig.server.tidied >= Duration::from_secs(1));
    assert_eq!(rig.server.machine().line(rs485).sent(), []);
    assert_eq!(rig.server.machine().take_rtt(), [0u8; 0], "it logs when it boots only");
}
