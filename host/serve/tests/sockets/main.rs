//! A server on a real Unix socket, with connections that come and go, or come and say nothing.
#![cfg(target_os = "linux")]

use std::fs;
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::StopTarget;
use mgw_client::{Client, ClientError, Halves, TcpTransport, Transport, open, open_halves};
use mgw_serve::{Listener, serve};
use mgw_sim::{Wiring, World};

/// Every wait together.
const PATIENCE: Duration = Duration::from_secs(120);
const TOKEN: &str = "correct horse";
/// Programs that have a place.
const PROGRAMS: usize = 128;
/// Descriptors that a server with all its places taken needs at most, and the test beside it.
const DESCRIPTORS: usize = 1_000;
/// The descriptors of this process are counted: one test at a time.
static ALONE: Mutex<()> = Mutex::new(());

type Program = Client<Box<dyn Transport + Send>>;

struct Server {
    socket: PathBuf,
    /// Where programs with the token connect.
    address: String,
    end: Instant,
    _alone: MutexGuard<'static, ()>,
}

impl Server {
    /// One with a simulated gateway.
    fn start(name: &str) -> Self {
        let alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let directory = std::env::temp_dir().join(format!("mgw-{}-{name}", std::process::id()));
        fs::create_dir_all(&directory).unwrap();
        let socket = directory.join("mgw.sock");
        let cable = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", cable.local_addr().unwrap());
        thread::spawn(move || {
            let world = World::new(Wiring::four_motors());
            let (_lines, faults) = std::sync::mpsc::channel();
            mgw_sim::serve(cable, world, &faults, None, |_: &str| {})
        });
        let listener = UnixListener::bind(&socket).unwrap();
        let with_token = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = with_token.local_addr().unwrap().to_string();
        thread::spawn(move || {
            let open = move || open_halves(&port).map_err(|error| error.to_string());
            let with_token = Listener::Tcp(with_token, Some(TOKEN.to_string()));
            serve(vec![Listener::Unix(listener), with_token], open, |_: &str| {}, None)
        });
        let server = Self { socket, address, end: Instant::now() + PATIENCE, _alone: alone };
        server.until(|| server.program()?.ping());
        server
    }

    fn program(&self) -> Result<Program, ClientError> {
        Client::connect(open(&format!("unix:{}", self.socket.display())).unwrap())
    }

    /// Tries it until it succeeds.
    fn until<T>(&self, mut attempt: impl FnMut() -> Result<T, ClientError>) -> T {
        loop {
            match attempt() {
                Ok(done) => return done,
                Err(error) => assert!(Instant::now() < self.end, "{error}"),
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(self.socket.parent().unwrap());
    }
}

fn descriptors() -> usize {
    fs::read_dir("/proc/self/fd").unwrap().count()
}

#[test]
fn connections_that_come_and_go_keep_no_stop_from_the_cable() {
    let server = Server::start("come-and-go");
    let mut connected = server.program().unwrap();
    let (ends, count) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
    let mut comers = Vec::new();
    for _ in 0..2 {
        let (ends, count, socket) = (ends.clone(), count.clone(), server.socket.clone());
        comers.push(thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                if UnixStream::connect(&socket).is_ok() {
                    count.fetch_add(1, Ordering::Relaxed);
                }
            }
        }));
    }
    let mut most = 0;
    while count.load(Ordering::Relaxed) < 20_000 {
        assert!(Instant::now() < server.end, "connections are taken");
        most = most.max(descriptors());
        server.until(|| connected.stop(StopTarget::All));
        // One that connects only now, too.
        server.until(|| server.program()?.stop(StopTarget::All));
    }
    ends.store(true, Ordering::Relaxed);
    comers.into_iter().for_each(|one| one.join().unwrap());
    assert!(most < DESCRIPTORS, "{most} descriptors");
}

#[test]
fn connections_that_say_nothing_take_no_place_of_a_program() {
    let server = Server::start("silent");
    let mut watcher = server.program().unwrap();
    watcher.ping().unwrap();
    let connect = |_| UnixStream::connect(&server.socket).unwrap();
    let silent: Vec<UnixStream> = (0..3 * PROGRAMS).map(connect).collect();
    // One that comes behind them is served, so they have been taken.
    server.until(|| server.program()?.ping());
    watcher.ping().expect("it keeps its place");
    drop(silent);
}

/// Each round of them would have its program wait for the 2 s that a token may take.
#[test]
fn connections_without_the_token_keep_out_nobody_who_has_it() {
    let server = Server::start("token");
    let end = Instant::now() + Duration::from_secs(25);
    for round in 0..15 {
        let mut silent = Vec::new();
        for _ in 0..4 {
            // No more at once than the system holds for the server.
            let connect = |_| TcpStream::connect(&server.address).unwrap();
            silent.extend((0..PROGRAMS / 2).map(connect));
            server.until(|| server.program()?.ping());
        }
        server.until(|| {
            let shown = TcpTransport::connect_showing(&server.address, Some(TOKEN.into()));
            Client::connect(shown.unwrap())?.ping()
        });
        assert!(Instant::now() < end, "only {round} programs have come in");
        drop(silent);
    }
}

/// All of them come at once, and none is ended before it is read.
#[test]
fn many_programs_show_the_token_at_once() {
    let server = Server::start("many");
    let connect = |_| TcpTransport::connect_showing(&server.address, Some(TOKEN.into())).unwrap();
    let connected: Vec<TcpTransport> = (0..64).map(connect).collect();
    for transport in connected {
        Client::connect(transport).unwrap().ping().unwrap();
    }
}

#[test]
fn one_program_more_takes_the_place_of_the_one_silent_for_longest() {
    let server = Server::start("one-more");
    let mut programs: Vec<Program> = (0..PROGRAMS).map(|_| server.program().unwrap()).collect();
    programs[0].ping().unwrap();
    let mut one_more = server.program().unwrap();
    one_more.ping().unwrap();
    programs[0].ping().expect("it has just been heard");
    programs[2].ping().expect("another one has been silent for longer");
    programs[1].ping().expect_err("it has lost its place");
}

/// A cable that is read for ever, in vain, and can be written so often.
struct Stuck {
    writes: u32,
    open: Arc<AtomicU32>,
}

impl Stuck {
    fn new(writes: u32, open: &Arc<AtomicU32>) -> Self {
        open.fetch_add(1, Ordering::SeqCst);
        Self { writes, open: open.clone() }
    }
}

impl Read for Stuck {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        thread::sleep(Duration::from_millis(1));
        Err(io::ErrorKind::TimedOut.into())
    }
}

impl Write for Stuck {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writes = self.writes.checked_sub(1).ok_or(io::ErrorKind::TimedOut)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Stuck {
    fn drop(&mut self) {
        self.open.fetch_sub(1, Ordering::SeqCst);
    }
}

/// The halves of one device: it can be opened again when both are gone.
#[test]
fn a_cable_that_takes_nothing_any_more_is_let_go_and_opened_again() {
    let (open, opened) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicU32::new(0)));
    let count = opened.clone();
    thread::spawn(move || {
        let open_one = move || {
            if open.load(Ordering::SeqCst) > 0 {
                return Err("it is in use".to_owned());
            }
            count.fetch_add(1, Ordering::SeqCst);
            let half = |writes| Stuck::new(writes, &open);
            Ok(Halves { reader: Box::new(half(0)), writer: Box::new(half(1)) })
        };
        serve(Vec::new(), open_one, |_: &str| {}, None);
    });
    let end = Instant::now() + PATIENCE;
    while opened.load(Ordering::SeqCst) < 3 {
        assert!(Instant::now() < end, "it is opened again");
        thread::sleep(Duration::from_millis(1));
    }
}
