//! Sockets, threads and the clock around a [`Multiplexer`].
//!
//! One thread owns it and waits in one place, for whatever comes next. Each connection has a thread
//! that reads and one that writes, the cable one that reads.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener};
#[cfg(unix)]
use std::os::unix::net::UnixListener;
use std::sync::Arc;
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel,
};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::Halves;
use socket2::Socket;

use crate::door::accept;
use crate::multiplexer::{Multiplexer, News, ProgramId};
use crate::seen::Seen;

/// Longest time between two looks at the clock.
pub(crate) const TICK: Duration = Duration::from_millis(5);
/// Between two attempts to open the cable.
const OPEN_EVERY: Duration = Duration::from_millis(200);
/// Frames on their way into a connection; the others wait, and events are dropped.
const WRITES: usize = 4;
/// Events taken before what they bring about is sent: they may come as fast as they are taken.
const AT_ONCE: usize = 512;
/// Programs at a time, which have asked something. One more takes the place of the one that has
/// been silent for longest, so that there always is one for a stop.
pub(crate) const PROGRAMS: usize = 128;
/// Connections at a time that have asked nothing yet: one more takes the place of the oldest of
/// them, and none takes that of a program.
pub(crate) const WAITING: usize = 64;
/// Those of them that have not shown their token: they take the place of nobody who has. As many
/// have time to show it.
pub(crate) const UNPROVED: usize = 16;
/// Lines of the log that wait for who reads it; more are counted.
const LINES: usize = 64;
/// A connection that is over and does not read is closed after this time.
const CLOSED_WITHIN: Duration = Duration::from_secs(1);

/// Where programs connect.
pub enum Listener {
    /// On TCP; with a token, which each program has to show.
    Tcp(TcpListener, Option<String>),
    /// On a Unix socket.
    #[cfg(unix)]
    Unix(UnixListener),
}

/// What the threads tell.
pub(crate) enum Event {
    /// A program has connected.
    Connected(Newcomer),
    /// Bytes of a program; nothing: it has gone.
    Program(ProgramId, Vec<u8>),
    /// A frame is in the connection.
    Written(ProgramId),
    /// The cable was opened, or could not be.
    Opened(Result<Halves, String>),
    /// Bytes of the cable of this turn; nothing: it is gone.
    Cable(u64, Vec<u8>),
}

/// A connection that has just been accepted.
pub(crate) struct Newcomer {
    pub stream: Socket,
    /// What it is called where others are told of it.
    pub name: String,
    /// It has shown the token, or needs none.
    pub proved: bool,
    /// What it has said by now.
    pub said: Vec<u8>,
    /// Where its reader learns that it may read on.
    pub go: SyncSender<ProgramId>,
}

/// A program's connection, as the one thread knows it.
struct Connection {
    stream: Socket,
    go: SyncSender<ProgramId>,
    /// To the thread that writes, which begins with the first frame.
    frames: Option<Sender<Vec<u8>>>,
    writing: usize,
    heard_at: Duration,
    /// It has shown the token, or needs none.
    proved: bool,
    /// It has asked something, with the token if it needs one: it is a program that is served.
    asked: bool,
    /// Since when it is to be closed.
    over_since: Option<Duration>,
}

impl Connection {
    /// Has a frame written by the connection's own thread.
    fn write(&mut self, id: ProgramId, frame: Vec<u8>, sender: &Sender<Event>) {
        if self.frames.is_none() {
            // Without descriptors it cannot be served: its reader finds the end.
            let Ok(writer) = self.stream.try_clone() else { return end(&self.stream) };
            let (frames, to_write) = channel();
            let sender = sender.clone();
            thread::spawn(move || write_program(writer, id, &to_write, &sender));
            self.frames = Some(frames);
        }
        if let Some(frames) = &self.frames {
            let _ = frames.send(frame);
        }
    }
}

fn write_program(
    mut writer: Socket,
    id: ProgramId,
    to_write: &Receiver<Vec<u8>>,
    sender: &Sender<Event>,
) {
    while let Ok(frame) = to_write.recv() {
        let failed = writer.write_all(&frame).is_err();
        if sender.send(Event::Written(id)).is_err() || failed {
            return;
        }
    }
    end(&writer);
}

/// Ends a connection, for who reads it here, too.
fn end(stream: &Socket) {
    let _ = stream.shutdown(Shutdown::Both);
}

/// Is given every frame of the cable at once; it must not wait for anything.
pub type Tap = Box<dyn FnMut(Seen)>;

/// The log, which a thread of its own writes: whoever reads it holds up nothing.
struct Log {
    lines: SyncSender<String>,
    lost: usize,
}

impl Log {
    fn new(mut write: impl FnMut(&str) + Send + 'static) -> Self {
        let (lines, to_write) = sync_channel::<String>(LINES);
        thread::spawn(move || to_write.iter().for_each(|line| write(&line)));
        Self { lines, lost: 0 }
    }

    fn tell(&mut self, line: &str) {
        let lost = match self.lost {
            0 => String::new(),
            lost => format!(" ({lost} lines before this one are lost: nobody read them)"),
        };
        match self.lines.try_send(format!("{line}{lost}")) {
            Err(TrySendError::Full(_)) => self.lost += 1,
            Ok(()) | Err(TrySendError::Disconnected(_)) => self.lost = 0,
        }
    }
}

struct Shell<O> {
    multiplexer: Multiplexer,
    connections: BTreeMap<ProgramId, Connection>,
    sender: Sender<Event>,
    open: O,
    log: Log,
    start: Instant,
    cable: Option<Box<dyn Write + Send>>,
    /// Who reads it ends with this: what reads keeps the device open, or a place at the gateway.
    reads: Arc<()>,
    /// Which cable it is.
    turn: u64,
    opening: bool,
    try_at: Duration,
    /// Why the cable could not be opened, as it was told.
    told: Option<String>,
    tap: Option<Tap>,
}

/// Serves until the process ends. `open` opens the cable, again and again whenever there is none;
/// what happens goes to `log`, which may wait, and a copy of what crosses the cable to `tap`.
pub fn serve<O, L>(listeners: Vec<Listener>, open: O, log: L, tap: Option<Tap>)
where
    O: Fn() -> Result<Halves, String> + Clone + Send + 'static,
    L: FnMut(&str) + Send + 'static,
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
        log: Log::new(log),
        start: Instant::now(),
        cable: None,
        reads: Arc::default(),
        turn: 0,
        opening: false,
        try_at: Duration::ZERO,
        told: None,
        tap,
    };
    shell.run(&events);
}

impl<O> Shell<O>
where
    O: Fn() -> Result<Halves, String> + Clone + Send + 'static,
{
    fn run(&mut self, events: &Receiver<Event>) {
        let mut has_written = false;
        loop {
            match events.recv_timeout(if has_written { Duration::ZERO } else { TICK }) {
                Ok(event) => {
                    self.take(event);
                    // What has come meanwhile, before anything is sent: a stop among it goes first.
                    events.try_iter().take(AT_ONCE).for_each(|event| self.take(event));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            let now = self.start.elapsed();
            self.multiplexer.tick(now);
            self.open_cable(now);
            has_written = self.write_cable();
            self.write_programs();
            self.tell_news();
        }
    }

    fn take(&mut self, event: Event) {
        let now = self.start.elapsed();
        match event {
            Event::Connected(newcomer) => self.connect(now, newcomer),
            Event::Program(id, bytes) if bytes.is_empty() => self.disconnect(id),
            Event::Program(id, bytes) => {
                self.hear(now, id, &bytes);
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
                    self.log.tell(&format!("no gateway: {error}"));
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

    fn connect(&mut self, now: Duration, newcomer: Newcomer) {
        let Newcomer { stream, name, proved, said, go } = newcomer;
        let waiting = || self.connections.values().filter(|one| !one.asked);
        let unproved = waiting().filter(|one| !one.proved).count();
        if !proved && (waiting().count() >= WAITING || unproved >= UNPROVED) {
            return end(&stream);
        }
        let id = self.multiplexer.program_opened(now, proved);
        self.multiplexer.name_program(id, name);
        let _ = go.send(id);
        let (frames, writing, asked, over_since) = (None, 0, false, None);
        let connection =
            Connection { stream, go, frames, writing, heard_at: now, proved, asked, over_since };
        self.connections.insert(id, connection);
        self.hear(now, id, &said);
        self.end_oldest_waiting(id);
    }

    fn hear(&mut self, now: Duration, id: ProgramId, bytes: &[u8]) {
        self.multiplexer.program_bytes(now, id, bytes);
        if let Some(connection) = self.connections.get_mut(&id)
            && !connection.asked
            && connection.proved
            && self.multiplexer.has_asked(id)
        {
            connection.asked = true;
            self.end_quietest_program(id);
        }
    }

    /// Makes room for a program that has just asked something.
    fn end_quietest_program(&mut self, newest: ProgramId) {
        let asked = || self.connections.iter().filter(|(_, one)| one.asked);
        if asked().count() <= PROGRAMS {
            return;
        }
        let commands = self.multiplexer.in_command();
        let others = asked().filter(|(id, _)| **id != newest && Some(**id) != commands);
        let quietest = others.min_by_key(|(_, one)| one.heard_at).map(|(id, _)| *id);
        if let Some(id) = quietest {
            let name = self.multiplexer.name_of(id);
            self.log.tell(&format!("{name} has lost its place to another program"));
            self.disconnect(id);
        }
    }

    /// Makes room for a connection that has just come.
    fn end_oldest_waiting(&mut self, newest: ProgramId) {
        let waiting = || self.connections.iter().filter(|(_, one)| !one.asked);
        if waiting().count() <= WAITING {
            return;
        }
        let others = waiting().filter(|(id, _)| **id != newest);
        let oldest = others.min_by_key(|(id, one)| (one.proved, **id)).map(|(id, _)| *id);
        if let Some(id) = oldest {
            self.disconnect(id);
        }
    }

    fn disconnect(&mut self, id: ProgramId) {
        if let Some(connection) = self.connections.remove(&id) {
            if self.multiplexer.in_command() == Some(id) {
                let name = self.multiplexer.name_of(id);
                let line = format!("{name} was in command and has gone: what it had armed stops");
                self.log.tell(&line);
            }
            end(&connection.stream);
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
        self.reads = Arc::default();
        let (turn, sender, is_read) = (self.turn, self.sender.clone(), Arc::downgrade(&self.reads));
        thread::spawn(move || {
            let mut bytes = [0; 4_096];
            loop {
                let read = match reader.read(&mut bytes) {
                    Ok(count) => bytes.get(..count).unwrap_or_default().to_vec(),
                    Err(error) if nothing_came(&error) && is_read.strong_count() > 0 => continue,
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
        (self.cable, self.reads) = (None, Arc::default());
        self.try_at = now + OPEN_EVERY;
        self.multiplexer.cable_closed(now);
    }

    /// Writes one frame, if there is one: a stop that comes meanwhile is the next.
    fn write_cable(&mut self) -> bool {
        let Some(cable) = &mut self.cable else { return false };
        let Some(frame) = self.multiplexer.poll_cable(self.start.elapsed()) else { return false };
        if cable.write_all(&frame).and_then(|()| cable.flush()).is_err() {
            self.unplug(self.start.elapsed());
        }
        self.pass_copies();
        true
    }

    fn write_programs(&mut self) {
        let now = self.start.elapsed();
        let mut over = Vec::new();
        for (id, connection) in &mut self.connections {
            while connection.writing < WRITES
                && let Some(frame) = self.multiplexer.poll_program(*id)
            {
                connection.writing += 1;
                connection.write(*id, frame, &self.sender);
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
            self.log.tell(&line);
        }
    }
}

pub(crate) fn nothing_came(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}
