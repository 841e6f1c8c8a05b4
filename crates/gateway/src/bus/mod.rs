//! One bus: its configuration, what is on its way, and what it counts.

mod bounds;
mod frame_bits;
mod line;
mod load;
mod plan;
mod raw;
mod receive;
mod schedule;
mod transmit;

pub use line::PAUSE_BITS;
pub(crate) use load::{check as check_load, shortest_period};
pub use plan::{Assumptions, AxisPlan, BusPlan};
pub(crate) use raw::Raw;

use crate::axes::Axes;
use crate::axis::Is;
use crate::outbox::Outbox;
use crate::port::{BusPort, BusSetup, TRANSMIT_SLOTS};
use crate::set::Set;
use crate::time::{Duration, Instant};
use bounds::Bounds;
use frame_bits::STANDARD_FRAME_BITS;
use host_protocol::replies::BusReport;
use host_protocol::{
    AxisState, BusConfig, BusCounters, BusKind, BusMode, BusState, CanId, Error, Event,
    ProtocolSet, TripReason,
};
use line::Line;
use serde::{Deserialize, Serialize};

/// Pause before a bus that is off is started again: the first, and the longest of those that double
/// while it goes off anew.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
const LONGEST_PAUSE: Duration = Duration::from_millis(1_600);
/// A bus that has run for so long has recovered: the next pause is the first again.
const RECOVERED_AFTER: Duration = Duration::from_millis(2_000);

/// One bus of the gateway.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Bus {
    index: u8,
    #[serde(skip)]
    port: BusPort,
    config: Option<BusConfig>,
    generation: u32,
    state: BusState,
    transmit_errors: u16,
    receive_errors: u16,
    counters: BusCounters,
    in_flight: [Option<InFlight>; TRANSMIT_SLOTS],
    line: Line,
    /// CAN: when the last frame had left or had come.
    active_at: Instant,
    /// CAN: when it was last known to have been quiet for as long as a motor takes to begin its
    /// reply, and for another frame: no reply that was due before is under way.
    quiet_at: Instant,
    pub raw: Option<Raw>,
    /// It runs otherwise than it is configured, for as long as it is open for raw frames.
    borrowed: Option<Borrowed>,
    /// How much longer the frame that has waited longest for an acknowledgement might have waited
    /// when it was cancelled: what takes its place has no more.
    time_left: Option<Duration>,
    /// The last frame that came back had met the reply to the one before; none has left since.
    let_reply_pass: bool,
    /// When a first stop had left last, or the bus began to run.
    first_stops_since: Instant,
    /// When a bus that is off is started again.
    restart_at: Option<Instant>,
    /// When it was started last.
    started_at: Instant,
    /// The pause before that.
    pause: Duration,
    /// It has grown since the start.
    has_paused: bool,
    /// Of a frame here, bits; and how long others wait. Kept, as they change with the
    /// configuration.
    longest_frame_bits: u64,
    bounds: Bounds,
    /// The axis that was served last; the next one after it goes first.
    last_served: u8,
    due: Due,
}

/// When time alone brings something to a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Due {
    /// It must be looked at again; [`Instant::NEVER`] where nothing comes.
    at: Instant,
    /// [`Bus::expire`] finds something.
    expires: Instant,
}

/// What a bus is configured with while it runs otherwise, and how it takes part meanwhile.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Borrowed {
    config: Option<BusConfig>,
    mode: BusMode,
}

/// A frame that the port has taken and not yet reported.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct InFlight {
    /// Whose it is; `None` for a raw frame.
    axis: Option<u8>,
    /// Arbitration id on CAN: two frames of one id are never in a controller at once.
    id: Option<CanId>,
    /// When it counts as not acknowledged.
    deadline: Instant,
    overdue: bool,
    /// Part of a stop: it stays in the controller until it leaves or another stop takes its place.
    is_stop: bool,
    /// The first command of a stop.
    is_first_stop: bool,
    /// Asked back from the controller, which must report by then.
    cancel_by: Option<Instant>,
    /// Its axis has left the bus or got another address: it must come back.
    is_disowned: bool,
    /// When it counts as destroyed by a reply with its own id, which was due and had not come when
    /// it was handed over, unless another frame passes before.
    collided_at: Option<Instant>,
}

impl Bus {
    pub fn new(index: u8, port: BusPort) -> Self {
        Self {
            index,
            port,
            config: None,
            generation: 0,
            state: BusState::Unconfigured,
            transmit_errors: 0,
            receive_errors: 0,
            counters: BusCounters::default(),
            in_flight: [None; TRANSMIT_SLOTS],
            line: Line::default(),
            active_at: Instant::from_micros(0),
            quiet_at: Instant::from_micros(0),
            raw: None,
            borrowed: None,
            time_left: None,
            let_reply_pass: false,
            first_stops_since: Instant::from_micros(0),
            restart_at: None,
            started_at: Instant::from_micros(0),
            pause: Duration::ZERO,
            has_paused: false,
            longest_frame_bits: STANDARD_FRAME_BITS,
            bounds: Bounds::default(),
            last_served: 0,
            due: Due { at: Instant::NEVER, expires: Instant::NEVER },
        }
    }

    /// The same bus, taken from a snapshot, on its port.
    pub fn attach(&mut self, port: BusPort) {
        self.port = port;
    }

    /// A port that runs `other` goes on with this one: nothing is started anew for that alone.
    pub fn runs_as(&mut self, other: &Self) {
        self.generation = other.generation;
    }

    /// When the bus must be looked at again; [`Instant::NEVER`] where nothing comes.
    pub fn due(&self) -> Instant {
        self.due.at
    }

    /// Whether [`expire`](Self::expire) may find something, as of when it was settled.
    pub fn may_expire(&self, now: Instant) -> bool {
        self.due.expires <= now
    }

    /// Works out anew when the bus is due. `after`: what was due until then has been done.
    pub fn settle(&mut self, after: Instant, axes: &Axes) {
        self.due = self.deadlines(after, axes);
    }

    /// Panics where the bounds are not what a look at all axes gives. For tests.
    pub fn assert_measured(&self, axes: &Axes) {
        if self.config.is_some() {
            let mut fresh = self.clone();
            fresh.measure(axes);
            assert_eq!(fresh.bounds, self.bounds);
            assert_eq!(fresh.longest_frame_bits, self.longest_frame_bits);
        }
    }

    /// Panics where the bus is due at another time. For tests.
    pub fn assert_due(&self, after: Instant, axes: &Axes) {
        assert_eq!(self.deadlines(after, axes), self.due);
    }

    /// Everything that time alone brings about. Returns whether the bus is to be polled again: it
    /// has changed, or stops are under way, which wait for more than one thing.
    pub fn expire(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) -> bool {
        let stops = self.is_stopping(axes);
        if stops {
            self.report_unsent_stops(now, axes, out);
        }
        if self.config.is_none() {
            return false;
        }
        let is_restarted = self.restart_at.is_some_and(|at| at <= now);
        if is_restarted {
            self.restart(now, axes, out);
        }
        let is_overdue = self.expire_in_flight(now, axes, out);
        self.expire_deliveries(now, axes, out);
        if self.has_overdue(axes) {
            self.expire_overdue(now, axes, out);
        }
        if stops {
            self.report_delayed_stops(now, axes, out);
        }
        stops || is_restarted || is_overdue
    }

    /// Whether one of its axes has a stop to send.
    fn is_stopping(&self, axes: &Axes) -> bool {
        !self.which(Is::Stopping, axes).is_empty()
    }

    pub fn port(&self) -> &BusPort {
        &self.port
    }

    pub fn index(&self) -> u8 {
        self.index
    }

    pub fn kind(&self) -> BusKind {
        self.port.kind
    }

    /// Its configuration, also while it runs otherwise.
    pub fn config(&self) -> Option<&BusConfig> {
        self.borrowed.as_ref().map_or(&self.config, |borrowed| &borrowed.config).as_ref()
    }

    /// What its motors speak as it runs.
    pub fn protocols(&self) -> ProtocolSet {
        self.config.as_ref().map_or(ProtocolSet::NONE, |config| config.protocols)
    }

    /// Whether it runs otherwise than it is configured.
    pub fn is_borrowed(&self) -> bool {
        self.borrowed.is_some()
    }

    /// How it takes part in what happens there.
    pub fn mode(&self) -> BusMode {
        self.borrowed.map_or(BusMode::Normal, |borrowed| borrowed.mode)
    }

    pub fn is_off(&self) -> bool {
        self.state == BusState::BusOff
    }

    /// Exchanges the configuration; [`configured`](Self::configured) is to follow, or another
    /// exchange that takes it back.
    pub fn exchange_config(&mut self, config: &mut Option<BusConfig>) {
        core::mem::swap(&mut self.config, config);
    }

    /// Runs by the configuration that it was given, which has been checked. The port restarts the
    /// bus, or stops it where there is none.
    pub fn configured(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        match &self.config {
            Some(config) => {
                self.line.configure(config.protocols);
                self.measure(axes);
            }
            None if self.state != BusState::Unconfigured => {
                self.state = BusState::Unconfigured;
                let state = self.state;
                out.event(&Event::BusStateChanged { bus: self.index, state });
            }
            None => {}
        }
        self.pause = Duration::ZERO;
        self.restart(now, axes, out);
    }

    /// Whether the board cannot run this bus at present, whatever its configuration: it offers no
    /// bitrate for it.
    pub fn is_unserved(&self) -> bool {
        self.port.bitrates.is_empty()
    }

    /// Takes the configuration that an unserved bus had before a reset: its axes stay known. It
    /// counts as off, and is never started.
    pub fn restore_unserved(&mut self, config: BusConfig, axes: &Axes) {
        self.config = Some(config);
        self.measure(axes);
        self.state = BusState::BusOff;
    }

    /// Has the port start the bus again; it drops what it holds.
    fn restart(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        self.generation = self.generation.wrapping_add(1);
        self.restart_at = None;
        self.started_at = now;
        self.has_paused = false;
        self.line.restart();
        self.empty(now, axes, out);
    }

    /// Opens the bus for raw frames, unless it is open in this manner already.
    pub fn open_raw(
        &mut self,
        now: Instant,
        unsafe_access: bool,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        if self.raw.as_ref().is_some_and(|raw| raw.is_unsafe() == unsafe_access) {
            return;
        }
        self.close_raw(now, axes, out);
        self.raw = Some(Raw::new(unsafe_access));
    }

    /// Runs it otherwise than it is configured, open for raw frames that read, until it is closed.
    pub fn borrow(
        &mut self,
        now: Instant,
        config: BusConfig,
        mode: BusMode,
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        let own = self.config.replace(config);
        let config = self.borrowed.map_or(own, |borrowed| borrowed.config);
        self.borrowed = Some(Borrowed { config, mode });
        self.raw = Some(Raw::new(false));
        self.configured(now, axes, out);
    }

    /// Closes the bus for raw frames; those that wait are dropped. One that ran otherwise runs as
    /// it is configured again. After unsafe access it is started again, so that nothing of it
    /// leaves any more, when its motors may already be axes.
    pub fn close_raw(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        let was_unsafe = self.raw.take().is_some_and(|raw| raw.is_unsafe());
        if let Some(borrowed) = self.borrowed.take() {
            self.config = borrowed.config;
            self.configured(now, axes, out);
        } else if was_unsafe {
            self.restart(now, axes, out);
        }
    }

    /// An axis leaves the bus or gets another address: what is under way for it belongs to nobody,
    /// and is asked back.
    pub fn disown(&mut self, axis: u8) {
        for in_flight in self.in_flight.iter_mut().flatten().filter(|f| f.axis == Some(axis)) {
            in_flight.axis = None;
            in_flight.is_first_stop = false;
            in_flight.is_disowned = true;
        }
    }

    /// The pause before the next start: it grows as long as each start leads to nothing (GUARANTEES
    /// G7).
    fn next_pause(&self, now: Instant) -> Duration {
        if self.pause == Duration::ZERO || now.since(self.started_at) >= RECOVERED_AFTER {
            return FIRST_PAUSE;
        }
        self.pause.times(2).min(LONGEST_PAUSE)
    }

    pub fn setup(&self) -> Option<BusSetup> {
        let config = self.config.as_ref().filter(|_| !self.is_unserved())?;
        let (generation, mode) = (self.generation, self.mode());
        Some(BusSetup { generation, bitrate: config.bitrate, mode })
    }

    pub fn report(&self) -> BusReport {
        BusReport {
            config: self.config().copied(),
            state: self.state,
            transmit_errors: self.transmit_errors,
            receive_errors: self.receive_errors,
            counters: self.counters,
            raw_open: self.raw.is_some(),
        }
    }

    /// The port reports the controller's state. Bus-off trips the axes here and empties what was on
    /// its way.
    pub fn state_changed(
        &mut self,
        now: Instant,
        state: BusState,
        errors: (u16, u16),
        axes: &mut Axes,
        out: &mut Outbox<'_>,
    ) {
        if self.config.is_none() {
            return;
        }
        (self.transmit_errors, self.receive_errors) = errors;
        if state == BusState::BusOff {
            // Also for a bus that is still off after it was started again.
            if self.restart_at.is_none() {
                // Once for each start: a controller is still off when it has just been started, and
                // may go off again.
                if !core::mem::replace(&mut self.has_paused, true) {
                    self.pause = self.next_pause(now);
                }
                self.restart_at = Some(now + self.pause);
            }
        } else {
            self.restart_at = None;
        }
        if state == self.state {
            return;
        }
        if self.is_off() {
            self.first_stops_since = now;
        }
        self.state = state;
        out.event(&Event::BusStateChanged { bus: self.index, state });
        if state != BusState::BusOff {
            return;
        }
        self.counters.bus_offs = self.counters.bus_offs.saturating_add(1);
        axes.each(self.here(axes), |axis| {
            axis.trip(now, TripReason::BusOff, out);
            axis.fail(now, Error::BusOff { bus: self.index }, out);
        });
        self.empty(now, axes, out);
        // The request that is lost with the bus may be the one that has a motor stopped which
        // should hold.
        axes.each(self.here(axes), |axis| {
            if axis.state() == AxisState::Stopping {
                axis.trip(now, TripReason::BusOff, out);
            }
        });
    }

    /// The port has dropped every frame it held.
    fn empty(&mut self, now: Instant, axes: &mut Axes, out: &mut Outbox<'_>) {
        self.in_flight = [None; TRANSMIT_SLOTS];
        self.time_left = None;
        self.let_reply_pass = false;
        self.first_stops_since = now;
        if let Some(raw) = &mut self.raw {
            raw.purge();
        }
        axes.each(self.here(axes), |axis| axis.forget_requests(now, out));
    }

    /// The axes for this bus.
    fn here(&self, axes: &Axes) -> Set {
        axes.on(self.index)
    }

    /// Those of them of which something is so.
    fn which(&self, is: Is, axes: &Axes) -> Set {
        axes.which(is).and(self.here(axes))
    }

    pub fn receive_overflow(&mut self, lost: u32) {
        self.counters.receive_overflows = self.counters.receive_overflows.saturating_add(lost);
    }

    /// How long a motor here has for its reply.
    fn reply_window(&self) -> Duration {
        let us = self.config.as_ref().map_or(0, |config| config.reply_window_us);
        Duration::from_micros(u64::from(us))
    }

    /// Time of `bits` bits at the bus's bitrate, rounded up.
    fn bit_time(&self, bits: u64) -> Duration {
        bits_at(bits, self.config.as_ref().map_or(0, |config| config.bitrate))
    }
}

/// Time of `bits` bits at a bitrate, rounded up to the microsecond. No bitrate counts as 1 bit/s.
pub fn bits_at(bits: u64, bitrate: u32) -> Duration {
    let (bit_us, bitrate) = (bits * 1_000_000, bitrate.max(1));
    // What is asked for at every frame fits into the 32 bits that the processor divides by itself.
    let us = match u32::try_from(bit_us) {
        Ok(bit_us) => u64::from(bit_us.div_ceil(bitrate)),
        Err(_) => bit_us.div_ceil(u64::from(bitrate)),
    };
    Duration::from_micros(us)
}
