//! What the outside does to a board: what a recording has of it, as causes on wires and pins.

use std::collections::HashMap;
use std::time::Duration;

use flight_recorder::Call;
use gateway::{Event, Instant, Outgoing, Transmit};
use host_protocol::{BusState, CanFrame, RawFrame};
use virtual_stm32::fdcan::Wiring;

use super::answers::Answers;
use crate::nodes::to_bus;
use crate::rs485_line::BITS_PER_BYTE;

/// What an interrupt and the task that it wakes take until the core is told, about.
pub const NOTICED: Duration = Duration::from_micros(8);

/// A frame that follows at once is offered so long before: less than the shortest one takes, so that
/// none overtakes another.
const WAITED: Duration = Duration::from_micros(40);

/// A bus with errors on which no frame has passed for so long is dead, µs.
const DEAD_US: u64 = 5_000;
/// It is whole so long before the next frame has passed: the frame itself, and one that failed, µs.
const MENDED_US: u64 = 1_000;
const FOR_EVER: Instant = Instant::from_micros(u64::MAX - 1);

/// Something that happens outside.
#[derive(Debug, Clone, PartialEq)]
pub enum Cause {
    /// A frame comes on a CAN bus that answers nothing.
    Frame {
        /// Index of the bus.
        bus: u8,
        /// What comes.
        frame: CanFrame,
    },
    /// Bytes of others come on an RS485 bus that answer nothing.
    Bytes {
        /// Index of the bus.
        bus: u8,
        /// What comes.
        bytes: Vec<u8>,
        /// Without stop bits.
        damaged: bool,
    },
    /// A host sends bytes.
    Host {
        /// Index of the link.
        link: u8,
        /// What it sends.
        bytes: Vec<u8>,
    },
    /// The cable of a CAN bus is shorted, cut, or whole again.
    Cable {
        /// Index of the bus.
        bus: u8,
        /// How it is.
        cable: Wiring,
    },
    /// The chain of emergency stops opens, or closes.
    EStop {
        /// Whether it is open.
        open: bool,
    },
}

/// A cause, and when the gateway was told of what came of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Stimulus {
    /// In the gateway's own time.
    pub told: Instant,
    /// What happened.
    pub cause: Cause,
    /// It is a frame that came right behind another: one of the gateway's waited for a gap.
    pub at_once: bool,
}

/// A call that was played, and the frame that it gave.
#[derive(Debug, Clone, PartialEq)]
pub struct Played<'a> {
    /// When it was made, in the gateway's own time.
    pub at: Instant,
    /// The call.
    pub call: Call<'a>,
    /// The frame for a bus.
    pub transmit: Option<Transmit>,
}

/// What is known of a bus, call by call.
#[derive(Debug, Clone, Default)]
struct Bus {
    /// Bytes of the gateway that come back, on RS485.
    echo: usize,
    /// What was asked there.
    answers: Answers,
    /// What each slot holds, and since when.
    slots: HashMap<u8, (Instant, RawFrame)>,
    /// When the last frame passed.
    passed: Option<Instant>,
    /// Until when no frame passes.
    dead_until: Option<Instant>,
}

/// What the outside did.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outside {
    /// By itself, in the order in which the gateway was told.
    pub causes: Vec<Stimulus>,
    /// When it was asked: of each bus.
    pub answers: Vec<Answers>,
    /// What nothing here can bring about, and when the gateway was told of it.
    pub left_out: Vec<(Instant, String)>,
}

/// What happened outside. `buses`: how many there are.
pub fn outside(calls: &[Played<'_>], buses: usize) -> Outside {
    let mut buses = vec![Bus::default(); buses];
    let (mut causes, mut left_out) = (Vec::new(), Vec::new());
    for (index, Played { at: told, call, transmit }) in calls.iter().enumerate() {
        let mut add = |told, cause| causes.push(Stimulus { told, cause, at_once: false });
        match call {
            Call::PollTransmit { bus } => {
                let Some(Transmit { slot, frame, .. }) = transmit else { continue };
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                let frame = match frame {
                    Outgoing::Can(frame) => RawFrame::Can(*frame),
                    Outgoing::Serial(bytes) => {
                        known.echo += bytes.len();
                        RawFrame::Serial(bytes.iter().copied().collect())
                    }
                };
                known.slots.insert(*slot, (*told, frame));
            }
            Call::Handle(Event::Transmitted { bus, slot }) => {
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                known.passed = Some(*told);
                if let Some((_, request)) = known.slots.remove(slot) {
                    known.answers.asked(*told, request);
                }
            }
            Call::Handle(Event::Cancelled { bus, slot }) => {
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                known.slots.remove(slot);
            }
            Call::Handle(Event::CanReceived { bus, frame }) => {
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                let before = known.passed.replace(*told);
                if !known.answers.came(*told, &RawFrame::Can(*frame)) {
                    let at_once = known.slots.values().any(|(since, _)| Some(*since) < before);
                    let cause = Cause::Frame { bus: *bus, frame: *frame };
                    causes.push(Stimulus { told: *told, cause, at_once });
                }
            }
            Call::Handle(Event::SerialReceived { bus, bytes, .. }) => {
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                let own = bytes.len().min(known.echo);
                known.echo -= own;
                if let Some(others) = bytes.get(own..).filter(|others| !others.is_empty())
                    && !known.answers.bytes_came(*told, others)
                {
                    add(*told, Cause::Bytes { bus: *bus, bytes: others.to_vec(), damaged: false });
                }
            }
            Call::Handle(Event::HostBytes { link, bytes }) => {
                add(*told, Cause::Host { link: *link, bytes: bytes.to_vec() });
            }
            Call::Handle(Event::EStopInput { open }) => add(*told, Cause::EStop { open: *open }),
            Call::Handle(event @ Event::BusState { bus, state, .. }) => {
                let Some(known) = buses.get_mut(usize::from(*bus)) else { continue };
                if *state == BusState::Active || known.dead_until.is_some_and(|end| *told <= end) {
                    continue;
                }
                // Broken behind the last frame that passed, whole before the next.
                let since = known.passed.unwrap_or(*told);
                let Some((cable, end)) = dead_stretch(&calls[index..], *bus) else {
                    left_out.push((*told, format!("{event:?} at {} us", told.as_micros())));
                    continue;
                };
                known.dead_until = Some(end.unwrap_or(FOR_EVER));
                add(since, Cause::Cable { bus: *bus, cable });
                if let Some(end) = end {
                    let whole = Instant::from_micros(end.as_micros().saturating_sub(MENDED_US));
                    add(whole, Cause::Cable { bus: *bus, cable: Wiring::Connected });
                }
            }
            Call::Handle(Event::ReceiveOverflow { bus, .. })
                if is_noise(&mut causes, *bus, *told) => {}
            Call::Handle(event @ (Event::HostLineError { .. } | Event::ReceiveOverflow { .. })) => {
                left_out.push((*told, format!("{event:?} at {} us", told.as_micros())))
            }
            _ => {}
        }
    }
    causes.sort_by_key(|cause: &Stimulus| cause.told);
    Outside { causes, answers: buses.into_iter().map(|bus| bus.answers).collect(), left_out }
}

/// Whether an error is that of bytes which have just come: then they came damaged.
fn is_noise(causes: &mut [Stimulus], of: u8, now: Instant) -> bool {
    match causes.last_mut() {
        Some(Stimulus { told, cause: Cause::Bytes { bus, damaged, .. }, .. })
            if *bus == of && *told == now =>
        {
            *damaged = true;
            true
        }
        _ => false,
    }
}

/// What a bus that has errors has come to until the next frame passes, and when that was, if one
/// did; `None` where frames go on passing.
fn dead_stretch(calls: &[Played<'_>], bus: u8) -> Option<(Wiring, Option<Instant>)> {
    let since = calls.first()?.at.as_micros();
    let mut cable = Wiring::Cut;
    for Played { at, call, .. } in calls {
        match call {
            Call::Handle(Event::BusState { bus: of, state: BusState::BusOff, .. })
                if *of == bus =>
            {
                cable = Wiring::Shorted;
            }
            Call::Handle(
                Event::CanReceived { bus: of, .. } | Event::Transmitted { bus: of, .. },
            ) if *of == bus => {
                let dead = cable == Wiring::Shorted || at.as_micros() - since >= DEAD_US;
                return dead.then_some((cable, Some(*at)));
            }
            _ => {}
        }
    }
    Some((cable, None))
}

impl Cause {
    /// The line that it takes a part of: a bus or a host link; those of a pin or a cable take none.
    fn line(&self) -> Option<Line> {
        match *self {
            Self::Frame { bus, .. } | Self::Bytes { bus, .. } => Some(Line::Bus(bus)),
            Self::Host { link, .. } => Some(Line::Host(link)),
            Self::EStop { .. } | Self::Cable { .. } => None,
        }
    }

    /// How long it takes until the gateway can be told of it. `bit`: how long one takes there.
    pub fn lasts(&self, bit: Duration) -> Duration {
        /// Of a press of the button, before it counts (src/tasks/safety.rs).
        const PRESSED: Duration = Duration::from_millis(1);
        let bits = |bits: u64| bit * u32::try_from(bits).unwrap_or(u32::MAX);
        match self {
            Self::Frame { frame, .. } => bits(to_bus(frame).bits_until_valid().into()),
            Self::Bytes { bytes, .. } | Self::Host { bytes, .. } => {
                bits(bytes.len() as u64 * BITS_PER_BYTE)
            }
            Self::EStop { open: true } => PRESSED,
            Self::EStop { open: false } | Self::Cable { .. } => Duration::ZERO,
        }
    }
}

/// What frames and bytes come on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Line {
    /// A bus, by its index.
    Bus(u8),
    /// A host link, by its index.
    Host(u8),
}

/// How fast a line is.
#[derive(Debug, Clone, Copy)]
pub struct Pace {
    /// How long a bit takes.
    pub bit: Duration,
    /// From the last bit until the core is told, where nothing else is to be done.
    pub noticed: Duration,
}

impl Pace {
    /// Of what takes no part of a line.
    const NO_LINE: Self = Self { bit: Duration::ZERO, noticed: NOTICED };
}

/// When each begins, in the order in which they do, ns of the gateway's time: as late as the
/// gateway can have been told of it and of what follows on the line. Who was busy was told late.
pub fn begins(stimuli: Vec<Stimulus>, pace: impl Fn(Line) -> Pace) -> Vec<(i64, Stimulus)> {
    let mut begins = HashMap::new();
    let mut timed: Vec<(i64, Stimulus)> = Vec::with_capacity(stimuli.len());
    for stimulus in stimuli.into_iter().rev() {
        let line = stimulus.cause.line();
        let Pace { bit, noticed } = line.map_or(Pace::NO_LINE, &pace);
        let lasts = nanos(stimulus.cause.lasts(bit));
        let told = nanos(Duration::from_micros(stimulus.told.as_micros())) - nanos(noticed);
        let next = line.and_then(|line| begins.get(&line)).copied().unwrap_or(i64::MAX);
        let begin = told.min(next) - lasts;
        if let Some(line) = line {
            begins.insert(line, begin);
        }
        let waited = if stimulus.at_once { nanos(WAITED) } else { 0 };
        timed.push((begin - waited, stimulus));
    }
    timed.reverse();
    timed.sort_by_key(|(begin, _)| *begin);
    timed
}

pub fn nanos(duration: Duration) -> i64 {
    i64::try_from(duration.as_nanos()).unwrap_or(i64::MAX)
}

#[cfg(test)]
#[path = "tests/stimulus.rs"]
mod tests;
