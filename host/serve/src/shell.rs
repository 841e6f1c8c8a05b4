//! Sockets, threads and the clock around a [`Multiplexer`].
//!
//! One thread owns it and waits in one place, for whatever comes next. Each connection has a thread
//! that reads and one that writes, the cable one that reads.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
#[cfg(unix)]
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::Halves;
use subtle::ConstantTimeEq;

use crate::multiplexer::{Multiplexer, News, ProgramId};
use crate::seen::Seen;

/// Longest time between two looks at the clock.
const TICK: Duration = Duration::from_millis(5);
/// Between two attempts to open the cable.
const OPEN_EVERY: Duration = Duration::from_millis(200);
/// Bytes of a program taken at once: the others have their turn behind them.
const READ: usize = 512;
/// Frames on their way into a connection; the others wait, and events are dropped.
const WRITES: usize = 4;
/// Programs at a time. One more takes the place of the one that has been silent for longest, so
/// that there always is one for a stop.
const PROGRAMS: usize = 128;
/// Connections at a time that have not shown their token: they take the place of nobody who has.
const UNPROVED: usize = 16;
/// A connection that is over and does not read is closed after this time.
const CLOSED_WITHIN: Duration = Duration::from_secs(1);
/// How long a connection may take to show its token.
const TOKEN_WITHIN: Duration = Duration::from_secs(2);
/// What the token stands behind.
const TOKEN: &[u8] = b"token=";
/// Longest token with what it stands behind.
const LONGEST_TOKEN: usize = 256;

/// Where programs connect.
pub enum Listener {
    /// On TCP; with a token, which each program has to show.
    Tcp(TcpListener, Option<String>),
    /// On a Unix socket.
    #[cfg(unix)]
    Unix(UnixListener),
}

/// The connection of a program.
enum Stream {
    Tcp(TcpStream),
    #[cfg(unix)]
    Unix(UnixStream),
}

impl Stream {
    fn again(&self) -> io::Result<Self> {
        match self {
            Self::Tcp(stream) => stream.try_clone().map(Self::Tcp),
            #[cfg(unix)]
            Self::Unix(stream) => stream.try_clone().map(Self::Unix),
        }
    }

    fn end(&self) {
        let _ = match self {
            Self::Tcp(stream) => stream.shutdown(Shutdown::Both),
            #[cfg(unix)]
            Self::Unix(stream) => stream.shutdown(Shutdown::Both),
        };
    }

    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Tcp(stream) => stream.read(bytes),
            #[cfg(unix)]
            Self::Unix(stream) => stream.read(bytes),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.write_all(bytes),
            #[cfg(unix)]
            Self::Unix(stream) => stream.write_all(bytes),
        }
    }
}

/// What the threads tell.
enum Event {
    /// A program has connected: its connection, whether it may use the gateway, and where its
    /// reader learns that it may read on.
    Connected(Stream, bool, SyncSender<ProgramId>),
    /// Bytes of a program; nothing: it has gone.
    Program(ProgramId, Vec<u8>),
    /// A frame is in the connection.
    Written(ProgramId),
    /// The cable was opened, or could not be.
    Opened(Result<Halves, String>),
    /// Bytes of the cable of this turn; nothing: it is gone.
    Cable(u64, Vec<u8>),
}

/// A program's connection, as the one thread knows it.
struct Connection {
    stream: Stream,
    go: SyncSender<ProgramId>,
    frames: Sender<Vec<u8>>,
    writing: usize,
    heard_at: Duration,
    /// It has shown the token, or needs none.
    proved: bool,
    /// Since when it is to be closed.
    over_since: Option<Duration>,
}

/// Is given every frame of the cable at once; it must not wait for anything.
pub type Tap = Box<dyn FnMut(Seen)>;

struct Shell<O, L> {
    multiplexer: Multiplexer,
    connections: BTreeMap<ProgramId, Connection>,
    sender: Sender<Event>,
    open: O,
    log: L,
    start: Instant,
    cable: Option<Box<dyn Write + Send>>,
    /// Which cable it is.
    turn: u64,
    opening: bool,
    try_at: Duration,
    /// Why the cable could not be opened, as it was told.
    told: Option<String>,
    tap: Option<Tap>,
}

/// Serves until the process ends. `open` opens the cable, again and again whenever there is none;
/// what happens goes to `log`, and a copy of what crosses the cable to `tap`.
///
/// # Errors
/// When a listener fails.
pub fn serve<O, L>(listeners: Vec<Listener>, open: O, log: L, tap: Option<Tap>) -> io::Result<()>
where
    O: Fn() -> Result<Halves, String> + Clone + Send + 'static,
    L: FnMut(&str),
{
    let (sender, events) = channel();
    for listener in listeners {
        let sender = sender.clone();
        thread::spawn(move || accept(&listener, &sender));
    }
    let mut multiplexer = Multiplexer::new(fastrand::u16(..));
    if tap.is_some() {
        multiplexer.copy_frames();
    }
    let mut shell = Shell {
        multiplexer,
        connections: BTreeMap::new(),
        sender,
        open,
        log,
        start: Instant::now(),
        cable: None,
        turn: 0,
        opening: false,
        try_at: Duration::ZERO,
        told: None,
        tap,
    };
    shell.run(&events);
    Ok(())
}

impl<O, L> Shell<O, L>
where
    O: Fn() -> Result<Halves, String> + Clone + Send + 'static,
    L: FnMut(&str),
{
    fn run(&mut self, events: &Receiver<Event>) {
        loop {
            match events.recv_timeout(TICK) {
                Ok(event) => {
                    self.take(event);
                    // What has come meanwhile, before anything is sent: a stop among it goes first.
                    while let Ok(event) = events.try_recv() {
                        self.take(event);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let now = self.start.elapsed();
            self.multiplexer.tick(now);
            self.open_cable(now);
            self.write_cable();
            self.write_programs();
            self.tell_news();
        }
    }

    fn take(&mut self, event: Event) {
        let now = self.start.elapsed();
        match event {
            Event::Connected(stream, proved, go) => self.connect(now, stream, proved, go),
            Event::Program(id, bytes) if bytes.is_empty() => self.disconnect(id),
            Event::Program(id, bytes) => {
                self.multiplexer.program_bytes(now, id, &bytes);
                if let Some(connection) = self.connections.get_mut(&id) {
                    connection.heard_at = now;
                    let _ = connection.go.send(id);
                }
            }
            Event::Written(id) => {
                if let Some(connection) = self.connections.get_mut(&id) {
                    connection.writing = connection.writing.saturating_sub(1);
                }
            }
            Event::Opened(Ok(cable)) => self.plug_in(now, cable),
            Event::Opened(Err(error)) => {
                self.opening = false;
                if self.told.as_ref() != Some(&error) {
                    (self.log)(&format!("no gateway: {error}"));
                    self.told = Some(error);
                }
            }
            Event::Cable(turn, _) if turn != self.turn || self.cable.is_none() => {}
            Event::Cable(_, bytes) if bytes.is_empty() => self.unplug(now),
            Event::Cable(_, bytes) => {
                self.multiplexer.cable_bytes(now, &bytes);
                self.pass_copies();
            }
        }
    }

    fn pass_copies(&mut self) {
        if let Some(tap) = &mut self.tap {
            self.multiplexer.take_seen().into_iter().for_each(tap);
        }
    }

    fn connect(&mut self, now: Duration, stream: Stream, proved: bool, go: SyncSender<ProgramId>) {
        let unproved = self.connections.values().filter(|one| !one.proved).count();
        let is_full = self.connections.len() >= PROGRAMS;
        if !proved && (is_full || unproved >= UNPROVED) {
            return stream.end();
        }
        if is_full {
            let commands = self.multiplexer.in_command();
            let watching = self.connections.iter().filter(|(id, _)| Some(**id) != commands);
            let quietest = watching.min_by_key(|(_, one)| (one.proved, one.heard_at));
            let quietest = quietest.map(|(id, _)| *id);
            if let Some(id) = quietest {
                (self.log)(&format!("program {id} has lost its place to another one"));
                self.disconnect(id);
            }
        }
        let Ok(mut writer) = stream.again() else { return };
        let id = self.multiplexer.program_opened(now, proved);
        let (frames, to_write) = channel::<Vec<u8>>();
        let sender = self.sender.clone();
        thread::spawn(move || {
            while let Ok(frame) = to_write.recv() {
                let failed = writer.write(&frame).is_err();
                if sender.send(Event::Written(id)).is_err() || failed {
                    return;
                }
            }
            writer.end();
        });
        let _ = go.send(id);
        let (writing, over_since) = (0, None);
        let connection =
            Connection { stream, go, frames, writing, heard_at: now, proved, over_since };
        self.connections.insert(id, connection);
    }

    fn disconnect(&mut self, id: ProgramId) {
        if let Some(connection) = self.connections.remove(&id) {
            if self.multiplexer.in_command() == Some(id) {
                (self.log)("the program in command has gone: whatever it had armed stops");
            }
            connection.stream.end();
            self.multiplexer.program_closed(id);
        }
    }

    fn open_cable(&mut self, now: Duration) {
        if self.cable.is_some() || self.opening || now < self.try_at {
            return;
        }
        (self.opening, self.try_at) = (true, now + OPEN_EVERY);
        let (open, sender) = (self.open.clone(), self.sender.clone());
        thread::spawn(move || sender.send(Event::Opened(open())));
    }

    fn plug_in(&mut self, now: Duration, cable: Halves) {
        let Halves { mut reader, writer } = cable;
        self.turn += 1;
        (self.opening, self.cable, self.told) = (false, Some(writer), None);
        self.multiplexer.cable_opened(now);
        let (turn, sender) = (self.turn, self.sender.clone());
        thread::spawn(move || {
            let mut bytes = [0; 4_096];
            loop {
                let read = match reader.read(&mut bytes) {
                    Ok(count) => bytes.get(..count).unwrap_or_default().to_vec(),
                    Err(error) if nothing_came(&error) => continue,
                    Err(_) => Vec::new(),
                };
                let is_gone = read.is_empty();
                if sender.send(Event::Cable(turn, read)).is_err() || is_gone {
                    return;
                }
            }
        });
    }

    fn unplug(&mut self, now: Duration) {
        self.cable = None;
        self.try_at = now + OPEN_EVERY;
        self.multiplexer.cable_closed(now);
    }

    fn write_cable(&mut self) {
        while let Some(cable) = &mut self.cable
            && let Some(frame) = self.multiplexer.poll_cable(self.start.elapsed())
        {
            if cable.write_all(&frame).and_then(|()| cable.flush()).is_err() {
                self.unplug(self.start.elapsed());
            }
            self.pass_copies();
        }
    }

    fn write_programs(&mut self) {
        let now = self.start.elapsed();
        let mut over = Vec::new();
        for (id, connection) in &mut self.connections {
            while connection.writing < WRITES
                && let Some(frame) = self.multiplexer.poll_program(*id)
            {
                connection.writing += 1;
                let _ = connection.frames.send(frame);
            }
            if self.multiplexer.is_over(*id) {
                let since = *connection.over_since.get_or_insert(now);
                if connection.writing == 0 || now >= since + CLOSED_WITHIN {
                    over.push(*id);
                }
            }
        }
        over.into_iter().for_each(|id| self.disconnect(id));
    }

    fn tell_news(&mut self) {
        for news in self.multiplexer.take_news() {
            let line = match news {
                News::Found { board, firmware } => format!("gateway: {board}, {firmware}"),
                News::Lost(why) => format!("gateway lost: {why}; its armed axes stop"),
                News::Refused(error) => format!("the gateway refuses: {error}"),
            };
            (self.log)(&line);
        }
    }
}

fn nothing_came(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

fn accept(listener: &Listener, sender: &Sender<Event>) {
    loop {
        let (stream, token) = match listener {
            Listener::Tcp(listener, token) => {
                let stream = listener.accept().and_then(|(stream, _)| {
                    stream.set_nodelay(true)?;
                    Ok(Stream::Tcp(stream))
                });
                (stream, token.clone())
            }
            #[cfg(unix)]
            Listener::Unix(listener) => {
                (listener.accept().map(|(stream, _)| Stream::Unix(stream)), None)
            }
        };
        let Ok(stream) = stream else {
            // The program has gone again, or there are no descriptors left for now.
            thread::sleep(TICK);
            continue;
        };
        let sender = sender.clone();
        thread::spawn(move || read_program(stream, token.as_deref(), &sender));
    }
}

/// Passes a program's bytes on, one piece at a time: who floods waits for the others.
fn read_program(mut stream: Stream, token: Option<&str>, sender: &Sender<Event>) {
    let proved = token.is_none_or(|token| shows(&mut stream, token));
    let (go, may_read) = sync_channel(1);
    let Ok(ours) = stream.again() else { return };
    if sender.send(Event::Connected(ours, proved, go)).is_err() {
        return;
    }
    let Ok(id) = may_read.recv() else { return };
    let mut is_first = true;
    loop {
        let mut bytes = [0; READ];
        let read = match stream.read(&mut bytes) {
            Ok(_) if is_first && begins_as_http(&bytes) => Vec::new(),
            Ok(count) => bytes.get(..count).unwrap_or_default().to_vec(),
            Err(error) if nothing_came(&error) => continue,
            Err(_) => Vec::new(),
        };
        is_first = false;
        let has_gone = read.is_empty();
        if sender.send(Event::Program(id, read)).is_err() || has_gone || may_read.recv().is_err() {
            return;
        }
    }
}

/// Whether the first bytes of a connection are a browser's: any page can have it post bytes to this
/// computer. A frame begins with 0x00, and the token with a small letter.
fn begins_as_http(bytes: &[u8]) -> bool {
    bytes.first().is_some_and(u8::is_ascii_uppercase)
}

/// Whether a connection begins with the token.
fn shows(stream: &mut Stream, token: &str) -> bool {
    let timeout = |stream: &Stream, time| match stream {
        Stream::Tcp(stream) => stream.set_read_timeout(time),
        #[cfg(unix)]
        Stream::Unix(stream) => stream.set_read_timeout(time),
    };
    let _ = timeout(stream, Some(TOKEN_WITHIN));
    let mut shown = Vec::new();
    let mut byte = [0];
    let end = Instant::now() + TOKEN_WITHIN;
    while shown.len() < LONGEST_TOKEN
        && Instant::now() < end
        && matches!(stream.read(&mut byte), Ok(1))
        && byte != [0]
    {
        shown.extend(byte);
    }
    let _ = timeout(stream, None);
    let wanted = [TOKEN, token.as_bytes()].concat();
    bool::from(shown.as_slice().ct_eq(&wanted))
}
