//! The cable between the server and the gateway: it can be pulled out, and notes what passes.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{Call, Deframer, Kind, requests};

/// How long stops are held where that fault is planted.
const PLANTED: Duration = Duration::from_millis(20);

#[derive(Default)]
struct Passed {
    stops: Vec<Instant>,
    /// The latest request of who commands.
    word: Option<Instant>,
    is_out: bool,
    ends: Vec<TcpStream>,
}

/// A cable.
pub struct Cable {
    /// The port that the server opens.
    pub name: String,
    passed: Arc<Mutex<Passed>>,
}

impl Cable {
    /// One to a gateway. `late`: stops are held on it.
    pub fn new(gateway: &str, late: bool) -> io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let name = format!("tcp:{}", listener.local_addr()?);
        let passed = Arc::new(Mutex::new(Passed::default()));
        let (gateway, notes) = (gateway.to_string(), passed.clone());
        thread::spawn(move || {
            for server in listener.incoming().flatten() {
                let _ = plug_in(&server, &gateway, &notes, late);
            }
        });
        Ok(Self { name, passed })
    }

    /// Out it is.
    pub fn pull(&self) {
        let Ok(mut passed) = self.passed.lock() else { return };
        passed.is_out = true;
        for end in passed.ends.drain(..) {
            let _ = end.shutdown(Shutdown::Both);
        }
    }

    /// And in again.
    pub fn put_back(&self) {
        if let Ok(mut passed) = self.passed.lock() {
            passed.is_out = false;
        }
    }

    /// When the first stop since then has passed.
    pub fn stop_since(&self, then: Instant) -> Option<Instant> {
        self.passed.lock().ok()?.stops.iter().copied().find(|at| *at >= then)
    }

    /// When the latest request of who commands has passed.
    pub fn last_word(&self) -> Instant {
        let word = self.passed.lock().ok().and_then(|passed| passed.word);
        word.unwrap_or_else(Instant::now)
    }
}

fn plug_in(
    server: &TcpStream,
    gateway: &str,
    notes: &Arc<Mutex<Passed>>,
    late: bool,
) -> io::Result<()> {
    let Ok(mut passed) = notes.lock() else { return Ok(()) };
    if passed.is_out {
        return server.shutdown(Shutdown::Both);
    }
    let gateway = TcpStream::connect(gateway)?;
    for end in [server, &gateway] {
        end.set_nodelay(true)?;
        passed.ends.push(end.try_clone()?);
    }
    drop(passed);
    let (from, to, notes) = (server.try_clone()?, gateway.try_clone()?, notes.clone());
    thread::spawn(move || {
        let mut deframer = Deframer::new();
        carry(from, to, |bytes| note(&mut deframer, bytes, &notes, late));
    });
    let (from, to) = (gateway, server.try_clone()?);
    thread::spawn(move || carry(from, to, |_| {}));
    Ok(())
}

fn carry(mut from: TcpStream, mut to: TcpStream, mut pass: impl FnMut(&[u8])) {
    let mut bytes = [0; 4_096];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        let bytes = bytes.get(..count).unwrap_or_default();
        pass(bytes);
        if to.write_all(bytes).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

fn note(deframer: &mut Deframer, mut bytes: &[u8], notes: &Mutex<Passed>, late: bool) {
    while !bytes.is_empty() {
        let Some(Ok(frame)) = deframer.take(&mut bytes) else { continue };
        let is_stop = frame.number == requests::Stop::NUMBER;
        let is_word = frame.kind == Kind::Request;
        if late && is_stop {
            thread::sleep(PLANTED);
        }
        if let Ok(mut passed) = notes.lock() {
            let now = Instant::now();
            if is_stop {
                passed.stops.push(now);
            }
            if is_word {
                passed.word = Some(now);
            }
        }
    }
}
