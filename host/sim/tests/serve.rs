//! A world behind TCP: who gets a host link, who is refused, what happens to a client that goes or
//! does not read.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use mgw_sim::{Server, Wiring, World};

/// Ping with sequence 1, worked out by hand in the host protocol's vectors.
const PING: [u8; 12] = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];

/// Hello and a stop of everything, from the vectors too.
const HELLO: [u8; 19] = [
    0x00, 0x03, 0x01, 0x02, 0x02, 0x01, 0x02, 0x01, 0x0A, 0xEF, 0xFD, 0xB6, 0xF5, 0x0D, 0xE1, 0x5A,
    0xE7, 0x78, 0x00,
];
const STOP_ALL: [u8; 13] =
    [0x00, 0x03, 0x01, 0x13, 0x02, 0x32, 0x06, 0x01, 0x24, 0x91, 0xE9, 0x53, 0x00];

struct Rig {
    server: Server,
    address: std::net::SocketAddr,
    elapsed: Duration,
    log: Vec<String>,
}

impl Rig {
    fn new() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let server = Server::new(listener, World::new(Wiring::four_motors())).unwrap();
        Self { server, address, elapsed: Duration::ZERO, log: Vec::new() }
    }

    /// Takes turns, each a millisecond of simulated time, until `done` says so.
    fn turn_until(&mut self, mut done: impl FnMut(&[String]) -> bool) {
        for _ in 0..20_000 {
            self.elapsed += Duration::from_millis(1);
            let log = &mut self.log;
            self.server.turn(self.elapsed, &mut |line: &str| log.push(line.into())).unwrap();
            if done(&self.log) {
                return;
            }
            std::thread::yield_now();
        }
        panic!("it never happened; the log is {:#?}", self.log);
    }

    fn connect(&mut self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_nonblocking(true).unwrap();
        let lines = self.log.len();
        self.turn_until(|log| log.len() > lines);
        stream
    }

    fn last_line(&self) -> &str {
        self.log.last().unwrap()
    }
}

/// Whether the gateway has answered: anything between two delimiters will do.
fn has_answer(stream: &mut TcpStream, received: &mut Vec<u8>) -> bool {
    let mut bytes = [0; 1_024];
    if let Ok(len) = stream.read(&mut bytes) {
        received.extend(&bytes[..len]);
    }
    received.len() > 2 && received.starts_with(&[0]) && received.ends_with(&[0])
}

#[test]
fn as_many_clients_as_the_core_has_links_are_served_and_the_next_is_refused() {
    let mut rig = Rig::new();
    let mut clients: Vec<TcpStream> = (0..gateway::MAX_LINKS).map(|_| rig.connect()).collect();
    let last = gateway::MAX_LINKS - 1;
    assert!(rig.last_line().ends_with(&format!("connected to host link {last}")));
    for client in &mut clients {
        client.write_all(&PING).unwrap();
        let mut received = Vec::new();
        rig.turn_until(|_| has_answer(client, &mut received));
        // Kind reply, sequence 1, number 2, behind the first COBS code.
        assert_eq!(received[2..4], [0x02, 0x01]);
    }
    let mut next = TcpStream::connect(rig.address).unwrap();
    next.write_all(&HELLO).unwrap();
    let refused = format!("refused: all {} host links are taken", gateway::MAX_LINKS);
    rig.turn_until(|log| log.last().is_some_and(|line| line.ends_with(&refused)));
    assert_eq!(next.read(&mut [0; 1]).unwrap(), 0, "closed");
}

/// A client that has said Hello, and when.
fn greeted(rig: &mut Rig) -> TcpStream {
    let mut client = rig.connect();
    client.write_all(&HELLO).unwrap();
    let mut received = Vec::new();
    rig.turn_until(|_| has_answer(&mut client, &mut received));
    client
}

#[test]
fn a_client_that_stops_something_gets_a_link_though_all_are_taken() {
    let mut rig = Rig::new();
    let mut clients: Vec<TcpStream> = (0..gateway::MAX_LINKS).map(|_| greeted(&mut rig)).collect();
    // The first one has stopped something already; the second one has only looked, and for longest.
    clients[0].write_all(&STOP_ALL).unwrap();
    let mut received = Vec::new();
    rig.turn_until(|_| has_answer(&mut clients[0], &mut received));

    let mut stops = TcpStream::connect(rig.address).unwrap();
    // In two pieces, and nothing but a stop will do.
    stops.write_all(&STOP_ALL[..5]).unwrap();
    rig.elapsed += Duration::from_millis(100);
    rig.turn_until(|_| true);
    stops.set_nonblocking(true).unwrap();
    stops.write_all(&STOP_ALL[5..]).unwrap();
    let mut received = Vec::new();
    rig.turn_until(|_| has_answer(&mut stops, &mut received));
    // Kind reply, sequence 0x13, number 0x32.
    assert_eq!(received[2..4], [0x02, 0x13]);
    assert!(rig.last_line().ends_with("connected to host link 1"), "{:?}", rig.log);
    assert!(rig.log.iter().any(|line| line.contains("has lost host link 1:")), "{:?}", rig.log);
}

#[test]
fn who_never_says_hello_loses_its_link_within_a_second() {
    let mut rig = Rig::new();
    let mut silent: Vec<TcpStream> = (0..gateway::MAX_LINKS).map(|_| rig.connect()).collect();
    // Requests that need no session are no Hello.
    silent[0].write_all(&PING).unwrap();
    let before = rig.elapsed;
    rig.turn_until(|log| {
        log.iter().filter(|line| line.ends_with("it has not said Hello")).count() == 3
    });
    assert!(rig.elapsed - before <= Duration::from_millis(1_001));
    let kept = greeted(&mut rig);
    rig.elapsed += Duration::from_secs(5);
    rig.turn_until(|_| true);
    assert!(rig.last_line().ends_with("connected to host link 0"), "{:?}", rig.log);
    drop(kept);
}

#[test]
fn a_client_that_waits_for_a_link_is_not_waited_for() {
    let mut rig = Rig::new();
    let _clients: Vec<TcpStream> = (0..gateway::MAX_LINKS).map(|_| greeted(&mut rig)).collect();
    let mut noise = TcpStream::connect(rig.address).unwrap();
    noise.write_all(&[0x55; 4_000]).unwrap();
    let _silent = TcpStream::connect(rig.address).unwrap();
    let refused = |log: &[String]| log.iter().filter(|line| line.contains("refused: all")).count();
    rig.turn_until(|log| refused(log) == 2);
    assert!(rig.elapsed < Duration::from_secs(3), "{:?}", rig.elapsed);
}

#[test]
fn a_link_is_free_again_when_its_client_has_gone() {
    let mut rig = Rig::new();
    let _first = rig.connect();
    drop(rig.connect());
    rig.turn_until(|log| log.last().is_some_and(|line| line.ends_with("has left host link 1")));
    let mut again = rig.connect();
    assert!(rig.last_line().ends_with("connected to host link 1"));
    again.write_all(&PING).unwrap();
    let mut received = Vec::new();
    rig.turn_until(|_| has_answer(&mut again, &mut received));
}

/// It asks and asks; the other client is served as before.
#[test]
fn a_client_that_does_not_read_holds_up_nobody() {
    let mut rig = Rig::new();
    let mut deaf = greeted(&mut rig);
    let mut reader = greeted(&mut rig);
    let pings = PING.repeat(100);
    let mut asked = 0;
    rig.turn_until(|_| {
        asked += deaf.write(&pings).unwrap_or(0);
        asked > 200_000
    });
    reader.write_all(&PING).unwrap();
    let mut received = Vec::new();
    rig.turn_until(|_| has_answer(&mut reader, &mut received));
}

#[test]
fn time_goes_on_in_the_served_world_and_catches_up() {
    let mut rig = Rig::new();
    rig.server.turn(Duration::from_secs(3), &mut |_: &str| {}).unwrap();
    assert_eq!(rig.server.world().now().as_micros(), 3_000_000);
}
