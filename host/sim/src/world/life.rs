//! The lives of the gateway: its starts, what it remembers over a reset, how it hangs, and its
//! pins.

use std::time::Duration;

use gateway::{Board, Event, Gateway, Images, Instant, RETAINED_WORDS, Save, Set};
use host_protocol::BootReason;
use host_protocol::replies::MAX_FLIGHT_RECORD_BYTES;

use super::trace::micros;
use super::{HostLink, World};
use crate::flash::{Storage, at_once};
use crate::images::ImageSlots;

/// The host links are opened when the stops after a start have left, or after this time.
const LINKS_OPEN_AFTER: Duration = Duration::from_millis(100);
/// From what the random generator gives at one start to what it gives at the next.
const RANDOM_STEP: u32 = 0x9E37_79B9;

/// What belongs to the board and not to the core that runs on it.
pub(super) struct Life {
    board: &'static Board,
    /// When the gateway was started last: its clock counts from there.
    started: Duration,
    /// Its program does nothing any more.
    hangs: bool,
    /// The memory that a reset leaves alone.
    words: Vec<u32>,
    /// What the random generator gives at the next start.
    random_number: Option<u32>,
    links_are_open: bool,
    e_stop_input_open: bool,
    storage: Option<Storage>,
    images: Option<ImageSlots>,
    /// The gateway is to start anew.
    restarts: bool,
}

impl Life {
    pub(super) fn new(board: &'static Board, random_number: Option<u32>) -> Self {
        let (started, words) = (Duration::ZERO, Vec::new());
        let (hangs, links_are_open, e_stop_input_open) = (false, false, false);
        Self {
            board,
            started,
            hangs,
            words,
            random_number,
            links_are_open,
            e_stop_input_open,
            storage: None,
            images: None,
            restarts: false,
        }
    }

    /// What the random generator gives.
    pub(super) fn take_random_number(&mut self) -> Option<u32> {
        let number = self.random_number;
        self.random_number = number.map(|number| number.wrapping_add(RANDOM_STEP));
        number
    }

    /// Puts words into the memory.
    pub(super) fn store(&mut self) -> impl FnMut(usize, u32) {
        |at, word| self.words.get_mut(at).into_iter().for_each(|place| *place = word)
    }
}

impl World {
    /// The gateway's own time, which counts from its last start.
    pub fn gateway_now(&self) -> Instant {
        Instant::from_micros(micros(self.now - self.life.started))
    }

    /// When the gateway was started last, in the time of this world.
    pub fn gateway_started(&self) -> Instant {
        Instant::from_micros(micros(self.life.started))
    }

    /// The gateway's program hangs: it takes in nothing and sends nothing more until it is reset.
    /// What its controllers hold still leaves.
    pub fn hang(&mut self) {
        self.life.hangs = true;
    }

    /// Starts the gateway anew. What it was sending is lost, and it remembers what a reset leaves
    /// alone; after `PowerOn` or `Brownout` nothing. `crash_report`: what its firmware kept
    /// behind.
    pub fn reset(&mut self, boot: BootReason, crash_report: &'static str) {
        let has_lost_power = matches!(boot, BootReason::PowerOn | BootReason::Brownout);
        if has_lost_power {
            self.life.words.clear();
        }
        let now = self.now;
        self.ports.iter_mut().for_each(|port| port.reset(now));
        self.links.iter_mut().for_each(HostLink::reset);
        let images = self.life.images.as_mut().map(ImageSlots::start);
        // A core keeps its board for ever; one more is what a start of this simulation costs.
        let firmware = match images {
            Some(Images { version, .. }) => String::leak(version.to_string()),
            None => self.life.board.firmware,
        };
        let board = Board { boot, crash_report, firmware, ..*self.life.board };
        let board = Box::leak(Box::new(board));
        let gateway = Gateway::new(board, self.life.take_random_number());
        self.gateway.restart(gateway, !has_lost_power);
        (self.life.started, self.life.hangs, self.life.links_are_open) = (now, false, false);
        self.not_before = now;
        if let Some(images) = images {
            let now = self.gateway_now();
            self.gateway.before_motion().set_images(now, images);
        }
        self.start_gateway();
    }

    /// Opens the e-stop input, as its button does when it is pressed, or closes it.
    pub fn set_e_stop_input(&mut self, open: bool) {
        self.life.e_stop_input_open = open;
        self.tell(Event::EStopInput { open });
        self.settle();
    }

    /// Gives the board a storage for its configuration, and starts it anew as after a loss of
    /// power.
    pub fn set_storage(&mut self, storage: Storage) {
        self.life.storage = Some(storage);
        self.life.words.clear();
        self.reset(BootReason::Simulated, "");
    }

    /// Gives the board room for images of its firmware, and starts it anew as after a loss of
    /// power.
    pub fn set_images(&mut self, images: ImageSlots) {
        self.life.images = Some(images);
        self.life.words.clear();
        self.reset(BootReason::Simulated, "");
    }

    /// The storage of the board.
    pub fn storage(&mut self) -> Option<&mut Storage> {
        self.life.storage.as_mut()
    }

    /// What is stored becomes the configuration, unless a reset has left one.
    fn load(&mut self) {
        let now = self.gateway_now();
        let Some(storage) = &mut self.life.storage else { return };
        let found = at_once(storage.find());
        let mut from = 0;
        self.gateway.before_motion().load(now, found, &mut |bytes| {
            let row = at_once(storage.next_row(from, bytes)).transpose()?;
            Some(row.map(|(row, length)| {
                from = row + 1;
                length
            }))
        });
    }

    /// Starts the gateway anew where it wants that.
    pub(super) fn restart(&mut self) {
        if std::mem::take(&mut self.life.restarts) {
            self.reset(BootReason::Software, "");
        }
    }

    /// Stores what the gateway wants stored.
    pub(super) fn save(&mut self) {
        let Some(save) = self.gateway.take_save() else { return };
        let Self { life, gateway, .. } = self;
        let result = match (save, &mut life.storage, &mut life.images) {
            (Save::Rows { digest }, Some(storage), _) => {
                at_once(storage.save(digest, &mut |row, out| gateway.stored_row(row, out)))
            }
            (Save::Nothing, Some(storage), _) => at_once(storage.forget()),
            (Save::Image(job), _, Some(images)) => images.store(&job),
            _ => return,
        };
        self.tell(Event::Saved { result });
    }

    /// Answers a host that reads what the flight recorder has kept.
    pub(super) fn read_flight_record(&mut self) {
        let Some(read) = self.gateway.take_flight_read() else { return };
        let mut page = [0; MAX_FLIGHT_RECORD_BYTES];
        let result = self.gateway.read(self.gateway_now(), read, &mut page);
        self.tell(Event::FlightRecord { result });
    }

    /// The level of the enable output.
    pub fn enable_output(&self) -> bool {
        self.gateway.enable_output()
    }

    /// First what is remembered, then the pins, then everything else.
    pub(super) fn start_gateway(&mut self) {
        let now = self.gateway_now();
        self.gateway.before_motion().restore(now, &self.life.words);
        self.load();
        self.named = Set::ALL;
        self.life.words.resize(RETAINED_WORDS, 0);
        self.tell(Event::EStopInput { open: self.life.e_stop_input_open });
        self.settle();
    }

    /// Whether the gateway's program runs.
    pub(super) fn runs(&self) -> bool {
        !self.life.hangs
    }

    /// When the gateway wants to be called, in the time of this world.
    pub(super) fn gateway_deadline(&mut self) -> Option<Duration> {
        let at = self.gateway.next_deadline().filter(|_| !self.life.hangs)?;
        Some(self.life.started + Duration::from_micros(at.as_micros()))
    }

    /// Hands an event to the gateway.
    pub(super) fn handle(&mut self, event: Event<'_>) {
        if self.life.hangs {
            return;
        }
        let now = self.gateway_now();
        let changes = self.gateway.handle(now, event, &mut self.life.store());
        if self.gateway.is_due() {
            let mut turns = 0..self.flight_turns;
            while turns.next().is_some() && self.gateway.go_on(now) {}
        }
        self.named = self.named.with(changes.buses);
        self.life.restarts = changes.restart;
    }

    /// Whether the gateway listens to its hosts.
    pub(super) fn links_are_open(&mut self) -> bool {
        let due =
            self.now - self.life.started >= LINKS_OPEN_AFTER || !self.gateway.stops_under_way();
        self.life.links_are_open |= due;
        self.life.links_are_open && self.runs()
    }
}
