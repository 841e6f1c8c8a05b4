//! A simulated gateway that is served over TCP, in real time.

mod connection;
mod faults;
mod flight_file;
mod requests;
mod waiting;

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

pub use self::faults::apply as put_fault;
pub use self::flight_file::FlightFile;

use self::connection::Connection;
use self::waiting::{PATIENCE, PLACES, Verdict, Waiting};
use crate::world::World;

/// Longest pause between two looks at the connections.
const TURN: Duration = Duration::from_micros(500);
/// Simulated time computed at once; after a pause of the machine the world catches up in such
/// steps.
const CATCH_UP: Duration = Duration::from_millis(20);

/// Bytes on their way to the gateway above which a client has to wait, as it would for a serial
/// port.
const BACKLOG: usize = 4_096;

/// Serves a world until the process ends: the wall clock drives its time, every connection gets a
/// host link, and keeps it if it says Hello within 1 s. Where all links are taken, a connection
/// whose first request is a stop gets the link of the client that has not stopped or commanded
/// anything for longest; the others are refused.
///
/// What led to a trip goes to the file `flight_recorder`, see [`flight_recorder::Recording`].
///
/// Each line of the motors' logs, and each coming and going of a client, goes to `log`. Each of
/// `lines` is a fault that somebody types; `help` lists them.
///
/// # Errors
/// When the listener fails.
pub fn serve(
    listener: TcpListener,
    world: World,
    lines: &Receiver<String>,
    mut flight_recorder: Option<FlightFile>,
    mut log: impl FnMut(&str),
) -> io::Result<()> {
    let mut server = Server::new(listener, world)?;
    let start = Instant::now();
    loop {
        server.turn(start.elapsed(), &mut log)?;
        if let Some(file) = &mut flight_recorder {
            file.look_at(server.world(), &mut log);
        }
        lines.try_iter().for_each(|line| server.put_fault(&line, &mut log));
        thread::sleep(TURN);
    }
}

/// What [`serve()`] repeats, for callers who want to stop: one turn at a time.
pub struct Server {
    listener: TcpListener,
    world: World,
    /// Time of the world when the server began.
    start: Duration,
    connections: Vec<Connection>,
    /// Clients that came when all links were taken.
    waiting: Vec<Waiting>,
    /// Time since the start.
    elapsed: Duration,
    /// Lines of each motor's log that have been printed.
    printed: Vec<usize>,
}

impl Server {
    /// A server for this world. What the motors have logged before is not printed.
    ///
    /// # Errors
    /// When the listener cannot be switched to non-blocking.
    pub fn new(listener: TcpListener, mut world: World) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        world.trace();
        let start = Duration::from_micros(world.now().as_micros());
        let printed = world.motors().iter().map(|motor| motor.log().since(usize::MAX).1).collect();
        let (connections, waiting) = (Vec::new(), Vec::new());
        Ok(Self { listener, world, start, connections, waiting, elapsed: Duration::ZERO, printed })
    }

    /// Brings the world to `elapsed` after the start and passes bytes on, without waiting for
    /// anything.
    ///
    /// # Errors
    /// When the listener fails.
    pub fn turn(&mut self, elapsed: Duration, log: &mut impl FnMut(&str)) -> io::Result<()> {
        self.elapsed = elapsed;
        let until = self.start + elapsed;
        loop {
            let now = Duration::from_micros(self.world.now().as_micros());
            // The world is brought to the present before it is given what has arrived by now.
            self.world.run_for(until.saturating_sub(now).min(CATCH_UP));
            self.read(log);
            self.write(log);
            self.print_motor_logs(log);
            if now + CATCH_UP >= until {
                break;
            }
        }
        // After reading, so that a host that has gone has released its link.
        self.drop_silent(log);
        self.accept(log)?;
        self.hear_waiting(log);
        // Nobody asks a served world for it.
        self.world.trace();
        Ok(())
    }

    /// Puts the fault of a line into the world, or says which there are.
    pub fn put_fault(&mut self, line: &str, log: &mut impl FnMut(&str)) {
        let seconds = Duration::from_micros(self.world.now().as_micros()).as_secs_f64();
        match faults::apply(&mut self.world, line) {
            Ok(fault) => log(&format!("t={seconds:.6} s  {fault}")),
            Err(wrong) => wrong.lines().for_each(log),
        }
    }

    /// The world being served.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    fn accept(&mut self, log: &mut impl FnMut(&str)) -> io::Result<()> {
        loop {
            match self.listener.accept() {
                Ok((stream, peer)) => self.connect(stream, peer, log),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                // The client has gone again, or the process has no descriptor left for now.
                Err(error) if is_of_one_client(&error) => {
                    log(&format!("a client could not connect: {error}"))
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn connect(&mut self, stream: TcpStream, peer: SocketAddr, log: &mut impl FnMut(&str)) {
        let Some(link) = self.free_link().or_else(|| {
            // A host that went just before this one came has not been missed yet.
            self.read(log);
            self.free_link()
        }) else {
            return self.let_wait(stream, peer, log);
        };
        match Connection::new(stream, peer, link, self.elapsed) {
            Ok(connection) => {
                self.world.host_reset(link);
                self.connections.push(connection);
                log(&format!("{peer} connected to host link {link}"));
            }
            Err(error) => log(&format!("{peer} could not connect: {error}")),
        }
    }

    /// It may still want to stop something.
    fn let_wait(&mut self, stream: TcpStream, peer: SocketAddr, log: &mut impl FnMut(&str)) {
        if self.waiting.len() >= PLACES {
            return self.refused(peer, log);
        }
        match Waiting::new(stream, peer, self.elapsed) {
            Ok(waiting) => self.waiting.push(waiting),
            Err(error) => log(&format!("{peer} could not connect: {error}")),
        }
    }

    fn refused(&self, peer: SocketAddr, log: &mut impl FnMut(&str)) {
        log(&format!("{peer} refused: all {} host links are taken", self.world.host_links()));
    }

    fn hear_waiting(&mut self, log: &mut impl FnMut(&str)) {
        for mut waiting in std::mem::take(&mut self.waiting) {
            match waiting.listen(self.elapsed) {
                Verdict::Waits => self.waiting.push(waiting),
                Verdict::Refused => self.refused(waiting.peer(), log),
                Verdict::Stops => self.make_room(waiting, log),
            }
        }
    }

    /// Gives a client that stops something the link of the one that has acted least lately.
    fn make_room(&mut self, waiting: Waiting, log: &mut impl FnMut(&str)) {
        let link = self.free_link().or_else(|| {
            let merit = |one: &Connection| (one.requests.greeted, one.requests.acted, one.since);
            let places = self.connections.iter().enumerate();
            let (place, _) = places.min_by_key(|(_, one)| merit(one))?;
            let Connection { peer, link, .. } = self.connections.swap_remove(place);
            log(&format!("{peer} has lost host link {link}: {} stops something", waiting.peer()));
            Some(link)
        });
        let Some(link) = link else { return };
        let (connection, said) = waiting.on_link(link);
        self.world.host_reset(link);
        self.world.host_send(link, &said);
        log(&format!("{} connected to host link {link}", connection.peer));
        self.connections.push(connection);
    }

    /// A link is for who says Hello.
    fn drop_silent(&mut self, log: &mut impl FnMut(&str)) {
        let now = self.elapsed;
        self.connections.retain(|connection| {
            let Connection { peer, link, since, requests, .. } = connection;
            let stays = requests.greeted || now < *since + PATIENCE;
            if !stays {
                log(&format!("{peer} has lost host link {link}: it has not said Hello"));
            }
            stays
        });
    }

    fn free_link(&self) -> Option<u8> {
        let taken = |link: &u8| self.connections.iter().any(|connection| connection.link == *link);
        (0..self.world.host_links()).find(|link| !taken(link))
    }

    fn read(&mut self, log: &mut impl FnMut(&str)) {
        let Self { connections, world, elapsed, .. } = self;
        connections.retain_mut(|connection| {
            if world.host_backlog(connection.link) > BACKLOG {
                return true;
            }
            match connection.read() {
                Ok(bytes) => {
                    connection.requests.take(*elapsed, &bytes);
                    world.host_send(connection.link, &bytes);
                    true
                }
                Err(error) => {
                    log(&gone(connection, &error));
                    false
                }
            }
        });
    }

    fn write(&mut self, log: &mut impl FnMut(&str)) {
        let Self { connections, world, .. } = self;
        connections.retain_mut(|connection| {
            match connection.write(&world.host_receive(connection.link)) {
                Ok(lost) => {
                    if lost && !connection.overflowed {
                        log(&format!("{} does not read: what it is sent is lost", connection.peer));
                    }
                    connection.overflowed = lost;
                    true
                }
                Err(error) => {
                    log(&gone(connection, &error));
                    false
                }
            }
        });
    }

    fn print_motor_logs(&mut self, log: &mut impl FnMut(&str)) {
        let mut lines = Vec::new();
        for (motor, printed) in self.world.motors().iter().zip(&mut self.printed) {
            let (new, total) = motor.log().since(*printed);
            *printed = total;
            lines.extend(new.map(|entry| {
                (entry.time_us, format!("bus {}  {motor}  {}", motor.bus(), entry.what))
            }));
        }
        lines.sort_by_key(|(time_us, _)| *time_us);
        for (time_us, line) in lines {
            log(&format!("t={}.{:06} s  {line}", time_us / 1_000_000, time_us % 1_000_000));
        }
    }
}

fn gone(connection: &Connection, error: &io::Error) -> String {
    let Connection { peer, link, .. } = connection;
    match error.kind() {
        io::ErrorKind::ConnectionAborted => format!("{peer} has left host link {link}"),
        _ => format!("{peer} has lost host link {link}: {error}"),
    }
}

fn is_of_one_client(error: &io::Error) -> bool {
    use io::ErrorKind::{ConnectionAborted, ConnectionReset, Interrupted};
    matches!(error.kind(), ConnectionAborted | ConnectionReset | Interrupted)
}
