//! A scripted USB host at full speed: it does what a test orders, in virtual time, as a host
//! controller would.
//!
//! | What | How | Source |
//! |---|---|---|
//! | frames | one a millisecond; a transaction that would not end before the next frame waits for it | USB 2.0 §8.4.3, §11.2.2 |
//! | durations | 12 Mbit/s: token, data and handshake with SYNC, CRC and EOP, 7 bits between packets, no stuffed bits | USB 2.0 §8.4.5, §7.1.18 |
//! | order | one control transfer at a time before bulk; bulk IN and OUT in turn | |
//! | NAK | that endpoint again after 50 µs | a host may choose |
//! | no response | three times in a row end the transfer: the device is gone, or does not obey | USB 2.0 §8.6, error counts of OHCI and xHCI |
//! | reset, resume | SE0 for 10 ms and 10 ms of recovery; K for 20 ms | USB 2.0 §7.1.7.3, §7.1.7.5, §7.1.7.7 |
//! | suspend | no frames; the device sees 3 ms of idle | USB 2.0 §7.1.7.6 |
//!
//! What a function does wrong it counts: [`Host::errors`]. Enumeration is the test's script, of
//! control transfers.

mod control;
mod frames;
mod pipe;

use std::collections::VecDeque;
use std::time::Duration;

use rigless::snapshot::store;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use control::Progress;
pub use control::{Control, Ended};
pub use pipe::Packet;
use pipe::Pipe;

use super::function::{Toggle, UsbFunction};

/// A frame.
const FRAME: u64 = 1_000_000;
/// Reset, and what a device may take to recover from it; resume; idle until a device is suspended.
const RESET: u64 = 10_000_000;
const RECOVERY: u64 = 10_000_000;
const RESUME: u64 = 20_000_000;
const IDLE: u64 = 3_000_000;
/// How often a host looks for a device that appears.
const LOOK: u64 = 1_000_000;

/// What the bus does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Bus {
    /// No cable, or a device that does not show itself.
    #[default]
    Absent,
    /// A device is there, and nothing has been done with it.
    Connected,
    /// Reset until then.
    Reset(VirtualNanos),
    /// Frames.
    Running,
    /// No frames since then.
    Idle(VirtualNanos),
    /// No frames, and the device knows.
    Suspended,
    /// K until then.
    Resuming(VirtualNanos),
}

/// What the function has done against the rules, and what it has not done.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Errors {
    /// IN packets with the toggle of the packet before: taken for repeated, and dropped.
    pub toggles: u32,
    /// Transactions without an answer.
    pub no_response: u32,
    /// Packets longer than the endpoint's.
    pub babble: u32,
}

/// A transaction whose middle is on the bus.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
enum Transaction {
    Setup([u8; 8]),
    Out {
        control: bool,
        toggle: Toggle,
        data: Vec<u8>,
    },
    In {
        control: bool,
    },
    /// Its bytes arrive until then.
    Arriving {
        control: bool,
        toggle: Toggle,
        data: Vec<u8>,
    },
    /// The bus is busy with the rest of one that is decided.
    Ending,
}

/// The host, its cable, and what it has been told to do.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Host {
    /// The cable is in.
    plugged: bool,
    /// As the function has been told.
    attached: bool,
    /// Since when the lines are idle without a host, and whether the function has been told.
    idle: Option<(VirtualNanos, bool)>,
    bus: Bus,
    reset_wanted: bool,
    suspend_wanted: Option<bool>,
    frame: u16,
    next_frame: VirtualNanos,
    transaction: Option<(VirtualNanos, Transaction)>,
    /// Not before then, after a reset.
    quiet_until: VirtualNanos,
    address: u8,
    control: Option<Progress>,
    ended: VecDeque<Ended>,
    out: Pipe,
    input: Pipe,
    turn_of_out: bool,
    reads: bool,
    received: Vec<Packet>,
    errors: Errors,
    /// Frames begun, and transactions of all kinds, since the beginning.
    frames: u64,
}

store!(Host);

impl Default for Host {
    fn default() -> Self {
        Self::new()
    }
}

impl Host {
    /// No cable.
    #[must_use]
    pub fn new() -> Self {
        let start = VirtualNanos(0);
        Self {
            plugged: false,
            attached: false,
            idle: None,
            bus: Bus::Absent,
            reset_wanted: false,
            suspend_wanted: None,
            frame: 0,
            next_frame: start,
            transaction: None,
            quiet_until: start,
            address: 0,
            control: None,
            ended: VecDeque::new(),
            out: Pipe::default(),
            input: Pipe::default(),
            turn_of_out: false,
            reads: true,
            received: Vec::new(),
            errors: Errors::default(),
            frames: 0,
        }
    }

    /// Plugs the cable in.
    pub fn plug(&mut self) {
        self.plugged = true;
    }

    /// Pulls the cable out, whatever is on it. What was to be sent, and has not been, is forgotten.
    pub fn unplug(&mut self) {
        self.plugged = false;
    }

    /// Whether a device shows itself on a plugged cable.
    #[must_use]
    pub fn sees_device(&self) -> bool {
        self.bus != Bus::Absent
    }

    /// Resets the bus; frames follow. The address is 0, and everything under way is forgotten.
    pub fn reset(&mut self) {
        self.reset_wanted = true;
    }

    /// Whether frames run, and the device has had time to recover from a reset.
    #[must_use]
    pub fn is_ready(&self, now: Duration) -> bool {
        self.bus == Bus::Running
            && !self.reset_wanted
            && now.as_nanos() >= u128::from(self.quiet_until.0)
    }

    /// Stops the frames.
    pub fn suspend(&mut self) {
        self.suspend_wanted = Some(true);
    }

    /// Resumes the bus.
    pub fn resume(&mut self) {
        self.suspend_wanted = Some(false);
    }

    /// Whether the device has been told that it is suspended.
    #[must_use]
    pub fn is_suspended(&self) -> bool {
        self.bus == Bus::Suspended
    }

    /// Speaks to the device at that address from now on.
    pub fn use_address(&mut self, address: u8) {
        self.address = address;
    }

    /// Begins a control transfer. One that is under way is abandoned.
    pub fn control(&mut self, control: Control) {
        self.control = Some(Progress::new(control));
        self.ended.clear();
    }

    /// Abandons the control transfer under way.
    pub fn abandon_control(&mut self) {
        self.control = None;
    }

    /// How the control transfer has ended, once.
    pub fn take_ended(&mut self) -> Option<Ended> {
        self.ended.pop_front()
    }

    /// Opens the bulk endpoints: numbers of OUT and IN. Their toggles begin at DATA0.
    pub fn open(&mut self, out: u8, input: u8) {
        self.out = Pipe::new(out);
        self.input = Pipe::new(input);
    }

    /// Sends bytes in packets of 64, behind those that wait; no empty packet follows.
    pub fn send(&mut self, bytes: &[u8]) {
        self.out.queue.extend(bytes.chunks(usize::from(pipe::PACKET)).map(<[u8]>::to_vec));
    }

    /// Sends one packet.
    pub fn send_packet(&mut self, packet: &[u8]) {
        self.out.queue.push_back(packet.to_vec());
    }

    /// Packets that the function has not taken.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.out.queue.len()
    }

    /// Whether a program reads: otherwise the host asks for nothing.
    pub fn set_reading(&mut self, reads: bool) {
        self.reads = reads;
    }

    /// Whether something has been received.
    #[must_use]
    pub fn has_received(&self) -> bool {
        !self.received.is_empty()
    }

    /// Forgets the packets that it has still to send, but for one that is on the bus, and what it
    /// has received.
    pub fn clear(&mut self) {
        let is_on_bus =
            matches!(self.transaction, Some((_, Transaction::Out { control: false, .. })));
        self.out.queue.truncate(usize::from(is_on_bus));
        self.received.clear();
    }

    /// Takes the bytes received since the last time.
    pub fn take(&mut self) -> Vec<u8> {
        self.take_packets().into_iter().flat_map(|packet| packet.data).collect()
    }

    /// Takes the packets received since the last time, empty ones too.
    pub fn take_packets(&mut self) -> Vec<Packet> {
        std::mem::take(&mut self.received)
    }

    /// What the function has done wrong.
    #[must_use]
    pub fn errors(&self) -> Errors {
        self.errors
    }

    /// Frames begun so far.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Whether bulk OUT or IN has been given up: the device has stalled it, or did not answer three
    /// times.
    #[must_use]
    pub fn has_halted(&self) -> bool {
        self.out.halted || self.input.halted
    }

    /// Carries out what is due and what was ordered. Returns when it wants to be called again.
    pub fn advance(
        &mut self,
        now: VirtualNanos,
        function: &mut dyn UsbFunction,
    ) -> Option<VirtualNanos> {
        if self.attached != self.plugged {
            self.attached = self.plugged;
            self.left();
            function.set_attached(self.attached);
        }
        if self.bus != Bus::Absent && !(self.attached && function.is_pulled_up()) {
            self.left();
        }
        self.obey(now, function);
        self.go_on(now, function)
    }

    /// The device is gone, or the cable is.
    fn left(&mut self) {
        self.bus = Bus::Absent;
        self.idle = None;
        self.transaction = None;
        self.reset_wanted = false;
        self.suspend_wanted = None;
        self.address = 0;
        if self.control.take().is_some() {
            self.ended.push_back(Ended::Gone);
        }
        (self.out, self.input) = (Pipe::default(), Pipe::default());
    }

    fn obey(&mut self, now: VirtualNanos, function: &mut dyn UsbFunction) {
        if self.bus == Bus::Absent {
            return;
        }
        if std::mem::take(&mut self.reset_wanted) {
            self.left();
            self.bus = Bus::Reset(after(now, RESET));
            function.bus_reset();
        }
        match (self.suspend_wanted, self.bus) {
            (Some(true), Bus::Running) => {
                (self.bus, self.transaction) = (Bus::Idle(now), None);
                self.suspend_wanted = None;
            }
            (Some(false), Bus::Idle(_)) => {
                self.run(now);
                self.suspend_wanted = None;
            }
            (Some(false), Bus::Suspended) => {
                self.bus = Bus::Resuming(after(now, RESUME));
                function.resume();
                self.suspend_wanted = None;
            }
            _ => {}
        }
    }

    fn run(&mut self, now: VirtualNanos) {
        self.bus = Bus::Running;
        self.next_frame = now;
    }

    fn go_on(&mut self, now: VirtualNanos, function: &mut dyn UsbFunction) -> Option<VirtualNanos> {
        match self.bus {
            Bus::Absent => self.wait_for_device(now, function),
            Bus::Connected | Bus::Suspended => None,
            Bus::Reset(until) | Bus::Resuming(until) if now < until => Some(until),
            Bus::Reset(_) => {
                function.bus_reset_ended();
                self.quiet_until = after(now, RECOVERY);
                self.run(now);
                self.run_frames(now, function)
            }
            Bus::Resuming(_) => {
                self.run(now);
                self.run_frames(now, function)
            }
            Bus::Idle(since) if now < after(since, IDLE) => Some(after(since, IDLE)),
            Bus::Idle(_) => {
                self.bus = Bus::Suspended;
                function.suspend();
                None
            }
            Bus::Running => self.run_frames(now, function),
        }
    }

    fn wait_for_device(
        &mut self,
        now: VirtualNanos,
        function: &mut dyn UsbFunction,
    ) -> Option<VirtualNanos> {
        if !function.is_pulled_up() {
            self.idle = None;
            return self.attached.then(|| after(now, LOOK));
        }
        if self.attached {
            self.bus = Bus::Connected;
            return None;
        }
        // Nobody is at the other end: its own pull-up keeps the lines idle.
        let (since, told) = self.idle.get_or_insert((now, false));
        if *told {
            return None;
        }
        let due = after(*since, IDLE);
        *told = now >= due;
        if *told {
            function.suspend();
        }
        (now < due).then_some(due)
    }
}

fn after(instant: VirtualNanos, nanos: u64) -> VirtualNanos {
    VirtualNanos(instant.0.saturating_add(nanos))
}
