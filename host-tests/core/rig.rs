//! A gateway on a bench without motors: the test plays the host with typed requests and the motors
//! with literal bytes.

use crate::bench;
use crate::copy::Copy;
use crate::text::{can_text, hex, is_can, unhex};
use gateway::{
    Board, BusPort, Event, Gateway, Instant, LinkPort, MAX_SNAPSHOT, MAX_STORED_ROW, Outgoing,
    RETAINED_WORDS, STORED_ROWS, Set, Then, Transmit,
};
use host_protocol::{
    BootReason, BusKind, BusLimit, BusState, CHECKSUM, CanFrame, CycleEvent, CycleMessage,
    Deframer, Error, Event as HostEvent, EventMessage, Kind, MAX_FRAME, Reply, Request, requests,
};

const BITRATES: &[u32] = &[1_000_000, 500_000, 210_526];
/// A host link on a UART.
const UART: LinkPort = LinkPort { bauds: &[921_600, 2_000_000, 3_000_000] };
const BAUDS: &[u32] = &[115_200, 2_000_000];

/// Buses 0 and 1 are CAN, bus 2 is RS485 with echo.
pub static BOARD: Board = BOARD_VALUES;
pub const BOARD_VALUES: Board = Board {
    name: "rig",
    firmware: "0.1.0",
    build_id: "test",
    boot: BootReason::Simulated,
    crash_report: "",
    e_stop_input: true,
    enable_output: true,
    buses: &[
        BusPort { kind: BusKind::Can, bitrates: BITRATES },
        BusPort { kind: BusKind::Can, bitrates: BITRATES },
        BusPort { kind: BusKind::Rs485, bitrates: BAUDS },
    ],
    bus_limit: None,
    links: &[UART, UART, LinkPort { bauds: &[] }],
};

/// The same board after its watchdog has reset it.
pub static BOARD_AGAIN: Board = BOARD_AGAIN_VALUES;
const BOARD_AGAIN_VALUES: Board =
    Board { boot: BootReason::Watchdog, crash_report: "no check-in from bus 1", ..BOARD_VALUES };

/// The same again, without the clock that CAN needs.
pub static BOARD_WITHOUT_CAN: Board = Board {
    buses: &[
        BusPort { kind: BusKind::Can, bitrates: &[] },
        BusPort { kind: BusKind::Can, bitrates: &[] },
        BusPort { kind: BusKind::Rs485, bitrates: BAUDS },
    ],
    bus_limit: Some(BusLimit::NoClock),
    ..BOARD_AGAIN_VALUES
};

const BUSES: usize = 3;

/// What a gateway said to its host.
#[derive(Debug, Clone, PartialEq)]
pub enum Said {
    Reply(u16, Box<Reply>),
    Error(u16, Error),
    Event(HostEvent),
    Cycle(Box<CycleMessage>),
}

/// A motor's part: the bytes it answers to a request on a bus, as `ID#HEX` on CAN and as hex on
/// RS485.
pub type Motor = Box<dyn FnMut(u64, u8, &str) -> Option<String>>;

/// What a motor answers where a test has it do something of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instead {
    /// These bytes.
    Says(&'static str),
    /// Nothing.
    Nothing,
    /// What it would answer anyway.
    AsUsual,
}

/// What the serial line gives back of our own bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Echo {
    /// All of them, before the last one has left.
    Clean,
    /// All of them, after a byte of noise, once the last one has left.
    BehindNoise,
    /// None.
    Missing,
}

pub struct Rig {
    pub gateway: Gateway,
    events: u32,
    /// What is copied of the gateway while it goes on.
    copy: Option<Copy>,
    /// What outlives a reset.
    pub memory: Vec<u32>,
    pub now_us: u64,
    /// Every frame sent: time, bus, text.
    pub wire: Vec<(u64, u8, String)>,
    pub said: Vec<Said>,
    pub motor: Motor,
    pub echo: Echo,
    /// The CAN wires touch: a bus goes off as often as it is started.
    pub shorted: bool,
    /// The controllers never report a frame that they were to give back.
    pub stubborn: bool,
    /// The CAN cables are cut: nothing is acknowledged.
    cut: bool,
    /// Somebody sends this id on the CAN buses all the time: what has a higher one waits.
    babble: Option<u16>,
    /// Every frame that has left: when its last bit had, bus, text.
    pub left: Vec<(u64, u8, String)>,
    /// Frames that wait in a controller for an acknowledgement: bus, slot, text.
    held: Vec<(u8, u8, String)>,
    /// The frame that waits for a reply on the serial line: bus, slot, text.
    behind_reply: Option<(u8, u8, String)>,
    /// Bytes of the latest frame on that line, and those that have come since it began.
    line: (usize, usize),
    /// The setup with which each bus was started last.
    generations: [Option<u32>; BUSES],
    deframer: Deframer,
    sequence: u16,
    /// Things on their way: due time, what.
    due: Vec<(u64, Due)>,
    /// Buses that the core has named and that have not been polled since.
    named: Set,
    /// The gateway wants to start anew: a board would, and time ends for this one.
    pub starts_anew: bool,
}

enum Due {
    Left(u8, u8, String),
    Reply(u8, String),
}

impl Due {
    fn bus(&self) -> u8 {
        match self {
            Self::Left(bus, ..) | Self::Reply(bus, _) => *bus,
        }
    }
}

/// Time a frame takes here, and the pause of a motor before its reply; round numbers, easy to
/// reason with.
pub const FRAME_US: u64 = 130;
pub const MOTOR_US: u64 = 100;

impl Rig {
    pub fn new() -> Self {
        let mut rig = Self {
            gateway: Gateway::new(&BOARD, Some(0)),
            events: 0,
            copy: None,
            memory: vec![0xA5A5_A5A5; RETAINED_WORDS],
            now_us: 1_000,
            wire: Vec::new(),
            said: Vec::new(),
            motor: Box::new(|_, _, _| None),
            echo: Echo::Clean,
            shorted: false,
            stubborn: false,
            cut: false,
            babble: None,
            left: Vec::new(),
            held: Vec::new(),
            behind_reply: None,
            line: (0, 0),
            generations: [None; BUSES],
            deframer: Deframer::new(),
            sequence: 0,
            due: Vec::new(),
            named: Set::ALL,
            starts_anew: false,
        };
        rig.gateway.restore(rig.now(), &[]);
        rig.handle(Event::EStopInput { open: false });
        rig
    }

    /// The watchdog resets the gateway: the motors go on, time begins anew, and what was saved is
    /// all that is left.
    pub fn reset(&mut self) {
        self.reset_as(&BOARD_AGAIN);
    }

    /// The same, and the board offers something else than before.
    pub fn reset_as(&mut self, board: &'static Board) {
        self.begin_again(board);
        self.gateway.restore(self.now(), &self.memory);
        self.handle(Event::EStopInput { open: false });
    }

    /// What is stored where the running configuration is.
    pub fn rows(&self) -> Vec<Vec<u8>> {
        let row = |row| {
            let mut bytes = [0; MAX_STORED_ROW];
            let length = self.gateway.stored_row(row, &mut bytes);
            bytes[..length].to_vec()
        };
        (0..STORED_ROWS).map(row).filter(|row| !row.is_empty()).collect()
    }

    /// Power comes, and with it a configuration that was stored; the gateway has heard of nothing
    /// yet.
    pub fn power_on_as(&mut self, board: &'static Board, rows: &[Vec<u8>]) {
        self.memory.fill(0x5A5A_5A5A);
        self.begin_again(board);
        self.gateway.restore(self.now(), &[]);
        self.load(rows);
    }

    /// The gateway is told what is stored.
    pub fn load(&mut self, rows: &[Vec<u8>]) {
        let sums = rows.iter().map(|row| CHECKSUM.checksum(row));
        let digest = sums.fold(0, u32::wrapping_add);
        let mut rows = rows.iter();
        let mut next = |out: &mut [u8; MAX_STORED_ROW]| {
            let row = rows.next()?;
            out[..row.len()].copy_from_slice(row);
            Some(Ok(row.len()))
        };
        self.gateway.load(self.now(), Ok(digest), &mut next);
    }

    /// The changes of the list are made, and the board is reset behind each word of what is stored
    /// for that: `look` sees what a host finds behind so many of them, from none to all. Returns how
    /// many there are.
    pub fn apply_and_reset_behind_each_word(
        &mut self,
        mut look: impl FnMut(&mut Self, usize),
    ) -> usize {
        let before = self.memory.clone();
        let mut frame = [0; MAX_FRAME];
        let request = Request::ApplyChanges(requests::ApplyChanges {});
        let length = request.encode_frame(0x7000, &mut frame).unwrap();
        let (now, mut stored) = (self.now(), Vec::new());
        let event = Event::HostBytes { link: 0, bytes: &frame[..length] };
        self.gateway.handle(now, event, &mut |index, word| stored.push((index, word)));
        for cut in 0..=stored.len() {
            self.memory.clone_from(&before);
            for (index, word) in &stored[..cut] {
                self.memory[*index] = *word;
            }
            self.reset();
            bench::hello(self);
            look(self, cut);
        }
        stored.len()
    }

    fn begin_again(&mut self, board: &'static Board) {
        self.replace_gateway(Gateway::new(board, Some(0x8000_0000)));
        self.named = Set::ALL;
        self.now_us = 500;
        self.due.clear();
        self.held.clear();
        self.generations = [None; BUSES];
        self.deframer = Deframer::new();
        self.wire.clear();
        self.said.clear();
    }

    /// Another gateway is in its place, which nobody has copied.
    pub fn replace_gateway(&mut self, gateway: Gateway) {
        (self.gateway, self.copy) = (gateway, None);
    }

    pub fn now(&self) -> Instant {
        Instant::from_micros(self.now_us)
    }

    /// Sends a request and returns what it is answered within 100 ms.
    pub fn ask(&mut self, request: Request) -> Result<Reply, Error> {
        let sequence = self.send(&request);
        for _ in 0..1_000 {
            if let Some(answer) = self.answer(sequence) {
                return answer;
            }
            self.run(100);
        }
        panic!("no answer to {request:?}; said {:?}; wire {:?}", self.said, self.wire);
    }

    /// Sends a request on another link and returns what it is answered there within 100 ms.
    pub fn ask_as(&mut self, link: u8, request: &Request) -> Result<Reply, Error> {
        self.send_as(link, request);
        let mut out = [0; MAX_FRAME];
        let mut deframer = Deframer::new();
        for _ in 0..1_000 {
            while let Some(length) =
                self.gateway.poll_host(link, &mut out, &mut |index, word| self.memory[index] = word)
            {
                for byte in &out[..length] {
                    let Some(Ok(frame)) = deframer.push(*byte) else { continue };
                    match frame.kind {
                        Kind::Reply => return Ok(Reply::decode(frame.number, frame.body).unwrap()),
                        Kind::Error => return Err(Error::decode(frame.number, frame.body).unwrap()),
                        Kind::Event | Kind::Request | Kind::WatcherRequest => {}
                    }
                }
            }
            self.run(100);
        }
        panic!("no answer to {request:?}");
    }

    /// Sends a request without waiting.
    pub fn send(&mut self, request: &Request) -> u16 {
        self.send_as(0, request)
    }

    /// The same on another link.
    pub fn send_as(&mut self, link: u8, request: &Request) -> u16 {
        self.sequence += 1;
        let mut frame = [0; MAX_FRAME];
        let length = request.encode_frame(self.sequence, &mut frame).unwrap();
        self.handle(Event::HostBytes { link, bytes: &frame[..length] });
        self.sequence
    }

    /// What a request has been answered.
    pub fn answer(&self, sequence: u16) -> Option<Result<Reply, Error>> {
        self.said.iter().find_map(|said| match said {
            Said::Reply(number, reply) if *number == sequence => Some(Ok((**reply).clone())),
            Said::Error(number, error) if *number == sequence => Some(Err(*error)),
            _ => None,
        })
    }

    /// Bytes from the host.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.handle(Event::HostBytes { link: 0, bytes });
    }

    pub fn handle(&mut self, event: Event<'_>) {
        self.take_in(event);
        self.restart_buses();
        self.drain();
    }

    /// The gateway takes in an event and stores what it must, and that is all.
    pub fn take_in(&mut self, event: Event<'_>) {
        self.go_on_from_a_snapshot();
        let now = self.now();
        let changes = self.gateway.handle(now, event, &mut |index, word| self.memory[index] = word);
        self.named = self.named.with(changes.buses);
        self.starts_anew |= changes.restart;
    }

    /// From now on it is another gateway, which goes on from a snapshot: nobody notices. Not at
    /// each event of a long test.
    fn go_on_from_a_snapshot(&mut self) {
        self.events += 1;
        if self.events > 50 && !self.events.is_multiple_of(101) {
            return;
        }
        match &mut self.copy {
            Some(copy) => copy.go_on(&mut self.gateway),
            None => self.copy = Some(Copy::begin(&mut self.gateway)),
        }
        let mut bytes = [0; MAX_SNAPSHOT];
        let taken = self.gateway.snapshot(&mut bytes).expect("it fits");
        let board = self.gateway.board();
        (self.gateway, _) = Gateway::resume(board, taken).expect("this build has written it");
    }

    /// Stores a part of the rest; whether that was all.
    pub fn save_some(&mut self) -> bool {
        self.gateway.save_some(&mut |index, word| self.memory[index] = word)
    }

    /// From now on the motors answer otherwise where `answer` says so.
    pub fn instead(&mut self, mut answer: impl FnMut(&str) -> Instead + 'static) {
        let mut usual = std::mem::replace(&mut self.motor, Box::new(|_, _, _| None));
        self.motor = Box::new(move |now, bus, text| match answer(text) {
            Instead::Says(reply) => Some(reply.into()),
            Instead::Nothing => None,
            Instead::AsUsual => usual(now, bus, text),
        });
    }

    /// Cuts the CAN cables: what is in the controllers stays there, and the replies that were to
    /// come never come.
    pub fn cut(&mut self) {
        self.cut = true;
        for (at, what) in std::mem::take(&mut self.due) {
            match what {
                Due::Left(bus, slot, text) if is_can(&text) => self.held.push((bus, slot, text)),
                Due::Reply(_, text) if is_can(&text) => {}
                serial => self.due.push((at, serial)),
            }
        }
    }

    /// What waits for a reply on the serial line.
    pub fn behind_reply(&self) -> Option<&str> {
        self.behind_reply.as_ref().map(|(.., text)| text.as_str())
    }

    /// What waits in the controllers.
    pub fn held_texts(&self) -> Vec<&str> {
        self.held.iter().map(|(.., text)| text.as_str()).collect()
    }

    /// What waits in the controller of one bus.
    pub fn held_on(&self, bus: u8) -> Vec<&str> {
        self.held.iter().filter(|(on, ..)| *on == bus).map(|(.., text)| text.as_str()).collect()
    }

    /// Joins the cables again: what waits in the controllers leaves.
    pub fn mend(&mut self) {
        self.cut = false;
        self.babble(None);
    }

    /// From now on somebody sends this id as fast as the CAN buses take it; `None` falls silent.
    /// What waits and wins leaves.
    pub fn babble(&mut self, id: Option<u16>) {
        self.babble = id;
        let (waits, leaves) = std::mem::take(&mut self.held)
            .into_iter()
            .partition(|(.., text)| self.is_held_up(text));
        self.held = waits;
        let left_at = self.now_us + FRAME_US;
        let leaves: Vec<_> = leaves;
        self.due.extend(
            leaves.into_iter().map(|(bus, slot, text)| (left_at, Due::Left(bus, slot, text))),
        );
    }

    /// Whether a frame stays in its controller.
    fn is_held_up(&self, text: &str) -> bool {
        let id = text.split_once('#').and_then(|(id, _)| u16::from_str_radix(id, 16).ok());
        id.is_some_and(|id| self.cut || self.babble.is_some_and(|foreign| foreign < id))
    }

    /// A controller goes off its bus and drops what it holds.
    pub fn bus_off(&mut self, bus: u8) {
        self.drop_frames(bus);
        self.bus_state(bus, BusState::BusOff);
    }

    /// A controller reports its state.
    pub fn bus_state(&mut self, bus: u8, state: BusState) {
        let transmit_errors = if state == BusState::BusOff { 256 } else { 0 };
        self.handle(Event::BusState { bus, state, transmit_errors, receive_errors: 0 });
    }

    fn drop_frames(&mut self, bus: u8) {
        self.held.retain(|(on, ..)| *on != bus);
        self.behind_reply.take_if(|(on, ..)| *on == bus);
        self.due.retain(|(_, what)| what.bus() != bus);
    }

    /// Starts the buses whose setup has changed, as every port must.
    fn restart_buses(&mut self) {
        for (bus, index) in (0..).zip(0..BUSES) {
            let generation = self.gateway.bus_setup(bus).map(|setup| setup.generation);
            if self.generations[index] != generation {
                self.generations[index] = generation;
                self.drop_frames(bus);
                self.bus_state(bus, if self.shorted { BusState::BusOff } else { BusState::Active });
            }
        }
    }

    /// A frame from a motor, now.
    pub fn receive(&mut self, bus: u8, text: &str) {
        match text.split_once('#') {
            Some((id, data)) => {
                let id = u16::from_str_radix(id, 16).unwrap();
                let frame = CanFrame::standard(id, &unhex(data)).unwrap();
                self.handle(Event::CanReceived { bus, frame });
            }
            None => {
                let bytes = unhex(text);
                self.line.1 += bytes.len();
                let (own, heard) = self.line;
                let ends = |next: &str| heard == own + unhex(next).len();
                let next = self.behind_reply.take_if(|(.., next)| ends(next));
                let then = if next.is_some() { Then::Frame } else { Then::Bytes };
                if let Some((bus, slot, text)) = next {
                    self.begins(bus, slot, text);
                }
                self.handle(Event::SerialReceived { bus, bytes: &bytes, then });
            }
        }
    }

    /// A frame is on its bus, or waits in the controller.
    fn begins(&mut self, bus: u8, slot: u8, text: String) {
        self.wire.push((self.now_us, bus, text.clone()));
        if !is_can(&text) {
            self.line = (unhex(&text).len(), 0);
        }
        if self.is_held_up(&text) {
            self.held.push((bus, slot, text));
        } else {
            self.due.push((self.now_us + FRAME_US, Due::Left(bus, slot, text)));
        }
    }

    /// Lets time pass.
    pub fn run(&mut self, us: u64) {
        let end = self.now_us + us;
        while !self.starts_anew {
            let wire = self.due.iter().map(|(at, _)| *at).enumerate().min_by_key(|(_, at)| *at);
            let core = self.gateway.next_deadline().map(Instant::as_micros);
            let next =
                [wire.map(|(_, at)| at), core].into_iter().flatten().filter(|at| *at <= end).min();
            let Some(next) = next else { break };
            self.now_us = self.now_us.max(next);
            match wire.filter(|(_, at)| *at <= self.now_us) {
                Some((index, _)) => self.happens(index),
                None => self.handle(Event::Tick),
            }
        }
        self.now_us = end;
        self.handle(Event::Tick);
    }

    /// Lets time pass in which the buses go on and no tick comes.
    pub fn run_without_ticks(&mut self, us: u64) {
        let end = self.now_us + us;
        loop {
            let due = self.due.iter().map(|(at, _)| *at).enumerate();
            let Some((index, at)) = due.min_by_key(|(_, at)| *at).filter(|(_, at)| *at <= end)
            else {
                break;
            };
            self.now_us = self.now_us.max(at);
            self.happens(index);
        }
        self.now_us = end;
    }

    /// What is due on a wire happens.
    fn happens(&mut self, index: usize) {
        match self.due.remove(index).1 {
            Due::Left(bus, slot, text) => self.left(bus, slot, &text),
            Due::Reply(bus, text) => self.receive(bus, &text),
        }
    }

    fn left(&mut self, bus: u8, slot: u8, text: &str) {
        self.left.push((self.now_us, bus, text.to_owned()));
        let is_serial = !is_can(text);
        if is_serial && self.echo == Echo::Clean {
            self.receive(bus, text);
        }
        self.handle(Event::Transmitted { bus, slot });
        if is_serial && self.echo == Echo::BehindNoise {
            self.receive(bus, &format!("FF{text}"));
        }
        if let Some(reply) = (self.motor)(self.now_us, bus, text) {
            self.due.push((self.now_us + MOTOR_US + FRAME_US, Due::Reply(bus, reply)));
        }
    }

    /// Frames that wait for an acknowledgement are given back when the core asks for them; those
    /// that are on the wire go on.
    fn give_back(&mut self) {
        for bus in 0..3 {
            self.note_named();
            while let Some(slot) = self.gateway.poll_cancel(self.now(), bus) {
                self.assert_named(bus);
                let held = self.held.len();
                self.held.retain(|(on, of, _)| (*on, *of) != (bus, slot));
                let waited = self.behind_reply.take_if(|(on, of, _)| (*on, *of) == (bus, slot));
                if (waited.is_some() || self.held.len() < held) && !self.stubborn {
                    self.take_in(Event::Cancelled { bus, slot });
                }
            }
        }
    }

    /// A poll of one bus may name others.
    fn note_named(&mut self) {
        self.named = self.named.with(self.gateway.take_changes().buses);
    }

    /// Who polls only the buses that the core names misses nothing.
    fn assert_named(&self, bus: u8) {
        assert!(self.named.has(bus), "{} µs: bus {bus} has a frame and was not named", self.now_us);
    }

    fn drain(&mut self) {
        self.give_back();
        for bus in 0..3 {
            self.note_named();
            let mut goes_alone = false;
            while let Some(Transmit { slot, frame, is_alone, behind_reply }) =
                self.gateway.poll_transmit(self.now(), bus)
            {
                assert!(!goes_alone, "bus {bus} has a frame beside one that goes alone");
                goes_alone = is_alone;
                self.assert_named(bus);
                let text = match frame {
                    Outgoing::Can(frame) => can_text(&frame),
                    Outgoing::Serial(bytes) => hex(&bytes),
                };
                match behind_reply {
                    true => self.behind_reply = Some((bus, slot, text)),
                    false => self.begins(bus, slot, text),
                }
            }
        }
        self.named = self.gateway.take_changes().buses;
        let mut out = [0; MAX_FRAME];
        while let Some(length) =
            self.gateway.poll_host(0, &mut out, &mut |index, word| self.memory[index] = word)
        {
            for byte in &out[..length] {
                let Some(Ok(frame)) = self.deframer.push(*byte) else { continue };
                self.said.push(match frame.kind {
                    Kind::Reply => Said::Reply(
                        frame.sequence,
                        Box::new(Reply::decode(frame.number, frame.body).unwrap()),
                    ),
                    Kind::Error => Said::Error(
                        frame.sequence,
                        Error::decode(frame.number, frame.body).unwrap(),
                    ),
                    Kind::Event if frame.number == CycleEvent::NUMBER => {
                        Said::Cycle(Box::new(CycleMessage::decode(frame.body).unwrap()))
                    }
                    Kind::Event => {
                        Said::Event(EventMessage::decode(frame.number, frame.body).unwrap().event)
                    }
                    Kind::Request | Kind::WatcherRequest => {
                        panic!("a gateway sends no requests")
                    }
                });
            }
        }
    }

    /// Texts sent on a bus at or after a time.
    pub fn sent_since(&self, bus: u8, since_us: u64) -> Vec<&str> {
        let frames = self.wire.iter().filter(|(at, on, _)| *at >= since_us && *on == bus);
        frames.map(|(_, _, text)| text.as_str()).collect()
    }

    /// Longest time between two frames on a bus whose texts begin so, sent at or after a time.
    pub fn longest_gap_us(&self, bus: u8, since_us: u64, begins: &str) -> u64 {
        let wanted = self
            .wire
            .iter()
            .filter(|(at, on, text)| *at >= since_us && *on == bus && text.starts_with(begins));
        let times: Vec<u64> = wanted.map(|(at, ..)| *at).collect();
        times.windows(2).map(|pair| pair[1] - pair[0]).max().expect("two frames")
    }

    pub fn events(&self) -> Vec<&HostEvent> {
        let events = self.said.iter().filter_map(|said| match said {
            Said::Event(event) => Some(event),
            _ => None,
        });
        events.collect()
    }
}
