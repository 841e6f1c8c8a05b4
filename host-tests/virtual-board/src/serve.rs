//! The host UARTs as TCP sockets, in real time.

mod connection;

use std::io::{self, ErrorKind};
use std::net::TcpListener;
use std::thread;
use std::time::{Duration, Instant};

use self::connection::Connection;
use crate::host_uart::HostUart;
use crate::machine::{Line, Machine};
use crate::outside::Outside;

/// Pause between two looks at the sockets.
const TURN: Duration = Duration::from_micros(500);
/// Virtual time run at once.
const STEP: Duration = Duration::from_millis(2);
/// A board that has fallen behind by more gives up on the rest: its time is then late for good. A
/// leap of its time would let setpoints expire that their host has just renewed.
const LAG: Duration = Duration::from_millis(10);
/// How often, in virtual time, the board's records that nobody reads here are thrown away.
const RECORDS_KEPT: Duration = Duration::from_secs(1);
/// A second of the board that lost more than this is worth a line: hosts notice it.
const WORTH_A_LINE: Duration = Duration::from_millis(100);
/// Bytes on their way to the board above which a client has to wait, as it would for a serial port.
const BACKLOG: usize = 4_096;

/// Serves a board until a listener fails: the wall clock drives its time, and whoever connects to a
/// listener holds the computer's end of that host UART.
///
/// `listeners`: of host links 0 and 1. Each line of the motors' logs, and each coming and going of
/// a client, goes to `log`.
/// Fails when a listener fails.
pub fn serve(
    listeners: [TcpListener; 2],
    machine: Machine,
    outside: Outside,
    mut log: impl FnMut(&str),
) -> io::Result<()> {
    let mut server = Server::new(listeners, machine, outside)?;
    let start = Instant::now();
    loop {
        server.turn(start.elapsed(), &mut log)?;
        thread::sleep(TURN);
    }
}

/// One host UART and who holds it.
struct Socket {
    number: usize,
    listener: TcpListener,
    line: Line<HostUart>,
    connection: Option<Connection>,
}

/// What [`serve()`] repeats, for callers who want to stop: one turn at a time.
pub struct Server {
    machine: Machine,
    outside: Outside,
    sockets: Vec<Socket>,
    /// Virtual time at which the caller's clock was 0.
    start: Duration,
    /// Time that the board could not make up for.
    lost: Duration,
    /// What of it had been lost when the records were thrown away last.
    lost_before: Duration,
    /// When the records were thrown away last.
    tidied: Duration,
    /// Lines of each motor's log that have been printed.
    printed: Vec<usize>,
}

impl Server {
    /// A server for this board.
    /// Fails when a listener cannot be switched to non-blocking.
    pub fn new(
        listeners: [TcpListener; 2],
        machine: Machine,
        outside: Outside,
    ) -> io::Result<Self> {
        let mut sockets = Vec::new();
        for (number, (listener, line)) in listeners.into_iter().zip(outside.hosts).enumerate() {
            listener.set_nonblocking(true)?;
            sockets.push(Socket { number, listener, line, connection: None });
        }
        let (start, printed) = (machine.now(), vec![0; outside.motors()]);
        Ok(Self {
            machine,
            outside,
            sockets,
            start,
            lost: Duration::ZERO,
            lost_before: Duration::ZERO,
            tidied: start,
            printed,
        })
    }

    /// Brings the board to `elapsed` after the start and passes bytes on, without waiting for
    /// anything.
    /// Fails when a listener fails.
    pub fn turn(&mut self, elapsed: Duration, log: &mut impl FnMut(&str)) -> io::Result<()> {
        self.lost += self.behind(elapsed).saturating_sub(LAG);
        loop {
            let behind = self.behind(elapsed);
            self.machine.run_for(behind.min(STEP));
            for socket in &mut self.sockets {
                socket.pass_on(&mut self.machine, log);
            }
            if behind <= STEP {
                break;
            }
        }
        // After reading, so that whoever has left has given its line back.
        for socket in &mut self.sockets {
            socket.accept(&mut self.machine, log)?;
        }
        self.print_motor_logs(log);
        if self.machine.now() >= self.tidied + RECORDS_KEPT {
            self.tidied = self.machine.now();
            self.tidy();
            self.tell_losses(log);
        }
        Ok(())
    }

    /// The board being served.
    pub fn machine(&mut self) -> &mut Machine {
        &mut self.machine
    }

    /// Virtual time that the board has yet to run.
    fn behind(&self, elapsed: Duration) -> Duration {
        (self.start + elapsed).saturating_sub(self.lost).saturating_sub(self.machine.now())
    }

    fn tidy(&mut self) {
        for port in self.machine.board().can_ports {
            self.machine.can_mut(*port).take_log();
        }
        self.machine.line(self.outside.rs485).clear_sent();
        self.machine.take_rtt();
    }

    fn tell_losses(&mut self, log: &mut impl FnMut(&str)) {
        let lost = self.lost - self.lost_before;
        self.lost_before = self.lost;
        if lost > WORTH_A_LINE {
            let ms = lost.as_millis();
            log(&format!(
                "this computer was {ms} ms too slow for one second of the board: \
                 setpoints may expire"
            ));
        }
    }

    fn print_motor_logs(&mut self, log: &mut impl FnMut(&str)) {
        let mut lines = Vec::new();
        for (index, printed) in self.printed.iter_mut().enumerate() {
            let bus = self.outside.bus(index);
            let motor = self.outside.motor(&mut self.machine, index);
            let (new, total) = motor.log().since(*printed);
            *printed = total;
            lines.extend(
                new.map(|entry| (entry.time_us, format!("bus {bus}  {motor}  {}", entry.what))),
            );
        }
        lines.sort_by_key(|(time_us, _)| *time_us);
        for (time_us, line) in lines {
            log(&format!("t={}.{:06} s  {line}", time_us / 1_000_000, time_us % 1_000_000));
        }
    }
}

impl Socket {
    fn pass_on(&mut self, machine: &mut Machine, log: &mut impl FnMut(&str)) {
        let received = machine.line(self.line).take();
        let Some(connection) = &mut self.connection else { return };
        let mut exchange = || -> io::Result<()> {
            if machine.line(self.line).unsent() <= BACKLOG {
                let bytes = connection.read()?;
                machine.line(self.line).send(&bytes);
            }
            connection.write(&received)
        };
        if let Err(error) = exchange() {
            let left = error.kind() == ErrorKind::ConnectionAborted;
            let why = if left { "has left".to_owned() } else { format!("was lost ({error})") };
            log(&format!("{} {why}: host link {} is free", connection.peer, self.number));
            self.connection = None;
            machine.line(self.line).clear();
        }
    }

    fn accept(&mut self, machine: &mut Machine, log: &mut impl FnMut(&str)) -> io::Result<()> {
        loop {
            let (stream, peer) = match self.listener.accept() {
                Ok(accepted) => accepted,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                // The client has gone again.
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::ConnectionAborted
                            | ErrorKind::ConnectionReset
                            | ErrorKind::Interrupted
                    ) =>
                {
                    continue;
                }
                Err(error) => return Err(error),
            };
            if self.connection.is_some() {
                log(&format!("{peer} refused: host link {} is in use", self.number));
                continue;
            }
            match Connection::new(stream, peer) {
                Ok(connection) => {
                    machine.line(self.line).clear();
                    self.connection = Some(connection);
                    log(&format!("{peer} connected to host link {}", self.number));
                }
                Err(error) => log(&format!("{peer} could not connect: {error}")),
            }
        }
    }
}

#[cfg(test)]
mod tests;
