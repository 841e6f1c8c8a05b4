//! The cycle: what its messages hold beside plain fields, as short as a line of 2 Mbaud wants it.

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::axis::AxisState;
use crate::errors::ERRORS;
use crate::protocol::{StateField, StateFields};
use crate::replies::CycleReport;
use crate::text::Bytes;
use crate::{MAX_FRAME, MaxSize, Reply, Request, Setpoint};

/// Axes of one cycle.
pub const MAX_CYCLE_AXES: usize = 16;
/// Bytes that the state of one axis takes at most: head 1, error 3, age 2, position 4, velocity 4,
/// current, voltage and two temperatures 3 each, faults 4.
const MAX_STATE: usize = 30;
/// Bytes of the states of one [`CycleReport`].
pub const MAX_STATES: usize = MAX_CYCLE_AXES * MAX_STATE;

/// One unit of an age, µs.
const AGE_UNIT_US: u32 = 10;
/// An age in its units that two bytes hold; older is told as this old.
const MAX_AGE: u16 = (1 << 14) - 1;
/// The largest value in thousandths to both sides of zero that three bytes hold.
const THREE_BYTES: i32 = (1 << 20) - 1;
/// And that four bytes hold, for speeds.
const FOUR_BYTES: i32 = (1 << 27) - 1;

/// A u32 that always takes four bytes, little-endian: a random number and a time are seldom
/// shorter as a varint, and mostly longer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FixedU32(pub u32);

impl Serialize for FixedU32 {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.to_le_bytes().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for FixedU32 {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <[u8; 4]>::deserialize(deserializer).map(|bytes| Self(u32::from_le_bytes(bytes)))
    }
}

impl MaxSize for FixedU32 {
    const MAX_SIZE: usize = size_of::<u32>();
    const LAYOUT: u32 = crate::layout_of("FixedU32", &[]);
}

/// What became of an axis's setpoint in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[serde(rename_all = "snake_case")]
pub enum CycleResult {
    /// The motor has answered it; or has got it, where it answers no setpoint.
    Answered,
    /// It has, and that may be the late answer to a setpoint of the last 300 ms that was not
    /// answered in time.
    Ambiguous,
    /// The motor has not answered it in time.
    NoReply,
    /// A stop came before the motor had answered it.
    Stopped,
    /// A newer setpoint or cycle came before the motor had answered it.
    Superseded,
    /// It was not taken, for the error with this number.
    Refused {
        /// As in the table of errors.
        error: u16,
    },
}

impl CycleResult {
    /// Whether the motor answers, late or not.
    #[must_use]
    pub const fn is_answered(self) -> bool {
        matches!(self, Self::Answered | Self::Ambiguous)
    }

    const fn code(self) -> u8 {
        match self {
            Self::Answered => 0,
            Self::NoReply => 1,
            Self::Stopped => 2,
            Self::Superseded => 3,
            Self::Refused { .. } => 4,
            Self::Ambiguous => 5,
        }
    }
}

impl fmt::Display for CycleResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Answered => f.write_str("answered"),
            Self::Ambiguous => f.write_str("answered, perhaps late"),
            Self::NoReply => f.write_str("no reply"),
            Self::Stopped => f.write_str("stopped"),
            Self::Superseded => f.write_str("superseded"),
            Self::Refused { error } => match ERRORS.iter().find(|info| info.number == *error) {
                Some(info) => write!(f, "refused: {}", info.name),
                None => write!(f, "refused: error {error}"),
            },
        }
    }
}

/// The state of an axis at the end of a cycle. Fields that were not asked for or have never been
/// measured are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CycleState {
    /// Number of the axis, from 0.
    pub axis: u8,
    /// The state of the axis.
    pub state: AxisState,
    /// What became of its setpoint.
    pub result: CycleResult,
    /// How old the oldest of position, velocity and current is, as far as they were asked for, µs;
    /// a multiple of 10, at most 163 830, which stands for everything older and for what was never
    /// measured. Voltage, temperatures and faults are polled in turns and may be older.
    pub age_us: u32,
    /// rad, positive is counter-clockwise.
    pub position_rad: Option<f32>,
    /// rad/s, in steps of 0.001.
    pub velocity_rad_s: Option<f32>,
    /// A, in steps of 0.001, at most 1 048 to both sides of 0.
    pub current_a: Option<f32>,
    /// Supply of the motor, V, likewise.
    pub voltage_v: Option<f32>,
    /// °C, likewise.
    pub motor_temperature_c: Option<f32>,
    /// °C, likewise.
    pub driver_temperature_c: Option<f32>,
    /// The motor's own fault word; 0 is no fault.
    pub faults: Option<u16>,
}

/// The place of a state in the low half of a head.
const TRIPPED: u8 = 6;
const TRIPPED_CONFIRMED: u8 = 8;

fn state_code(state: AxisState) -> u8 {
    match state {
        AxisState::Unconfigured => 0,
        AxisState::Idle => 1,
        AxisState::Arming => 2,
        AxisState::Armed => 3,
        AxisState::Active => 4,
        AxisState::Stopping => 5,
        AxisState::Tripped { confirmed: false } => TRIPPED,
        AxisState::Holding => 7,
        AxisState::Tripped { confirmed: true } => TRIPPED_CONFIRMED,
    }
}

fn state_of(code: u8) -> Option<AxisState> {
    Some(match code {
        0 => AxisState::Unconfigured,
        1 => AxisState::Idle,
        2 => AxisState::Arming,
        3 => AxisState::Armed,
        4 => AxisState::Active,
        5 => AxisState::Stopping,
        TRIPPED => AxisState::Tripped { confirmed: false },
        7 => AxisState::Holding,
        TRIPPED_CONFIRMED => AxisState::Tripped { confirmed: true },
        _ => return None,
    })
}

/// A quantity in thousandths; one less than the least stands for what is not known.
fn thousandths(value: Option<f32>, most: i32) -> i32 {
    #[allow(clippy::cast_possible_truncation, reason = "saturates, and is clamped")]
    let rounded = |value: f32| {
        let scaled = value * 1_000.0;
        (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i32
    };
    value.map_or(-most - 1, |value| rounded(value).clamp(-most, most))
}

fn from_thousandths(value: i32, most: i32) -> Option<f32> {
    #[allow(clippy::cast_precision_loss, reason = "a thousandth of what is measured")]
    (value >= -most).then(|| value as f32 / 1_000.0)
}

/// A state as it is told: each value as in any body. All axes of a cycle are told in one piece, so
/// it is written without the detours of a serializer.
struct Packed {
    bytes: [u8; MAX_STATE],
    length: usize,
}

impl Packed {
    fn byte(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.length) {
            *place = byte;
            self.length += 1;
        }
    }

    fn unsigned(&mut self, mut value: u32) {
        while value > 0x7F {
            self.byte(value.to_le_bytes()[0] | 0x80);
            value >>= 7;
        }
        self.byte(value.to_le_bytes()[0]);
    }

    /// Zigzag: the sign is the lowest bit.
    fn signed(&mut self, value: i32) {
        self.unsigned((value << 1 ^ value >> 31).cast_unsigned());
    }

    fn float(&mut self, value: f32) {
        value.to_le_bytes().into_iter().for_each(|byte| self.byte(byte));
    }
}

fn take<'a, T: Deserialize<'a>>(from: &mut &'a [u8]) -> Option<T> {
    let (value, rest) = postcard::take_from_bytes(from).ok()?;
    *from = rest;
    Some(value)
}

/// The most that a number of this field is told as, thousandths; nothing where it is no number in
/// thousandths.
const fn most(field: StateField) -> Option<i32> {
    match field {
        StateField::Position | StateField::Faults => None,
        StateField::Velocity => Some(FOUR_BYTES),
        StateField::Current
        | StateField::Voltage
        | StateField::MotorTemperature
        | StateField::DriverTemperature => Some(THREE_BYTES),
    }
}

impl CycleState {
    /// An axis that moves, and of which nothing is known.
    const UNKNOWN: Self = Self {
        axis: 0,
        state: AxisState::Active,
        result: CycleResult::Answered,
        age_us: 0,
        position_rad: None,
        velocity_rad_s: None,
        current_a: None,
        voltage_v: None,
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: None,
    };

    fn number(&mut self, field: StateField) -> &mut Option<f32> {
        match field {
            StateField::Velocity => &mut self.velocity_rad_s,
            StateField::Current => &mut self.current_a,
            StateField::Voltage => &mut self.voltage_v,
            StateField::MotorTemperature => &mut self.motor_temperature_c,
            StateField::DriverTemperature => &mut self.driver_temperature_c,
            StateField::Position | StateField::Faults => &mut self.position_rad,
        }
    }

    fn take(axis: u8, fields: StateFields, from: &mut &[u8]) -> Option<Self> {
        let head: u8 = take(from)?;
        let result = match head >> 4 {
            0 => CycleResult::Answered,
            1 => CycleResult::NoReply,
            2 => CycleResult::Stopped,
            3 => CycleResult::Superseded,
            4 => CycleResult::Refused { error: take(from)? },
            5 => CycleResult::Ambiguous,
            _ => return None,
        };
        let mut state = Self {
            axis,
            state: state_of(head & 0x0F)?,
            result,
            age_us: u32::from(take::<u16>(from)?).saturating_mul(AGE_UNIT_US),
            ..Self::UNKNOWN
        };
        for field in fields.iter() {
            match (field, most(field)) {
                (StateField::Faults, _) => state.faults = take::<Option<u16>>(from)?,
                (_, Some(most)) => *state.number(field) = from_thousandths(take(from)?, most),
                _ => state.position_rad = Some(take(from)?).filter(|rad: &f32| !rad.is_nan()),
            }
        }
        Some(state)
    }
}

/// Adds the state of the next axis, and its bit. What does not fit is left out: [`MAX_STATES`] has
/// room for all.
pub(crate) fn push<const N: usize>(
    axes: &mut u32,
    to: &mut Bytes<N>,
    fields: StateFields,
    state: &mut CycleState,
) {
    *axes |= 1_u32.checked_shl(state.axis.into()).unwrap_or(0);
    let mut packed = Packed { bytes: [0; MAX_STATE], length: 0 };
    packed.byte(state_code(state.state) | state.result.code() << 4);
    if let CycleResult::Refused { error } = state.result {
        packed.unsigned(error.into());
    }
    packed.unsigned(state.age_us.div_ceil(AGE_UNIT_US).min(MAX_AGE.into()));
    for field in fields.iter() {
        match (field, most(field)) {
            (StateField::Faults, _) => {
                packed.byte(state.faults.is_some().into());
                state.faults.into_iter().for_each(|word| packed.unsigned(word.into()));
            }
            (_, Some(most)) => packed.signed(thousandths(*state.number(field), most)),
            _ => packed.float(state.position_rad.unwrap_or(f32::NAN)),
        }
    }
    let _ = to.extend_from_slice(packed.bytes.get(..packed.length).unwrap_or_default());
}

/// The states of these axes.
pub(crate) fn states(
    axes: u32,
    fields: StateFields,
    mut bytes: &[u8],
) -> impl Iterator<Item = CycleState> + '_ {
    (0..u32::BITS)
        .filter(move |axis| axes >> axis & 1 != 0)
        .filter_map(|axis| u8::try_from(axis).ok())
        .map_while(move |axis| CycleState::take(axis, fields, &mut bytes))
}

impl CycleReport {
    /// Adds the state of the next axis: in the order of their numbers.
    pub fn push(&mut self, mut state: CycleState) {
        push(&mut self.axes, &mut self.states, self.fields, &mut state);
    }

    /// The states, in the order of the axes. It ends early where the bytes are no states.
    pub fn states(&self) -> impl Iterator<Item = CycleState> + '_ {
        states(self.axes, self.fields, &self.states)
    }
}

/// Bytes of a [`Cycle`](crate::requests::Cycle) on the wire, of a setpoint for each of these axes,
/// bit 0 being axis 0, and of its report at most, each with its framing. Of more axes than a cycle
/// can have: as of as many as it can.
pub fn cycle_frame_bytes(
    axes: u32,
    setpoint: impl Fn(u8) -> Setpoint,
    fields: StateFields,
) -> (usize, usize) {
    let (epoch, expires_at_us) = (FixedU32(u32::MAX), FixedU32(u32::MAX));
    let mut report =
        CycleReport { time_us: FixedU32(u32::MAX), fields, axes: 0, states: Bytes::new() };
    let mut setpoints = crate::Vec::new();
    for state in longest_states(axes) {
        let _ = setpoints.push(setpoint(state.axis));
        report.push(state);
    }
    let cycle =
        Request::Cycle(crate::requests::Cycle { epoch, expires_at_us, fields, axes, setpoints });
    let mut frame = [0; MAX_FRAME];
    let out = cycle.encode_frame(u16::MAX, &mut frame).unwrap_or(0);
    let back = Reply::Cycle(report).encode_frame(u16::MAX, &mut frame).unwrap_or(0);
    (out, back)
}

/// Of each of these axes, as many as a cycle can have, a state as long as it gets: what is not known
/// is told by the longest number.
pub(crate) fn longest_states(axes: u32) -> impl Iterator<Item = CycleState> {
    let wanted = (0..32_u8).filter(move |axis| axes >> *axis & 1 != 0).take(MAX_CYCLE_AXES);
    let faults = Some(u16::MAX);
    wanted.map(move |axis| CycleState { axis, age_us: u32::MAX, faults, ..CycleState::UNKNOWN })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Vec, requests};

    const STATE: CycleState = CycleState {
        axis: 3,
        state: AxisState::Active,
        result: CycleResult::Answered,
        age_us: 120,
        position_rad: Some(1.5),
        velocity_rad_s: Some(-2.0),
        current_a: Some(0.75),
        voltage_v: Some(24.0),
        motor_temperature_c: Some(-5.0),
        driver_temperature_c: None,
        faults: Some(0x8001),
    };

    fn report(fields: StateFields, states: &[CycleState]) -> CycleReport {
        let time_us = FixedU32(u32::MAX);
        let mut report = CycleReport { time_us, fields, axes: 0, states: Bytes::new() };
        states.iter().for_each(|state| report.push(*state));
        report
    }

    #[test]
    fn states_come_back_as_they_were_told() {
        let all = StateFields::of(StateField::ALL);
        let refused = CycleState {
            axis: 31,
            state: AxisState::Tripped { confirmed: true },
            result: CycleResult::Refused { error: 15 },
            faults: None,
            ..STATE
        };
        let report = report(all, &[STATE, refused]);
        assert_eq!(report.axes, 1 << 3 | 1 << 31);
        assert!(report.states().eq([STATE, refused]));
    }

    #[test]
    fn what_was_not_asked_for_is_missing_and_what_is_beyond_is_kept_within() {
        let fields = StateFields::of(&[StateField::Velocity, StateField::Current]);
        let beyond = CycleState {
            age_us: u32::MAX,
            velocity_rad_s: Some(f32::INFINITY),
            current_a: Some(-2_000.0),
            ..STATE
        };
        let [told] =
            report(fields, &[beyond]).states().collect::<Vec<_, 1>>().into_array().unwrap();
        assert_eq!((told.position_rad, told.voltage_v, told.faults), (None, None, None));
        assert_eq!((told.age_us, told.current_a), (163_830, Some(-1_048.575)));
        assert_eq!(told.velocity_rad_s, Some(134_217.73));
    }

    #[test]
    fn bytes_that_are_no_states_end_the_list() {
        let mut report = report(StateFields::NONE, &[STATE]);
        report.axes |= 1 << 4;
        assert_eq!(report.states().count(), 1);
        report.states[0] = 0x0F;
        assert_eq!(report.states().count(), 0);
    }

    /// The bound of the largest states is that of the bytes kept for them.
    #[test]
    fn the_largest_states_of_all_axes_fit() {
        let most = CycleState {
            result: CycleResult::Refused { error: u16::MAX },
            age_us: u32::MAX,
            velocity_rad_s: None,
            current_a: None,
            voltage_v: None,
            motor_temperature_c: None,
            faults: Some(u16::MAX),
            ..STATE
        };
        let states = [most; MAX_CYCLE_AXES];
        let mut axes = 0;
        let states = states.map(|state| {
            axes += 1;
            CycleState { axis: axes, ..state }
        });
        let report = report(StateFields::of(StateField::ALL), &states);
        assert_eq!((report.states.len(), report.states().count()), (MAX_STATES, MAX_CYCLE_AXES));
    }

    #[test]
    fn a_cycle_of_eight_axes_takes_64_bytes_and_its_report_at_most_128() {
        let velocity = Setpoint::Velocity { velocity_rad_s: 2.0 };
        let fields =
            StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);
        let cycle = Request::Cycle(requests::Cycle {
            epoch: FixedU32(u32::MAX),
            expires_at_us: FixedU32(u32::MAX),
            fields,
            axes: 0xFF,
            setpoints: Vec::from_iter([velocity; 8]),
        });
        let mut out = [0; MAX_FRAME];
        assert_eq!(cycle.encode_frame(u16::MAX, &mut out), Ok(64));
        let most = CycleState {
            age_us: u32::MAX,
            velocity_rad_s: Some(-1_048.0),
            current_a: None,
            ..STATE
        };
        let states = [0, 1, 2, 3, 4, 5, 6, 7].map(|axis| CycleState { axis, ..most });
        let reply = Reply::Cycle(report(fields, &states));
        let length = reply.encode_frame(u16::MAX, &mut out).unwrap();
        assert!(length <= 128, "{length}");
        // A speed above 1048 rad/s, or none, takes a byte more.
        assert_eq!(cycle_frame_bytes(0xFF, |_| velocity, fields), (64, 132));
        // A second number takes four bytes more.
        let position = Setpoint::Position { position_rad: 1.0, speed_limit_rad_s: 1.0 };
        let two = |axis| if matches!(axis, 0 | 2) { position } else { velocity };
        assert_eq!(cycle_frame_bytes(0xFF, two, fields).0, 64 + 2 * 4);
    }

    #[test]
    fn the_bytes_of_every_cycle_fit_a_message() {
        let all = StateFields::of(StateField::ALL);
        for axes in [0x1_u32, 0xFFFF, u32::MAX] {
            let velocity = |_| Setpoint::Velocity { velocity_rad_s: 1.0 };
            let (out, back) = cycle_frame_bytes(axes, velocity, all);
            assert!((20..=MAX_FRAME).contains(&out) && (20..=MAX_FRAME).contains(&back));
        }
    }
}
