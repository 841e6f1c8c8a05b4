//! What is under way on the cable: under which number, for whom, and how much of it at a time.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use host_protocol::{Call, Kind, MAX_BODY, MAX_FRAME, encode_body, requests as ask};

use crate::ask::Ask;
use crate::multiplexer::ProgramId;

/// Requests under way at a time, of who commands and of all who watch: with one stop they are the 8
/// that a link of the gateway answers.
const COMMANDS: usize = 3;
const WATCHES: usize = 4;
/// Bytes on the cable at a time, for which a stop may wait 5.6 ms: those of one longest frame.
const BYTES: usize = MAX_FRAME;
/// How long one takes at 921600 bit/s.
const BYTE: Duration = Duration::from_nanos(10_851);
/// Stops under way; further ones, and the same ones again, wait for [`STOP_WAITS`].
const STOPS: usize = 8;
const STOP_WAITS: Duration = Duration::from_millis(20);
/// After the first time a request without a result no longer keeps others back, after the second
/// nothing is known of it any more: where the gateway answers by itself, where it asks motors or
/// its flash first, and a stop.
const AT_ONCE: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(1)];
const LATER: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(10)];
const STOP: [Duration; 2] = [STOP_WAITS, Duration::from_millis(200)];
/// Among so many others the gateway no longer knows a repeated request.
const REMEMBERED: u64 = 8;

/// Who waits for a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Asker {
    /// This request of a program.
    Program { id: ProgramId, order: u64 },
    /// The server itself; nobody, for a stop that is repeated.
    Server,
}

/// A request under way.
#[derive(Debug)]
pub(crate) struct Asked {
    pub asker: Asker,
    pub ask: Ask,
    /// It went out as a watcher's.
    pub watches: bool,
    /// Changes of who commands before it.
    pub claims: u64,
    frame: Vec<u8>,
    /// Requests before it.
    order: u64,
    at: Duration,
}

/// A frame of which nothing says yet that it has passed the cable.
#[derive(Debug)]
struct OnCable {
    bytes: usize,
    /// A result of this request, or of a later one, says so.
    order: u64,
    /// By then it has passed in any case.
    passed_at: Duration,
}

/// The requests under way.
#[derive(Debug, Default)]
pub(crate) struct Cable {
    asked: HashMap<u16, Asked>,
    on_cable: VecDeque<OnCable>,
    sequence: u16,
    written: u64,
}

impl Cable {
    pub fn starting_at(sequence: u16) -> Self {
        Self { sequence, ..Self::default() }
    }

    /// Puts a request under way and returns its number and frame.
    pub fn ask(
        &mut self,
        now: Duration,
        asker: Asker,
        ask: Ask,
        watches: bool,
        claims: u64,
    ) -> (u16, Vec<u8>) {
        while self.asked.contains_key(&self.sequence) {
            self.sequence = self.sequence.wrapping_add(1);
        }
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let kind = if watches { Kind::WatcherRequest } else { Kind::Request };
        let mut out = [0; MAX_FRAME];
        // It fits: it came in a frame.
        let length = encode_body(kind, sequence, ask.number, &ask.body, &mut out).unwrap_or(0);
        let frame = out.get(..length).unwrap_or_default().to_vec();
        let order = self.written;
        self.written += 1;
        let asked = Asked { asker, ask, watches, claims, frame: frame.clone(), order, at: now };
        self.asked.insert(sequence, asked);
        self.put(now, order, frame.len());
        (sequence, frame)
    }

    /// The request under way under this number.
    pub fn asked(&self, sequence: u16) -> Option<&Asked> {
        self.asked.get(&sequence)
    }

    /// The same bytes once more, unless the gateway could take them for a new request that acts.
    pub fn again(&mut self, now: Duration, sequence: u16) -> Option<Vec<u8>> {
        let written = self.written;
        let asked = self.asked.get_mut(&sequence)?;
        if written - asked.order >= REMEMBERED && acts_each_time(asked.ask.number) {
            return None;
        }
        asked.at = now;
        let frame = asked.frame.clone();
        // Results of what is asked from here on come behind it.
        self.put(now, written, frame.len());
        Some(frame)
    }

    /// The request that a result is for, which has passed the cable with all before it.
    pub fn take(&mut self, now: Duration, sequence: u16) -> Option<Asked> {
        let asked = self.asked.remove(&sequence)?;
        while self.on_cable.pop_front_if(|frame| frame.order <= asked.order).is_some() {}
        let mut passed_at = now;
        for frame in &mut self.on_cable {
            passed_at += takes(frame.bytes);
            frame.passed_at = frame.passed_at.min(passed_at);
        }
        Some(asked)
    }

    fn put(&mut self, now: Duration, order: u64, bytes: usize) {
        self.drop_passed(now);
        let begins = self.on_cable.back().map_or(now, |before| before.passed_at.max(now));
        self.on_cable.push_back(OnCable { bytes, order, passed_at: begins + takes(bytes) });
    }

    fn drop_passed(&mut self, now: Duration) {
        while self.on_cable.pop_front_if(|frame| frame.passed_at <= now).is_some() {}
    }

    pub fn clear(&mut self) {
        self.asked.clear();
        self.on_cable.clear();
    }

    /// What has had no result for long gets none any more: who asked for it.
    pub fn forget(&mut self, now: Duration) -> Vec<Asker> {
        let forgotten = self.asked.extract_if(|_, asked| now >= asked.at + patience(&asked.ask)[1]);
        forgotten.map(|(_, asked)| asked.asker).collect()
    }

    fn under_way(&self, now: Duration) -> impl Iterator<Item = &Asked> {
        self.asked.values().filter(move |asked| now < asked.at + patience(&asked.ask)[0])
    }

    /// Whether one more request of who commands, or of who watches, may be under way.
    pub fn has_room(&self, now: Duration, watches: bool) -> bool {
        let alike = |asked: &&Asked| !asked.ask.stops() && asked.watches == watches;
        self.under_way(now).filter(alike).count() < if watches { WATCHES } else { COMMANDS }
    }

    /// Whether a request with a body of so many bytes keeps a stop behind it from waiting too long.
    pub fn is_clear_for(&mut self, now: Duration, body: usize) -> bool {
        self.drop_passed(now);
        let bytes: usize = self.on_cable.iter().map(|frame| frame.bytes).sum();
        bytes + body + (MAX_FRAME - MAX_BODY) <= BYTES
    }

    /// Whether the stop under way under this number went out so lately that it waits to go again.
    pub fn has_just_gone(&self, now: Duration, sequence: u16) -> bool {
        self.asked.get(&sequence).is_some_and(|asked| now < asked.at + STOP_WAITS)
    }

    /// Whether one more stop may go out.
    pub fn has_room_for_stop(&self, now: Duration) -> bool {
        self.under_way(now).filter(|asked| asked.ask.stops()).count() < STOPS
    }
}

/// How long so many bytes are on the cable.
fn takes(bytes: usize) -> Duration {
    BYTE * u32::try_from(bytes).unwrap_or(u32::MAX)
}

/// How long to wait for its result.
fn patience(ask: &Ask) -> [Duration; 2] {
    let is_answered_at_once = [
        ask::Ping::NUMBER,
        ask::Setpoint::NUMBER,
        ask::Cycle::NUMBER,
        ask::TakeAuthority::NUMBER,
        ask::GatewayStatus::NUMBER,
        ask::BusStatus::NUMBER,
        ask::ListAxes::NUMBER,
        ask::ReadState::NUMBER,
    ]
    .contains(&ask.number);
    match ask.stops() {
        true => STOP,
        false if is_answered_at_once => AT_ONCE,
        false => LATER,
    }
}

/// Whether a request that the gateway does not know for a repeated one does something again that
/// it should do once.
fn acts_each_time(number: u16) -> bool {
    ![
        ask::Ping::NUMBER,
        ask::Hello::NUMBER,
        ask::TakeAuthority::NUMBER,
        ask::ReleaseAuthority::NUMBER,
        ask::BusStatus::NUMBER,
        ask::GatewayStatus::NUMBER,
        ask::ReadGatewayParameter::NUMBER,
        ask::ReadAxisParameter::NUMBER,
        ask::ReadAxisSettings::NUMBER,
        ask::ReadNames::NUMBER,
        ask::ReadImage::NUMBER,
        ask::ListAxes::NUMBER,
        ask::ReadState::NUMBER,
        ask::Recognise::NUMBER,
        ask::Subscribe::NUMBER,
        ask::ReadIncidents::NUMBER,
        ask::ReadCrashReport::NUMBER,
        ask::ReadFlightRecord::NUMBER,
        ask::Disarm::NUMBER,
        ask::Stop::NUMBER,
        ask::EStop::NUMBER,
    ]
    .contains(&number)
}
