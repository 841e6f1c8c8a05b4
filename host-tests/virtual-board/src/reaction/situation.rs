//! What a bus is and what it carries when the command comes.

use std::fmt;
use std::ops::Range;
use std::time::Duration;

use host_protocol::Protocol;

use crate::board::Board;

/// Axes on a bus at most.
pub(super) const MOST_AXES: u8 = 16;
/// Axes with D5 motors that the gateway takes on a bus: it sends each its setpoint every 20 ms.
const D5_AXES: u8 = 11;
/// Axes on each of many buses.
const TOGETHER: u8 = 4;
/// Our software (GUARANTEES G5: g).
const SOFTWARE: Duration = Duration::from_micros(100);
/// The first stop on a quiet CAN bus; on RS485 after it 20 idle bits.
const QUIET: Duration = Duration::from_micros(200);
/// Bits of the longest standard frame with its intermission (F), and of 13 bytes on RS485 (C).
const FRAME_BITS: u32 = 135;
const MESSAGE_BITS: u32 = 130;
/// Bits without a start bit that end a message on RS485.
const IDLE_BITS: u32 = 20;
/// What a stop waits of a reply window (W), at most.
const WINDOW: Duration = Duration::from_millis(1);
/// Different periods of the traffic that the phases are taken in.
const PERIODS: u32 = 16;
/// The same of a load that keeps axes from their motors.
const FEW_PERIODS: u32 = 3;
/// Phases under floods from hosts.
const FLOOD_PHASES: u32 = 4;
/// Frames between two of them.
const FRAMES_APART: u32 = 7;

/// The buses that the guarantees speak of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bus {
    /// RMD motors on CAN at 1 Mbit/s.
    Can,
    /// D5 motors on CAN at 210526 bit/s.
    SlowCan,
    /// RMD motors on RS485 at 115200 baud.
    Rs485,
    /// RMD motors on RS485 at 2 Mbaud.
    FastRs485,
    /// Four RMD motors on each CAN bus at 1 Mbit/s: all CAN buses count.
    Cans,
    /// The same, and four on RS485 at 2 Mbaud: the CAN buses count,
    CansBesideRs485,
    /// or RS485 does.
    Rs485BesideCans,
}

/// What it carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Load {
    Quiet,
    Own,
    /// A free-running cycle of all axes, as fast as the bus allows.
    Cycle,
    Foreign(Place),
    /// Nothing; but both computers send without a pause.
    Hosts(Flood),
    /// Both CAN buses carry foreign frames and the RS485 line noise, and both computers send
    /// requests, all without a pause.
    All,
}

/// What a computer sends without a pause, a command in between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flood {
    /// The shortest request, again and again.
    Requests,
    /// Any bytes.
    Garbage,
}

/// Where the id of another node lies among those of the axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    /// Behind the lowest: the first axis wins against it, and nobody else.
    BehindLowest,
    /// In the middle.
    Middle,
    /// Before the highest: the last axis alone loses against it.
    BeforeHighest,
    /// Behind all.
    BehindAll,
}

impl Load {
    const FLOODS: [Self; 3] =
        [Self::Hosts(Flood::Requests), Self::Hosts(Flood::Garbage), Self::All];

    /// What the computers send.
    pub(super) fn flood(self) -> Option<Flood> {
        match self {
            Self::Hosts(flood) => Some(flood),
            Self::All => Some(Flood::Requests),
            Self::Quiet | Self::Own | Self::Cycle | Self::Foreign(_) => None,
        }
    }
}

impl Place {
    const ALL: [Self; 4] = [Self::BehindLowest, Self::Middle, Self::BeforeHighest, Self::BehindAll];
}

/// One bus with its axes, of what may be many.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Part {
    pub(super) bus: Bus,
    /// Its number.
    pub(super) index: u8,
    /// Its axes: the first has its first node.
    pub(super) axes: Range<u8>,
}

impl Part {
    /// The axes and their nodes.
    pub(super) fn nodes(self) -> impl Iterator<Item = (u8, u8)> {
        let first = self.axes.start;
        self.axes.map(move |axis| (axis, self.bus.node(axis - first)))
    }
}

/// A bus with its axes, and its load.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Situation {
    pub(super) bus: Bus,
    pub(super) load: Load,
}

impl Bus {
    pub(super) const ALL: [Self; 7] = [
        Self::Can,
        Self::SlowCan,
        Self::Rs485,
        Self::FastRs485,
        Self::Cans,
        Self::CansBesideRs485,
        Self::Rs485BesideCans,
    ];

    /// Whether there are axes on all CAN buses.
    pub(super) fn is_of_many(self) -> bool {
        matches!(self, Self::Cans | Self::CansBesideRs485 | Self::Rs485BesideCans)
    }

    /// Those of one bus each that there are together, in the order of their axes.
    pub(super) fn parts(self) -> Vec<Part> {
        if !self.is_of_many() {
            return vec![Part { bus: self, index: self.index(), axes: 0..self.axes() }];
        }
        let rs485 = Board::chosen().rs485_bus();
        let can = (0..rs485).map(|index| (Self::Can, index));
        let line = (self != Self::Cans).then_some((Self::FastRs485, rs485));
        let part = |((bus, index), first)| Part { bus, index, axes: first..first + TOGETHER };
        can.chain(line).zip((0..).step_by(TOGETHER.into())).map(part).collect()
    }

    /// Those of them whose stops count.
    pub(super) fn counted(self) -> Vec<Part> {
        let parts = self.parts().into_iter();
        parts.filter(|part| part.bus.is_can() == self.is_can()).collect()
    }

    /// The number of the first that counts.
    pub(super) fn index(self) -> u8 {
        match self {
            Self::Can | Self::Cans | Self::CansBesideRs485 => 0,
            Self::SlowCan => 1,
            Self::Rs485 | Self::FastRs485 | Self::Rs485BesideCans => Board::chosen().rs485_bus(),
        }
    }

    pub(super) fn is_can(self) -> bool {
        matches!(self, Self::Can | Self::SlowCan | Self::Cans | Self::CansBesideRs485)
    }

    pub(super) fn bitrate(self) -> u32 {
        match self {
            Self::Can | Self::Cans | Self::CansBesideRs485 => 1_000_000,
            Self::SlowCan => 210_526,
            Self::Rs485 => 115_200,
            Self::FastRs485 | Self::Rs485BesideCans => 2_000_000,
        }
    }

    pub(super) fn protocol(self) -> Protocol {
        match self {
            Self::SlowCan => Protocol::D5,
            Self::Can
            | Self::Rs485
            | Self::FastRs485
            | Self::Cans
            | Self::CansBesideRs485
            | Self::Rs485BesideCans => Protocol::Rmd,
        }
    }

    /// The node of an axis: between two of them there is an id for a stranger.
    pub(super) fn node(self, axis: u8) -> u8 {
        if self.is_can() { 2 * axis + 1 } else { axis + 1 }
    }

    /// The id of what is sent to an axis.
    fn request_id(self, axis: u8) -> u16 {
        let base = if self.protocol() == Protocol::Rmd { 0x140 } else { 0 };
        base + u16::from(self.node(axis))
    }

    /// Axes on it; of many buses, on all of them.
    pub(super) fn axes(self) -> u8 {
        match self {
            Self::SlowCan => D5_AXES,
            Self::Can | Self::Rs485 | Self::FastRs485 => MOST_AXES,
            Self::Cans | Self::CansBesideRs485 | Self::Rs485BesideCans => {
                let parts = self.parts();
                parts.last().map_or(0, |part| part.axes.end)
            }
        }
    }

    /// Refresh and state polls of each axis with which they take what the gateway allows, µs. Each
    /// poll reads two things.
    pub(super) fn busy_periods_us(self) -> (u32, u32) {
        match self {
            Self::Can => (17_500, 17_500),
            Self::SlowCan => (20_000, 620_000),
            Self::Rs485 => (215_000, 215_000),
            Self::FastRs485 => (28_000, 28_000),
            Self::Cans | Self::CansBesideRs485 | Self::Rs485BesideCans => {
                unreachable!("a cycle is all that they carry")
            }
        }
    }

    /// The period of a free-running cycle of all axes that fills a CAN bus: 16 or 4 exchanges of
    /// 236 bits, and 11 of 254 bits, 5 % beside. RS485 takes longer for its four, which answer in
    /// turn: it has no pause.
    pub(super) fn cycle_period(self) -> Duration {
        Duration::from_micros(match self {
            Self::SlowCan => 14_000,
            _ if self.is_of_many() => 992,
            _ => 3_965,
        })
    }

    fn bits(self, bits: u32) -> Duration {
        Duration::from_nanos(u64::from(bits) * 1_000_000_000 / u64::from(self.bitrate()))
    }

    /// The longest message.
    pub(super) fn frame(self) -> Duration {
        self.bits(if self.is_can() { FRAME_BITS } else { MESSAGE_BITS })
    }
}

impl Situation {
    /// Every one that the table has.
    pub(super) fn all() -> Vec<Self> {
        let loads = |bus: Bus| {
            let is_alone = bus.is_can() && !bus.is_of_many();
            let places: &[Place] = if is_alone { &Place::ALL } else { &[] };
            let foreign = places.iter().map(|place| Load::Foreign(*place));
            let floods: &[Load] = if bus == Bus::Can { &Load::FLOODS } else { &[] };
            let own: &[Load] = match (bus.is_of_many(), bus.is_can()) {
                (true, _) => &[Load::Cycle],
                (_, true) => &[Load::Quiet, Load::Own, Load::Cycle],
                (_, false) => &[Load::Quiet, Load::Own],
            };
            let loads = own.iter().copied().chain(foreign).chain(floods.iter().copied());
            loads.map(move |load| Self { bus, load })
        };
        Bus::ALL.into_iter().flat_map(loads).collect()
    }

    /// Within which the k-th stop on the bus starts (GUARANTEES G5).
    pub(super) fn bound(self, k: u8) -> Duration {
        let Self { bus, load } = self;
        let (k, frame) = (u32::from(k), bus.frame());
        // The reply of a D5 has the id of its request: that of a lower node goes first.
        let is_own = matches!(load, Load::Own | Load::Cycle);
        let outranking = u32::from(bus == Bus::SlowCan && is_own);
        match (bus.is_can(), load, k) {
            (true, Load::Quiet, 1) => QUIET,
            // A D5's stop waits for a reply that is due, as that has its id.
            (true, ..) if bus == Bus::SlowCan && is_own => {
                SOFTWARE + WINDOW + frame * (2 * k - 1 + outranking)
            }
            (true, ..) => SOFTWARE + frame * (2 * k - 1 + outranking),
            (false, Load::Quiet, 1) => QUIET + bus.bits(IDLE_BITS),
            (false, ..) => SOFTWARE + bus.bits(IDLE_BITS) + (2 * frame + WINDOW) * k,
        }
    }

    /// The axes whose stops count and win against the load, bus by bus; the others have no bound.
    pub(super) fn counted(self) -> Vec<Range<u8>> {
        let axes =
            |part: Part| part.axes.start..part.axes.end.min(part.axes.start + self.winners());
        self.bus.counted().into_iter().map(axes).collect()
    }

    /// How many axes of a bus, from its first, win against the load.
    pub(super) fn winners(self) -> u8 {
        let axes = if self.bus.is_of_many() { TOGETHER } else { self.bus.axes() };
        match self.load {
            Load::Foreign(Place::BehindLowest) => 1,
            Load::Foreign(Place::Middle) => axes / 2,
            Load::Foreign(Place::BeforeHighest) => axes - 1,
            Load::Quiet
            | Load::Own
            | Load::Cycle
            | Load::Foreign(Place::BehindAll)
            | Load::Hosts(_)
            | Load::All => axes,
        }
    }

    /// How many phases are looked at where others have so many: a branch under a flood takes the
    /// emulator ten times as long. They are the first ones of always the same.
    pub(super) fn phases(self, phases: u32) -> u32 {
        if self.load.flood().is_some() { (phases / 8).clamp(1, FLOOD_PHASES) } else { phases }
    }

    /// The axis that is stopped alone in a phase.
    pub(super) fn stopped(self, phase: u32) -> u8 {
        let axes: Vec<u8> = self.counted().into_iter().flatten().collect();
        axes[phase as usize % axes.len()]
    }

    /// The id of the load: right behind the last of those that win against it.
    pub(super) fn load_id(self) -> u16 {
        match self.load {
            Load::Foreign(Place::BehindAll) | Load::All => 0x7FF,
            _ => self.bus.request_id(self.winners() - 1) + 1,
        }
    }

    /// How long after the snapshot the command of a phase is sent.
    pub(super) fn offset(self, phase: u32, phases: u32) -> Duration {
        let phases = if self.load.flood().is_some() { FLOOD_PHASES } else { phases };
        let within = self.bus.frame() * phase / phases;
        match self.load {
            Load::Quiet => within,
            Load::Own
            | Load::Cycle
            | Load::Foreign(Place::BehindAll)
            | Load::Hosts(_)
            | Load::All => within + self.bus.frame() * FRAMES_APART * (phase % PERIODS),
            // The load begins shortly before: an axis that it keeps from its motor trips by itself.
            Load::Foreign(_) => {
                within + self.bus.frame() * FRAMES_APART * (1 + phase % FEW_PERIODS)
            }
        }
    }
}

impl fmt::Display for Situation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.bus {
            Bus::Can | Bus::SlowCan => "CAN",
            Bus::Rs485 | Bus::FastRs485 => "RS485",
            Bus::Cans => "all CAN",
            Bus::CansBesideRs485 => "all CAN + RS485",
            Bus::Rs485BesideCans => "RS485 + all CAN",
        };
        let load = match self.load {
            Load::Quiet => "quiet",
            Load::Own => "own",
            Load::Cycle => "cycle",
            Load::Foreign(Place::BehindAll) => "foreign",
            Load::Foreign(Place::BehindLowest) => "behind lowest",
            Load::Foreign(Place::Middle) => "middle",
            Load::Foreign(Place::BeforeHighest) => "before highest",
            Load::Hosts(Flood::Requests) => "host requests",
            Load::Hosts(Flood::Garbage) => "host garbage",
            Load::All => "all floods",
        };
        write!(f, "{kind} {}, {load}", self.bus.bitrate())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn us(us: f64) -> Duration {
        Duration::from_secs_f64(us / 1e6)
    }

    #[track_caller]
    fn assert_bound(bus: Bus, load: Load, k: u8, expected: f64) {
        let bound = Situation { bus, load }.bound(k);
        assert!(bound.abs_diff(us(expected)) < us(1.0), "{bound:?}");
    }

    /// The numbers that GUARANTEES G5 gives.
    #[test]
    fn the_bounds_are_those_of_the_guarantees() {
        assert_bound(Bus::Can, Load::Quiet, 1, 200.0);
        assert_bound(Bus::SlowCan, Load::Quiet, 1, 200.0);
        assert_bound(Bus::Can, Load::Foreign(Place::Middle), 1, 235.0);
        assert_bound(Bus::Can, Load::Own, 16, 100.0 + 31.0 * 135.0);
        assert_bound(Bus::SlowCan, Load::Foreign(Place::BehindAll), 1, 741.3);
        assert_bound(Bus::Rs485, Load::Own, 1, 3530.6);
        assert_bound(Bus::FastRs485, Load::Own, 1, 1240.0);
        assert_bound(Bus::FastRs485, Load::Quiet, 1, 210.0);
        assert_bound(Bus::Can, Load::Hosts(Flood::Garbage), 1, 235.0);
        assert_bound(Bus::Can, Load::All, 16, 100.0 + 31.0 * 135.0);
        assert_bound(Bus::Cans, Load::Cycle, 4, 100.0 + 7.0 * 135.0);
        assert_bound(Bus::CansBesideRs485, Load::Cycle, 1, 235.0);
        assert_bound(Bus::Rs485BesideCans, Load::Cycle, 4, 4630.0);
    }

    /// What counts is what the name of a line begins with; every axis has a place.
    #[test]
    fn of_many_buses_those_count_that_are_named() {
        let counted = |bus| Situation { bus, load: Load::Cycle }.counted();
        let cans: u8 = Board::chosen().rs485_bus();
        let of_cans: Vec<_> = (0..cans).map(|bus| bus * 4..bus * 4 + 4).collect();
        assert_eq!(counted(Bus::Cans), of_cans);
        assert_eq!(counted(Bus::CansBesideRs485), of_cans);
        assert!(counted(Bus::Rs485BesideCans).into_iter().flatten().eq(cans * 4..cans * 4 + 4));
        assert_eq!((Bus::Cans.axes(), Bus::CansBesideRs485.axes()), (cans * 4, cans * 4 + 4));
        let line = Bus::Rs485BesideCans.parts().pop().unwrap();
        assert_eq!(line.index, cans);
        assert_eq!(line.nodes().map(|(_, node)| node).collect::<Vec<_>>(), [1, 2, 3, 4]);
        assert_eq!(
            Situation { bus: Bus::Rs485BesideCans, load: Load::Cycle }.stopped(5),
            cans * 4 + 1
        );
    }

    /// The ids of the axes are 0x141 to 0x15F, and 1 to 21, every other one.
    #[test]
    fn a_load_lies_between_two_axes() {
        let load = |bus, place| {
            let situation = Situation { bus, load: Load::Foreign(place) };
            (situation.load_id(), situation.winners())
        };
        assert_eq!(
            Place::ALL.map(|place| load(Bus::Can, place)),
            [(0x142, 1), (0x150, 8), (0x15E, 15), (0x7FF, 16)]
        );
        assert_eq!(
            Place::ALL.map(|place| load(Bus::SlowCan, place)),
            [(2, 1), (10, 5), (20, 10), (0x7FF, 11)]
        );
    }

    #[test]
    fn the_phases_are_spread_over_a_frame() {
        let quiet = Situation { bus: Bus::Can, load: Load::Quiet };
        assert_eq!(
            [0, 25, 49].map(|phase| quiet.offset(phase, 50)),
            [us(0.0), us(67.5), us(132.3)]
        );
        let own = Situation { bus: Bus::Can, load: Load::Own };
        assert_eq!(own.offset(17, 50), us(45.9) + us(945.0));
        let flood = Situation { bus: Bus::Can, load: Load::All };
        assert_eq!([5, 20, 1000].map(|phases| flood.phases(phases)), [1, 2, 4]);
        assert_eq!(flood.offset(1, 2), flood.offset(1, 4));
    }
}
