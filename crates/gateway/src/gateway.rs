//! The gateway as one object: events in, frames out.

mod copy;
mod deadlines;
mod flight;
mod image;
mod names;
mod pins;
mod requests;
mod retained;
mod snapshot;
mod stored;
mod unstopped;

pub use retained::RETAINED_WORDS;
pub use snapshot::{MAX_SNAPSHOT, Part, ResumeError};
pub use stored::{MAX_STORED_ROW, NextRow, STORED_ROWS};

use crate::axes::Axes;
use crate::axis::{Axis, Is};
use crate::bus::{Assumptions, Bus, BusPlan};
use crate::history::History;
use crate::link::{Identity, Links};
use crate::log::LogEntry;
use crate::outbox::{Outbox, Ticket};
use crate::port::{Board, BusSetup, Changes, Event, Store, Transmit};
use crate::set::Set;
use crate::time::Instant;
use crate::tracked::Tracked;
use crate::{MAX_AXES_WIRE, MAX_BUSES};
use flight::FlightReading;
use heapless::Vec;
use host_protocol::{DEFAULT_BAUD, Error, Incident, Kind, MAX_FRAME, Request, class};
use image::Image;
use names::Names;
use requests::{Arming, Authority, Cycle, Draft, Running, Together};
use retained::Retention;
use serde::Deserialize;
use stored::Stored;
use unstopped::Unstopped;

/// A gateway: everything between the host links and the buses of one board.
///
/// In this order in memory: with zeros right behind the axes, the buses or the links the compiler
/// makes these on the stack, which has no room for them, and then moves them.
#[derive(Clone, Deserialize)]
#[repr(C)]
pub struct Gateway {
    pub(crate) axes: Axes,
    pub(crate) buses: Vec<Tracked<Bus>, MAX_BUSES>,
    pub(crate) links: Links,
    #[serde(skip)]
    pub(crate) board: &'static Board,
    pub(crate) history: Tracked<History>,
    /// Changes of the configuration that the host in command has not made yet.
    pub(crate) draft: Tracked<Draft>,
    pub(crate) stored: Tracked<Stored>,
    pub(crate) image: Tracked<Image>,
    pub(crate) names: Tracked<Names>,
    pub(crate) authority: Authority,
    /// The epoch of the latest arming of any axis; before the first the number from which they
    /// count. Without one nothing is armed.
    pub(crate) epoch: Option<u32>,
    /// Latched by an e-stop: nothing is armed until it is cleared.
    pub(crate) e_stopped: bool,
    pub(crate) unstopped: Unstopped,
    pub(crate) e_stop_input_open: bool,
    /// The level of the enable output, as the hosts know it.
    pub(crate) enabled: bool,
    /// The host in command fell silent, and none has been heard since.
    pub(crate) link_lost: bool,
    /// Starts since power came on.
    pub(crate) starts: u32,
    /// A start of several motors under way.
    pub(crate) together: Option<Together>,
    pub(crate) arming: Option<Arming>,
    pub(crate) cycle: Option<Cycle>,
    pub(crate) running: Option<Running>,
    pub(crate) retention: Retention,
    pub(crate) flight_reading: Option<FlightReading>,
    /// When the latest event was handled.
    pub(crate) now: Instant,
    /// The latest time that an event or a poll was given.
    pub(crate) latest: Instant,
    /// Buses that may have changed since it was worked out when they are due.
    pub(crate) touched_buses: Set,
    /// No bus but these is due before.
    #[serde(skip)]
    pub(crate) first_bus_due: Instant,
    /// Buses that may have changed since time alone was last looked at.
    pub(crate) unwatched_buses: Set,
    /// Buses that may have changed since that was last told.
    pub(crate) changed_buses: Set,
    /// Buses that hold a stop beside other frames, and have not been asked since what of these must
    /// come back.
    pub(crate) crowded_buses: Set,
}

impl Gateway {
    /// A gateway with nothing configured. Buses beyond [`MAX_BUSES`] are left out. `seed`: a random
    /// number, another one at each start, from which epochs count, so that none comes back;
    /// nothing if the chip gave none in time.
    pub fn new(board: &'static Board, seed: Option<u32>) -> Self {
        let mut gateway = Self::uninit(board, seed);
        gateway.init();
        gateway
    }

    /// A gateway without axes, buses and links, to be put where it stays before it is
    /// [initialised](Self::init): complete, it is too large for the stack of a board.
    #[inline(always)]
    pub const fn uninit(board: &'static Board, seed: Option<u32>) -> Self {
        Self {
            board,
            axes: Axes::new(),
            buses: Vec::new(),
            links: Links::new(),
            authority: Authority::new(),
            epoch: seed,
            e_stopped: false,
            unstopped: Unstopped::NONE,
            // Until it has been read it may be anything.
            e_stop_input_open: board.e_stop_input,
            enabled: true,
            link_lost: false,
            starts: 0,
            together: None,
            arming: None,
            cycle: None,
            running: None,
            history: Tracked::new(History::new()),
            retention: Retention::new(),
            draft: Tracked::new(Draft::new()),
            stored: Tracked::new(Stored::new()),
            image: Tracked::new(Image::new()),
            flight_reading: None,
            names: Tracked::new(Names::new()),
            now: Instant::from_micros(0),
            latest: Instant::from_micros(0),
            touched_buses: Set::NONE,
            first_bus_due: Instant::from_micros(0),
            unwatched_buses: Set::NONE,
            changed_buses: Set::NONE,
            crowded_buses: Set::NONE,
        }
    }

    /// Makes the axes, buses and links of an uninit gateway; each passes over the stack alone.
    /// Another time it does nothing.
    #[inline(never)]
    pub fn init(&mut self) {
        if self.epoch.is_none() && self.buses.is_empty() {
            self.links.log(LogEntry::NoRandomNumber);
        }
        self.axes.init();
        self.names.init();
        while let Some(port) = self.board.buses.get(self.buses.len()) {
            let index = u8::try_from(self.buses.len()).unwrap_or(u8::MAX);
            if self.buses.push(Tracked::new(Bus::new(index, *port))).is_err() {
                break;
            }
        }
        self.links.init();
        self.links.attach(self.board);
    }

    /// Takes in what happened at `now`, and stores of what it has changed whatever must outlive a
    /// reset before a frame can follow from it. A time earlier than one given before, here or to a
    /// poll, counts as that one. Returns who has to ask the core again; after that, it is asked for the
    /// [next deadline](Self::next_deadline).
    pub fn handle(&mut self, now: Instant, event: Event<'_>, store: Store<'_>) -> Changes {
        let now = self.later(now);
        if self.unstopped.is_empty() && !self.touched_buses.is_empty() {
            self.settle_buses();
        }
        self.now = now;
        self.remember_trips();
        self.go_on_stops(&event);
        self.supervise(now);
        match event {
            Event::HostBytes { link, mut bytes } => {
                while !bytes.is_empty() {
                    self.host_bytes(now, link, &mut bytes);
                }
                self.links.touch(link);
            }
            Event::HostLineError { link } => {
                if let Some(port) = self.links.get_mut(link) {
                    port.baud.unreadable(now.as_micros());
                }
                self.links.touch(link);
            }
            Event::CanReceived { bus: index, frame } => {
                let waits_for_quiet = self.with_bus(now, index, |bus, axes, out| {
                    bus.can_received(now, frame, axes, out);
                    bus.waits_for_quiet(axes)
                });
                if waits_for_quiet == Some(true) {
                    self.touch_buses(Set::of(index));
                }
                // Floods of foreign frames cost little: nothing follows from them.
                if self.axes.is_settled() && self.changed_buses.is_empty() {
                    return self.take_changes();
                }
            }
            Event::SerialReceived { bus, bytes, then } => {
                self.on_bus(now, bus, |bus, axes, out| {
                    bus.serial_received(now, bytes, then, axes, out)
                });
            }
            Event::Transmitted { bus, slot } => {
                self.on_bus(now, bus, |bus, axes, out| bus.transmitted(now, slot, axes, out));
            }
            Event::Cancelled { bus, slot } => {
                self.on_bus(now, bus, |bus, axes, _| bus.cancelled(now, slot, axes));
            }
            Event::BusState { bus, state, transmit_errors, receive_errors } => {
                let errors = (transmit_errors, receive_errors);
                self.on_bus(now, bus, |bus, axes, out| {
                    bus.state_changed(now, state, errors, axes, out)
                });
            }
            Event::ReceiveOverflow { bus, lost } => {
                self.on_bus(now, bus, |bus, _, _| bus.receive_overflow(lost));
            }
            Event::EStopInput { open } => self.e_stop_input(now, open),
            Event::Saved { result } => self.saved(now, result),
            Event::FlightRecord { result } => self.flight_record(now, result),
            Event::Tick => {}
        }
        self.settle(now);
        self.spread_trips();
        if self.unstopped.is_empty() {
            self.go_on_together(now);
            self.go_on_arming(now);
            self.go_on_cycle(now);
            self.go_on_running(now);
        }
        self.close_barred_raw(now);
        self.settle(now);
        self.watch_enable_output(now);
        self.links.log_holder(self.authority.holder);
        self.save_states(store);
        self.settle(now);
        self.check_kept(now);
        self.take_changes()
    }

    /// A time earlier than one given before counts as that one.
    fn later(&mut self, now: Instant) -> Instant {
        self.latest = self.latest.max(now);
        self.latest
    }

    /// How often the axes of a bus can be given setpoints together, and within what time its stops
    /// leave, if what is assumed is so; `None` where the bus is not configured.
    pub fn plan_bus(&self, bus: u8, assumed: &Assumptions) -> Option<BusPlan> {
        self.buses.get(usize::from(bus))?.plan(&self.axes, assumed)
    }

    /// Works out anew what is kept of the axes that may have changed, and what of it their buses
    /// need for the next frame.
    #[inline(always)]
    pub(crate) fn settle(&mut self, now: Instant) {
        if now > self.now || !self.axes.is_settled() {
            self.settle_axes(now);
        }
    }

    #[inline(never)]
    fn settle_axes(&mut self, now: Instant) {
        let changed = self.axes.settle(now, self.now, self.unstopped.axes());
        self.touch_buses(changed);
        for bus in self.axes.take_new_traffic() {
            if let Some(bus) = self.buses.get_mut(bus) {
                bus.measure(&self.axes);
            }
        }
    }

    /// In tests: what is kept is what a look at everything gives.
    fn check_kept(&self, now: Instant) {
        if cfg!(debug_assertions) {
            self.axes.assert_kept(now, self.now, self.unstopped.axes());
            self.buses.iter().for_each(|bus| bus.assert_measured(&self.axes));
            self.links.assert_due();
            let known = self.buses.iter().enumerate();
            let mut known = known.filter(|(index, _)| !self.touched_buses.has(*index));
            assert!(known.all(|(_, bus)| bus.due() >= self.first_bus_due), "first bus due");
        }
    }

    /// These may have changed.
    fn touch_buses(&mut self, buses: Set) {
        self.touched_buses.add(buses);
        self.unwatched_buses.add(buses);
        self.changed_buses.add(buses);
    }

    /// Who has to ask the core again since the last time: [`handle`](Self::handle) says so too, and
    /// what polls a bus asks afterwards.
    pub fn take_changes(&mut self) -> Changes {
        let (links, log) = self.links.take_changed();
        let history = self.has_more_to_save();
        let save = self.stored.is_due();
        let flight_read = self.has_flight_read();
        let restart = self.restart_at().is_some_and(|at| at <= self.now);
        let buses = self.changed_buses.take().with(self.crowded_buses);
        Changes { buses, links, log, history, save, flight_read, restart }
    }

    /// Records new trips in the history, in the order in which they were told, one call later: the
    /// stop frames go first.
    pub(crate) fn remember_trips(&mut self) {
        self.settle(self.now);
        for axis in self.links.take_tripped() {
            let Some(tripped) = self.axes.get_mut(usize::from(axis)) else { continue };
            if let Some(trip) = tripped.take_unrecorded_trip() {
                self.history.push(Incident::Tripped { start: self.starts, axis, trip });
            }
        }
    }

    /// Whether a bus that has just changed may have a frame to send or to cancel: where not, it need
    /// not be polled.
    pub fn may_want(&self, now: Instant, bus: u8) -> bool {
        let polled = self.buses.get(usize::from(bus));
        !self.axes.which(Is::Spreading).is_empty()
            || !self.unstopped.is_empty() && self.may_begin_stop(bus)
            || polled.is_some_and(|bus| bus.may_want(now, &self.axes))
    }

    /// Whether the next frame for a bus would go [behind a reply](Transmit::behind_reply): what
    /// arrives just now does not keep it from being taken.
    pub fn awaits_reply(&self, now: Instant, bus: u8) -> bool {
        let polled = self.buses.get(usize::from(bus));
        polled.is_some_and(|bus| bus.may_wait_for_reply(now, &self.axes))
    }

    /// Whether a bus has still to send the first stop of an axis.
    pub fn owes_first_stop(&self, bus: u8) -> bool {
        let stopping = self.axes.which(Is::FirstStop).with(self.unstopped.axes());
        !self.axes.on(bus).and(stopping).is_empty()
    }

    /// The next frame for a bus, if the bus may send one now.
    pub fn poll_transmit(&mut self, now: Instant, bus: u8) -> Option<Transmit> {
        let now = self.later(now);
        let may_want = cfg!(debug_assertions) && (now > self.now || self.may_want(now, bus));
        self.begin_stops(bus);
        self.settle(now);
        let Self { buses, axes, links, .. } = self;
        let polled = buses.get_mut(usize::from(bus))?;
        let transmit = polled.poll_transmit(now, axes, &mut Outbox::new(now, links));
        if transmit.as_ref().is_some_and(|transmit| polled.is_crowded(transmit.slot)) {
            self.crowded_buses.add(Set::of(bus));
        }
        debug_assert!(may_want || transmit.is_none(), "bus {bus} has more to send than is known");
        self.has_polled(now, bus, transmit.is_some());
        transmit
    }

    /// A bus has been polled: who polls it does so until nothing is left.
    fn has_polled(&mut self, now: Instant, bus: u8, has_changed: bool) {
        let bus = Set::of(bus);
        if has_changed {
            self.touch_buses(bus);
            if !self.axes.is_settled() {
                self.settle_axes(now);
            }
            self.check_kept(now);
        }
        self.changed_buses.put(bus, false);
    }

    /// The slot of a frame that the port of a bus should give back, if there is one: motion that a
    /// stop or a newer setpoint has replaced before it could leave, or what waits for a reply that
    /// has not come.
    pub fn poll_cancel(&mut self, now: Instant, bus: u8) -> Option<u8> {
        let now = self.later(now);
        let may_want = cfg!(debug_assertions) && (now > self.now || self.may_want(now, bus));
        self.begin_stops(bus);
        self.settle(now);
        let slot = self.with_bus(now, bus, |bus, axes, _| bus.poll_cancel(now, axes))?;
        debug_assert!(may_want || slot.is_none(), "bus {bus} has more to cancel than is known");
        self.crowded_buses.put(Set::of(bus), slot.is_some());
        self.has_polled(now, bus, slot.is_some());
        slot
    }

    /// Writes the next delimited frame for a host link to `out` and returns its length. First
    /// stores what is left to store: a host is told nothing that a reset can undo.
    pub fn poll_host(
        &mut self,
        link: u8,
        out: &mut [u8; MAX_FRAME],
        store: Store<'_>,
    ) -> Option<usize> {
        while !self.save_some(store) {}
        if let Some(length) = self.links.poll_transmit(link, out) {
            return Some(length);
        }
        if let Some(length) = self.poll_cycle_event(self.now, link, out) {
            return Some(length);
        }
        let Self { links, axes, now, .. } = self;
        let link = links.get_mut(link)?;
        // Samples are made when there is room for them, so that they wait nowhere and push nothing
        // out.
        loop {
            let (axis, fields) = link.next_sample()?;
            if let Some(axis) = axes.get(usize::from(axis)) {
                let (event, now_us) = (axis.sample(*now, fields), now.as_micros());
                return link
                    .write(|sequence, lost| event.encode_frame(sequence, lost, now_us, out));
            }
        }
    }

    /// The next entry of the log, in order. Who takes none loses nothing else.
    pub fn take_log(&mut self) -> Option<LogEntry> {
        self.links.take_entry()
    }

    /// The rate of a host link that is a UART: it has changed when a reply to `SetBaud` has been
    /// taken, and when [`Changes`] names the link because nothing valid was heard.
    pub fn baud(&self, link: u8) -> u32 {
        self.links.get(usize::from(link)).map_or(DEFAULT_BAUD, |link| link.baud.now())
    }

    /// How the bus must be running; `None` while it is not configured.
    pub fn bus_setup(&self, bus: u8) -> Option<BusSetup> {
        self.buses.get(usize::from(bus))?.setup()
    }

    /// Whether no axis needs the gateway: each is at rest or not configured. A trip is no rest, not
    /// even a confirmed one: its stops are repeated for faults that heal by themselves. Nor is
    /// holding where the motor must hear something for it.
    pub fn all_at_rest(&self) -> bool {
        self.unstopped.is_empty() && !self.axes.iter().any(Axis::is_in_use)
    }

    /// Has the axes polled that a host has subscribed to.
    pub(crate) fn watch(&mut self) {
        let Self { axes, links, .. } = self;
        let watched = |axis: &Axis| links.iter().any(|link| link.watches(axis.index));
        let changed = axes.those(Set::ALL, |axis| axis.watched != watched(axis));
        axes.each(changed, |axis| axis.watched = !axis.watched);
    }

    /// Takes `bytes` off their front, as far as the end of a frame or all, and executes the frame.
    /// Not inlined: the loop around it would work out beforehand what only some frames need.
    #[inline(never)]
    fn host_bytes(&mut self, now: Instant, link: u8, bytes: &mut &[u8]) {
        let Some(port) = self.links.get_mut(link) else {
            *bytes = &[];
            return;
        };
        let has_session = port.is_told();
        let Some(frame) = port.receive(now.as_micros(), bytes) else { return };
        let identity = Identity::of(&frame);
        let watches = frame.kind == Kind::WatcherRequest;
        let mut request = Request::decode(frame.number, frame.body);
        if let Ok(read) = &request
            && let Err(error) = requests::check_body(read)
        {
            request = Err(error);
        }
        if watches {
            if !has_session && !request.as_ref().is_ok_and(|request| request.is(class::STOPS)) {
                request = Err(Error::NoSession {});
            }
        } else if request.is_ok() {
            self.authority.heard(now, link);
            self.link_lost = false;
        }
        let slot = self.links.admit(link, now.as_micros(), identity, watches, &request);
        if let Some(slot) = slot {
            self.finish_stops();
            self.execute(now, Ticket { link, watches, slot }, &request);
        }
    }

    pub(crate) fn outbox(&mut self, now: Instant) -> Outbox<'_> {
        Outbox::new(now, &mut self.links)
    }

    pub(crate) fn axis(&self, axis: u8) -> Result<&Axis, Error> {
        self.axes.get(usize::from(axis)).ok_or(Error::UnknownAxis { axis, max_axes: MAX_AXES_WIRE })
    }

    pub(crate) fn axis_mut(&mut self, axis: u8) -> Result<&mut Axis, Error> {
        self.axes
            .get_mut(usize::from(axis))
            .ok_or(Error::UnknownAxis { axis, max_axes: MAX_AXES_WIRE })
    }

    pub(crate) fn bus(&self, bus: u8) -> Result<&Bus, Error> {
        let found = self.buses.get(usize::from(bus));
        found.map(|bus| &**bus).ok_or_else(|| unknown_bus(&self.buses, bus))
    }

    pub(crate) fn bus_mut(&mut self, bus: u8) -> Result<&mut Bus, Error> {
        let unknown = unknown_bus(&self.buses, bus);
        self.touch_buses(Set::of(bus));
        self.buses.get_mut(usize::from(bus)).map(|bus| &mut **bus).ok_or(unknown)
    }

    /// Calls `act` with an axis and the way to the hosts.
    pub(crate) fn with_axis<T>(
        &mut self,
        now: Instant,
        axis: u8,
        act: impl FnOnce(&mut Axis, &mut Outbox<'_>) -> T,
    ) -> Result<T, Error> {
        let Self { axes, links, .. } = self;
        let unknown = Error::UnknownAxis { axis, max_axes: MAX_AXES_WIRE };
        let axis = axes.get_mut(usize::from(axis)).ok_or(unknown)?;
        Ok(act(axis, &mut Outbox::new(now, links)))
    }

    /// Calls `act` with each axis of a set and the way to the hosts.
    pub(crate) fn each_axis(
        &mut self,
        now: Instant,
        set: Set,
        mut act: impl FnMut(&mut Axis, &mut Outbox<'_>),
    ) {
        let Self { axes, links, .. } = self;
        let mut out = Outbox::new(now, links);
        axes.each(set, |axis| act(axis, &mut out));
    }

    pub(crate) fn on_bus(
        &mut self,
        now: Instant,
        bus: u8,
        act: impl FnOnce(&mut Bus, &mut Axes, &mut Outbox<'_>),
    ) {
        self.touch_buses(Set::of(bus));
        self.with_bus(now, bus, act);
    }

    /// Calls `act` with a bus, without noting that it may have changed.
    fn with_bus<T>(
        &mut self,
        now: Instant,
        bus: u8,
        act: impl FnOnce(&mut Bus, &mut Axes, &mut Outbox<'_>) -> T,
    ) -> Option<T> {
        let Self { buses, axes, links, .. } = self;
        Some(act(buses.get_mut(usize::from(bus))?, axes, &mut Outbox::new(now, links)))
    }
}

/// The bus with this number is none of these.
pub(crate) fn unknown_bus(buses: &[Tracked<Bus>], bus: u8) -> Error {
    Error::UnknownBus { bus, buses: u8::try_from(buses.len()).unwrap_or(u8::MAX) }
}
