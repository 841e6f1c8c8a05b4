//! A world behind TCP: who gets a host link, who is refused, what happens to a client that goes or does not read.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use mgw_sim::{Server, Wiring, World};

/// Ping with sequence 1, worked out by hand in the host protocol's vectors.
const PING: [u8; 12] = [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00];

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
    let mut next = rig.connect();
    let refused = format!("refused: all {} host links are taken", gateway::MAX_LINKS);
    assert!(rig.last_line().ends_with(&refused), "{}", rig.last_line());
    assert_eq!(next.read(&mut [0; 1]).unwrap_or(0), 0, "closed");
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
    let mut deaf = rig.connect();
    let mut reader = rig.connect();
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
