//! The emulation on a thread of its own, which stands still while the test thinks.
//!
//! The emulator calls its driver at every stop. At the instant to which it was ordered to run, the
//! driver hands the part over to the test's thread and waits for the next order, with which the
//! part comes back.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use rigless::emulator::{self, Driver, Host, Settled, Start, Stop, StopReason};
use rigless::image::Image;
use rigless::session::Session;
use rigless::time::VirtualNanos;

use super::branch::{Fork, Script, fork};
use super::recorder::Recorder;
use super::retention::Retention;
use super::snapshot::Snapshot;
use crate::board::Board;
use virtual_stm32::Chip;
use virtual_stm32::socket::Socket;

/// A board before its first instruction.
pub struct PoweredOff {
    /// The board.
    pub board: Socket,
    /// What it runs, and what else is in its memory.
    pub images: Vec<Image>,
    /// Which image that is, as a snapshot names it.
    pub firmware: [u8; 32],
    /// What is kept of the run.
    pub recorder: Recorder,
}

/// What the test's thread holds while the emulation stands still.
struct Lent {
    part: Box<Chip>,
    stop: Stop,
}

/// Something to do while the emulation stands still.
type Job = Box<dyn FnOnce(&mut Session<Socket>, &mut dyn Host, Stop, &mut Recorder) + Send>;

/// What to do next.
enum Order {
    Do(Job),
    RunTo(VirtualNanos),
    /// Run into the midst of the flash's operation of that number, at most to that instant.
    RunIntoFlashOperation(usize, VirtualNanos),
    /// Let a forked process do that; its number is the answer.
    Branch(Script, Sender<libc::pid_t>),
    End,
}

/// The test's end of the emulation.
pub struct CoreThread {
    orders: Sender<(Box<Chip>, Order)>,
    stops: Receiver<Lent>,
    /// `None` only while the emulation runs, or after it has failed.
    lent: Option<Box<Chip>>,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl CoreThread {
    /// Starts it: from reset, standing before the first instruction, or where the snapshot was
    /// taken.
    pub fn start(powered_off: PoweredOff, from: Option<Snapshot>) -> Self {
        let (orders, orders_out) = channel();
        let (stops_in, stops) = channel();
        let thread = std::thread::Builder::new()
            .name("emulation".to_owned())
            .spawn(move || run(powered_off, from.as_ref(), orders_out, stops_in))
            .expect("a thread for the emulation");
        let stop = Stop { at: VirtualNanos(0), instruction_count: 0, reason: StopReason::Deadline };
        let mut started = Self { orders, stops, lent: None, stop, thread: Some(thread) };
        started.wait();
        started
    }

    /// Where it stands.
    pub fn stop(&self) -> Stop {
        self.stop
    }

    /// The part.
    pub fn part(&self) -> &Chip {
        self.lent.as_ref().expect("the emulation stands still")
    }

    /// The part.
    pub fn part_mut(&mut self) -> &mut Chip {
        self.lent.as_mut().expect("the emulation stands still")
    }

    /// Lets it run to an instant.
    pub fn run_to(&mut self, instant: VirtualNanos) {
        self.send(Order::RunTo(instant));
        self.wait();
    }

    /// Lets it run into the midst of the flash's operation of that number, at most to an instant.
    pub fn run_into_flash_operation(&mut self, number: usize, instant: VirtualNanos) {
        self.send(Order::RunIntoFlashOperation(number, instant));
        self.wait();
    }

    /// Does something on the emulation's side, where its memory and reports are.
    pub fn order<R: Send + 'static>(
        &mut self,
        job: impl FnOnce(&mut Session<Socket>, &mut dyn Host, Stop, &mut Recorder) -> R + Send + 'static,
    ) -> R {
        let (result_in, result) = channel();
        self.send(Order::Do(Box::new(move |session, host, stop, recorder| {
            // The other end waits for it.
            let _ = result_in.send(job(session, host, stop, recorder));
        })));
        self.wait();
        result.recv().expect("the job was done before the emulation stopped again")
    }

    /// Lets a forked process go on from here; its number.
    pub fn branch(&mut self, script: Script) -> libc::pid_t {
        let (number_in, number) = channel();
        self.send(Order::Branch(script, number_in));
        self.wait();
        number.recv().expect("the process was forked before the emulation stood still again")
    }

    fn send(&mut self, order: Order) {
        let part = self.lent.take().expect("the emulation stands still");
        if self.orders.send((part, order)).is_err() {
            self.fail();
        }
    }

    fn wait(&mut self) {
        match self.stops.recv() {
            Ok(Lent { part, stop }) => {
                self.lent = Some(part);
                self.stop = stop;
            }
            Err(_) => self.fail(),
        }
    }

    /// The emulation has ended by itself: with a panic, which goes on here.
    fn fail(&mut self) -> ! {
        match self.thread.take().map(JoinHandle::join) {
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            _ => panic!("the emulation has ended"),
        }
    }
}

impl Drop for CoreThread {
    fn drop(&mut self) {
        let Some(thread) = self.thread.take() else { return };
        if let Some(part) = self.lent.take() {
            // If it has failed in the meantime, there is nothing to end.
            let _ = self.orders.send((part, Order::End));
        }
        // A panic over there has been told, or the test is failing already.
        let _ = thread.join();
    }
}

/// The emulation's thread.
fn run(
    powered_off: PoweredOff,
    from: Option<&Snapshot>,
    orders: Receiver<(Box<Chip>, Order)>,
    stops: Sender<Lent>,
) {
    let PoweredOff { board, images, firmware, recorder } = powered_off;
    let retained = Board::of(board.chip()).retained_ram;
    // Asked to reach instant 0: it stops before the first instruction.
    let mut session =
        Session::new(Box::new(board), 0, VirtualNanos(0)).unwrap_or_else(|error| failed(error));
    session.watch(Retention::watch(retained));
    let mut recorder = recorder;
    let resume = from.map(|snapshot| {
        snapshot.load(&mut session, &firmware, &mut recorder).unwrap_or_else(|error| failed(error))
    });
    let mut start = Start::new(&images);
    start.resume = resume.as_ref();
    let driver = Rendezvous {
        orders,
        stops,
        recorder,
        target: VirtualNanos(0),
        awaited: None,
        next_drain: Recorder::next_drain(from.map_or(VirtualNanos(0), Snapshot::at)),
        resets: session.resets().len(),
        script: None,
        waits: false,
        begin: if from.is_some() { Begin::Snapshot } else { Begin::PowerOn },
    };
    if let Err(error) = emulator::run(session, &start, driver) {
        failed(error);
    }
}

fn failed(error: impl std::fmt::Display) -> ! {
    panic!("the emulation: {error}")
}

/// The emulation's end of the rendezvous.
struct Rendezvous {
    orders: Receiver<(Box<Chip>, Order)>,
    stops: Sender<Lent>,
    recorder: Recorder,
    /// Where to stand still next.
    target: VirtualNanos,
    /// The number of an operation of the flash that is waited for.
    awaited: Option<usize>,
    /// When the log is drained next.
    next_drain: VirtualNanos,
    /// Resets seen so far.
    resets: usize,
    /// What a forked process does; the test's thread is not there.
    script: Option<Script>,
    /// The core stands still until its flash is no longer busy.
    waits: bool,
    /// Where it has not yet stood for the first time.
    begin: Begin,
}

/// Where a run starts; [`Begin::Here`] once it has, [`Begin::Ended`] once nobody gives orders any
/// more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Begin {
    PowerOn,
    Snapshot,
    Here,
    Ended,
}

impl Rendezvous {
    /// Stands still until the test orders to run; `None`: to end.
    fn stand(
        &mut self,
        session: &mut Session<Socket>,
        host: &mut dyn Host,
        stop: Stop,
    ) -> Option<VirtualNanos> {
        loop {
            if let Some(error) = session.take_error() {
                failed(error);
            }
            let part = session.board_mut().lend();
            self.stops.send(Lent { part, stop }).ok()?;
            let (part, order) = self.orders.recv().ok()?;
            session.board_mut().take_back(part);
            match order {
                Order::Do(job) => {
                    job(session, host, stop, &mut self.recorder);
                    self.note_resets(session, host, stop.at);
                }
                Order::RunTo(instant) => {
                    self.target = instant;
                    return Some(self.next_stop());
                }
                Order::RunIntoFlashOperation(number, instant) => {
                    (self.target, self.awaited) = (instant, Some(number));
                    self.look_for_operation();
                    return Some(self.next_stop());
                }
                Order::Branch(script, number) => match fork() {
                    Fork::Child => {
                        self.script = Some(script);
                        return Some(self.next_stop());
                    }
                    Fork::Parent(child) => {
                        // The other end waits for it.
                        let _ = number.send(child);
                    }
                },
                Order::End => {
                    self.begin = Begin::Ended;
                    return None;
                }
            }
        }
    }

    fn note_resets(&mut self, session: &Session<Socket>, host: &mut dyn Host, at: VirtualNanos) {
        if session.resets().len() != self.resets {
            self.resets = session.resets().len();
            self.recorder.reset(session.board().chip(), at, host);
        }
    }

    /// Where the operation has begun that is waited for, its midst is where to stand still.
    fn look_for_operation(&mut self) -> bool {
        let midst = self.awaited.and_then(|number| self.recorder.flash().midst_of(number));
        if let Some(midst) = midst {
            (self.target, self.awaited) = (midst.min(self.target), None);
        }
        midst.is_some()
    }

    /// A forked process hears of what was recorded.
    fn tell_script(&mut self, host: &mut dyn Host) {
        let report = match &mut self.script {
            Some(script) => script.play.noted(host, &self.recorder),
            None => None,
        };
        self.end_script(report);
    }

    /// The end of a forked process that has something to report.
    fn end_script(&mut self, report: Option<Vec<u8>>) {
        if let Some(report) = report {
            self.script.take().expect("it has reported").end(&report);
        }
    }

    fn next_stop(&self) -> VirtualNanos {
        self.next_drain
            .min(self.script.as_ref().map_or(self.target, |script| script.play.next_stop()))
    }
}

impl Driver<Socket> for Rendezvous {
    fn on_settled(&mut self, session: &mut Session<Socket>, host: &mut dyn Host, settled: Settled) {
        let waits = session.board().chip().waits_for_flash();
        if waits != self.waits {
            self.waits = waits;
            host.hold(waits || session.unpowered());
        }
        match settled {
            Settled::Access { access, value } => {
                self.recorder.access(&access, value, session.board().chip());
                self.note_resets(session, host, access.virtual_time);
                self.tell_script(host);
                if self.look_for_operation() {
                    session.run_until(self.next_stop());
                }
            }
            Settled::Hit(hit) => {
                self.recorder.hit(hit, host);
                self.tell_script(host);
            }
            Settled::Stop(stop) if self.begin == Begin::Snapshot => {
                self.begin = Begin::Here;
                // A machine that is dropped here must still run to its end: one stop.
                let next = self.stand(session, host, stop).unwrap_or(stop.at);
                session.run_until(next);
            }
            Settled::Stop(stop) if session.unpowered() => {
                self.recorder.reset(session.board().chip(), stop.at, host)
            }
            Settled::Stop(stop) => self.note_resets(session, host, stop.at),
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Socket>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        if self.begin == Begin::Ended {
            return None;
        }
        if self.begin == Begin::PowerOn {
            self.begin = Begin::Here;
            self.recorder.power_up(host);
        }
        if stop.at >= self.next_drain {
            self.next_drain = Recorder::next_drain(stop.at);
            self.recorder.drain(host);
        }
        if let Some(script) = &mut self.script {
            if stop.at >= script.play.next_stop() {
                let report = script.play.stands(session, host, &mut self.recorder, stop.at);
                self.end_script(report);
                self.note_resets(session, host, stop.at);
            }
            return Some(self.next_stop());
        }
        if stop.at >= self.target {
            self.awaited = None;
            self.stand(session, host, stop)
        } else {
            Some(self.next_stop())
        }
    }
}
