//! What a program is told by itself: events in its own numbering, samples as it subscribed, and how
//! many it lost.

use std::collections::{BTreeMap, VecDeque};

use host_protocol::requests::Subscribe;
use host_protocol::{
    CycleEvent, Event, EventMessage, FrameError, Kind, MAX_BODY, MAX_FRAME, StateField,
    StateFields, encode_body,
};

/// Events that wait for a program that does not read; the oldest make room.
const MAX_EVENTS: usize = 256;
/// Reasons of [`FrameError`], numbered from 1 without gaps.
const REASONS: usize = FrameError::ALL.len();

/// An event of the gateway.
#[derive(Debug, Clone)]
pub(crate) struct Told {
    number: u16,
    /// Events that were lost before it.
    lost: u32,
    time_us: u64,
    /// The body behind `dropped`: what it means a later version may know alone.
    rest: Vec<u8>,
    sample: Option<Event>,
    /// Whoever had authority has it no more.
    ends_authority: bool,
}

impl Told {
    /// Reads an event; `None` where its body does not begin as every event's does.
    pub fn read(number: u16, body: &[u8]) -> Option<Self> {
        let (lost, rest) = postcard::take_from_bytes::<u32>(body).ok()?;
        let EventMessage { time_us, event, .. } = EventMessage::decode(number, body).ok()?;
        let ends_authority = matches!(event, Event::AuthorityLost { .. });
        let sample = matches!(event, Event::Sample { .. }).then_some(event);
        Some(Self { number, lost, time_us, rest: rest.to_vec(), sample, ends_authority })
    }

    pub fn ends_authority(&self) -> bool {
        self.ends_authority
    }

    pub fn time_us(&self) -> u64 {
        self.time_us
    }
}

/// That of which a newer event takes the place of an older one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Latest {
    /// A sample of an axis.
    Sample(u8),
    /// A period of the free-running cycle.
    Cycle,
}

/// An event that waits.
#[derive(Debug)]
struct Waiting {
    number: u16,
    rest: Vec<u8>,
    latest: Option<Latest>,
}

/// The events of one program.
#[derive(Debug, Default)]
pub(crate) struct Inbox {
    /// It has said hello.
    is_open: bool,
    waiting: VecDeque<Waiting>,
    /// Lost since the last one sent.
    dropped: u32,
    sequence: u16,
    rejected: [u32; REASONS],
    requests_dropped: u32,
    /// When the next sample of each axis is due, µs of the gateway.
    due_us: BTreeMap<u8, u64>,
}

impl Inbox {
    pub fn open(&mut self) {
        self.is_open = true;
    }

    /// Bytes between two delimiters were no frame.
    pub fn reject(&mut self, error: &FrameError) {
        let place = usize::from(error.number()).saturating_sub(1);
        if let Some(count) = self.rejected.get_mut(place) {
            *count = count.saturating_add(1);
        }
    }

    /// A request had no place.
    pub fn request_dropped(&mut self) {
        self.requests_dropped = self.requests_dropped.saturating_add(1);
    }

    /// Events got lost on the cable.
    pub fn count_lost(&mut self, count: u32) {
        if self.is_open {
            self.dropped = self.dropped.saturating_add(count);
        }
    }

    /// `period_us`: how often the gateway samples.
    pub fn tell(&mut self, told: &Told, subscription: Option<&Subscribe>, period_us: u32) {
        if !self.is_open {
            return;
        }
        self.count_lost(told.lost);
        let Some(event) = &told.sample else {
            let latest = (told.number == CycleEvent::NUMBER).then_some(Latest::Cycle);
            return self.wait(told.number, told.rest.clone(), latest);
        };
        let Some(subscription) = subscription else { return };
        let Event::Sample { axis, .. } = *event else { return };
        if subscription.axes.checked_shr(axis.into()).unwrap_or(0) & 1 == 0 {
            return;
        }
        let (time_us, period) = (told.time_us, u64::from(subscription.period_us));
        let due = self.due_us.entry(axis).or_insert(time_us);
        // The one next to its time, and none before that.
        if time_us + u64::from(period_us) / 2 < *due {
            return;
        }
        *due = (*due + period).max(time_us + period.div_ceil(2));
        let rest = body_of(&only(event, subscription.fields), time_us);
        self.wait(told.number, rest, Some(Latest::Sample(axis)));
    }

    /// A new subscription: its samples are due at once.
    pub fn sample_anew(&mut self) {
        self.due_us.clear();
    }

    fn wait(&mut self, number: u16, rest: Vec<u8>, latest: Option<Latest>) {
        let older = |one: &Waiting| latest.is_some() && one.latest == latest;
        if let Some(place) = self.waiting.iter().position(older) {
            self.waiting.remove(place);
            self.dropped = self.dropped.saturating_add(1);
        }
        if self.waiting.len() >= MAX_EVENTS {
            self.waiting.pop_front();
            self.dropped = self.dropped.saturating_add(1);
        }
        self.waiting.push_back(Waiting { number, rest, latest });
    }

    /// The next event as a frame.
    pub fn next_frame(&mut self, gateway_us: u64) -> Option<Vec<u8>> {
        if !self.is_open {
            return None;
        }
        let (number, rest) = match self.waiting.pop_front() {
            Some(Waiting { number, rest, .. }) => (number, rest),
            None => {
                let event = self.next_tally()?;
                (event.number(), body_of(&event, gateway_us))
            }
        };
        let dropped = std::mem::take(&mut self.dropped);
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        let mut body = [0; MAX_BODY];
        let length = postcard::to_slice(&dropped, &mut body).map_or(0, |dropped| dropped.len());
        let whole = body.get_mut(length..length + rest.len())?;
        whole.copy_from_slice(&rest);
        let mut out = [0; MAX_FRAME];
        let body = body.get(..length + rest.len())?;
        let length = encode_body(Kind::Event, sequence, number, body, &mut out).ok()?;
        out.get(..length).map(<[u8]>::to_vec)
    }

    fn next_tally(&mut self) -> Option<Event> {
        for (reason, count) in (1..).zip(&mut self.rejected) {
            if *count > 0 {
                return Some(Event::FrameRejected { reason, count: std::mem::take(count) });
            }
        }
        let count = std::mem::take(&mut self.requests_dropped);
        (count > 0).then_some(Event::RequestDropped { count })
    }
}

/// The body of an event behind `dropped`.
fn body_of(event: &Event, time_us: u64) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = event.encode_frame(0, 0, time_us, &mut out).unwrap_or(0);
    let mut frame = out.get(..length).unwrap_or_default();
    let mut deframer = host_protocol::Deframer::new();
    let Some(Ok(frame)) = deframer.take(&mut frame) else { return Vec::new() };
    // `dropped` is 0: one byte.
    frame.body.get(1..).unwrap_or_default().to_vec()
}

/// A sample with these fields alone.
fn only(sample: &Event, fields: StateFields) -> Event {
    let mut event = *sample;
    if let Event::Sample {
        position_rad,
        velocity_rad_s,
        current_a,
        voltage_v,
        motor_temperature_c,
        driver_temperature_c,
        faults,
        ..
    } = &mut event
    {
        let readings = [
            (StateField::Position, position_rad),
            (StateField::Velocity, velocity_rad_s),
            (StateField::Current, current_a),
            (StateField::Voltage, voltage_v),
            (StateField::MotorTemperature, motor_temperature_c),
            (StateField::DriverTemperature, driver_temperature_c),
        ];
        for (field, reading) in readings {
            *reading = reading.filter(|_| fields.contains(field));
        }
        *faults = faults.filter(|_| fields.contains(StateField::Faults));
    }
    event
}
