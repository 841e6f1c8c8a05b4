//! What the gateway tells of a period of a free-running cycle.

use crate::axis::{FaultReading, Reading};
use crate::cycle::{CycleState, FixedU32, MAX_CYCLE_AXES, longest_states, push, states};
use crate::encode::{EncodeError, encode};
use crate::events::EVENTS;
use crate::frame::Kind;
use crate::messages::{DecodeError, decode_body};
use crate::protocol::{StateField, StateFields};
use crate::size::wire;
use crate::text::Bytes;
use crate::{MAX_FRAME, MaxSize};

/// Bytes of the states of one [`CycleEvent`]: head, error, age, position, velocity and current.
const MAX_FAST_STATES: usize = MAX_CYCLE_AXES * (1 + 3 + 2 + 4 + 4 + 3);

wire! {
    /// How many periods of a free-running cycle were longer than they should be, by what kept them
    /// so, since the cycle began.
    #[derive(Copy, Eq, Default)]
    pub struct Overruns {
        /// A request had not left its bus.
        pub bus: u32,
        /// A motor had not answered.
        pub motor: u32,
        /// The event of the period before had not left to the host: that one is lost.
        pub host: u32,
        /// Nobody began it: the gateway was busy until the next was due.
        pub gateway: u32,
    }

    /// What is told of one axis in turns: each field that was asked for and has been measured.
    #[derive(Copy)]
    pub struct SlowState {
        pub axis: u8,
        /// V.
        pub voltage_v: Option<Reading>,
        /// °C.
        pub motor_temperature_c: Option<Reading>,
        /// °C.
        pub driver_temperature_c: Option<Reading>,
        /// What is wrong with the motor now.
        pub faults: Option<FaultReading>,
    }

    /// A period of a free-running cycle. It is an event with a body of its own: that of no other
    /// is as long, and it is kept nowhere.
    pub struct CycleEvent {
        /// Counts the periods from 0; those without an event too.
        pub period: u32,
        /// Low 32 bits of the gateway time at which it was due to begin, µs.
        pub due_us: FixedU32,
        /// How much later it began, µs.
        pub late_us: u32,
        /// The largest less the least of these since the cycle began, µs.
        pub jitter_us: u32,
        /// From when it was due until every axis had ended its part, or the next was due, µs.
        pub took_us: u32,
        /// Since the cycle began.
        pub overruns: Overruns,
        /// What is told of every axis: of position, velocity and current.
        pub fields: StateFields,
        /// The axes: bit 0 is axis 0.
        pub axes: u32,
        /// Their [states](Self::states), one behind the other as in the answer to `Cycle`.
        #[serde(serialize_with = "crate::text::in_one_piece")]
        pub states: Bytes<MAX_FAST_STATES>,
        /// Of one axis, another in each period; nothing where no such field was asked for.
        pub slow: Option<SlowState>,
    }
}

/// A [`CycleEvent`] as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct CycleMessage {
    /// Events that were lost on this link since the last one that was sent.
    pub dropped: u32,
    /// Gateway time at which it was written, µs.
    pub time_us: u64,
    /// What happened.
    pub event: CycleEvent,
}

impl CycleEvent {
    /// The number in the header.
    pub const NUMBER: u16 = 0x8013;
    /// What is told of every axis.
    pub const FAST: StateFields =
        StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);

    /// The states, in the order of the axes. It ends early where the bytes are no states.
    pub fn states(&self) -> impl Iterator<Item = CycleState> + '_ {
        states(self.axes, self.fields, &self.states)
    }

    /// Adds the state of the next axis: in the order of their numbers.
    pub fn push(&mut self, mut state: CycleState) {
        push(&mut self.axes, &mut self.states, self.fields, &mut state);
    }

    /// Writes the whole delimited frame and returns its length. `sequence` counts the events of
    /// the link.
    ///
    /// # Errors
    /// `out` is too small; [`MAX_FRAME`](crate::MAX_FRAME) bytes are always enough.
    pub fn encode_frame(
        &self,
        sequence: u16,
        dropped: u32,
        time_us: u64,
        out: &mut [u8],
    ) -> Result<usize, EncodeError> {
        encode(Kind::Event, sequence, Self::NUMBER, &(dropped, time_us, self), out)
    }
}

/// Bytes of a [`CycleEvent`] of these axes on the wire, bit 0 being axis 0, with its framing, at
/// most; while lateness and durations stay below 16 ms, and overruns few.
pub fn cycle_event_bytes(axes: u32, fields: StateFields) -> usize {
    /// As many as a number of two bytes tells.
    const FEW: u32 = 0x3FFF;
    let reading = |value| Some(Reading { value, age_us: u32::MAX });
    let slow = |field| fields.contains(field).then(|| reading(0.0)).flatten();
    let told = StateFields::from_bits(fields.bits() & CycleEvent::FAST.bits());
    let mut event = CycleEvent {
        period: u32::MAX,
        due_us: FixedU32(u32::MAX),
        late_us: FEW,
        jitter_us: FEW,
        took_us: FEW,
        overruns: Overruns { bus: FEW, motor: FEW, host: FEW, gateway: FEW },
        fields: told,
        axes: 0,
        states: Bytes::new(),
        slow: (told != fields).then(|| SlowState {
            axis: 0,
            voltage_v: slow(StateField::Voltage),
            motor_temperature_c: slow(StateField::MotorTemperature),
            driver_temperature_c: slow(StateField::DriverTemperature),
            faults: fields.contains(StateField::Faults).then_some(FaultReading {
                word: u16::MAX,
                warnings: u16::MAX,
                age_us: u32::MAX,
            }),
        }),
    };
    longest_states(axes).for_each(|state| event.push(state));
    event.encode_frame(u16::MAX, 0, u64::MAX, &mut [0; MAX_FRAME]).unwrap_or(0)
}

impl CycleMessage {
    /// The event of a frame with this body.
    ///
    /// # Errors
    /// The body is not that of a cycle's event.
    pub fn decode(body: &[u8]) -> Result<Self, DecodeError> {
        let (dropped, time_us, event) = decode_body(CycleEvent::NUMBER, body)?;
        Ok(Self { dropped, time_us, event })
    }
}

const _: () = assert!(
    u32::MAX_SIZE + u64::MAX_SIZE + CycleEvent::MAX_SIZE <= crate::MAX_BODY,
    "event longer than a message"
);
const _: () = {
    let mut rest = EVENTS;
    while let [first, others @ ..] = rest {
        assert!(first.number != CycleEvent::NUMBER, "an event's number is taken");
        rest = others;
    }
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec;
    use crate::axis::AxisState;
    use crate::cycle::CycleResult;

    const STATE: CycleState = CycleState {
        axis: 3,
        state: AxisState::Active,
        result: CycleResult::Answered,
        age_us: 120,
        position_rad: Some(1.5),
        velocity_rad_s: Some(-2.0),
        current_a: Some(0.75),
        voltage_v: None,
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: None,
    };

    /// Derived by hand from PROTOCOL.md, and framed by a program in Python.
    const EVENT: &str = "0017041804138002C08DB701AC02EFCDAB890C0FE40501020704070915040C010AC03F9F1FDC\
         0B13F4030103C07F07FFFF7F0103010106424290BF05010301020880F10420C6356100";

    fn event() -> CycleEvent {
        let mut event = CycleEvent {
            period: 300,
            due_us: FixedU32(0x89AB_CDEF),
            late_us: 12,
            jitter_us: 15,
            took_us: 740,
            overruns: Overruns { bus: 1, motor: 2, host: 0, gateway: 4 },
            fields: CycleEvent::FAST,
            axes: 0,
            states: Bytes::new(),
            slow: Some(SlowState {
                axis: 3,
                voltage_v: Some(Reading { value: 48.5, age_us: 90_000 }),
                motor_temperature_c: None,
                driver_temperature_c: None,
                faults: Some(FaultReading { word: 2, warnings: 0, age_us: 80_000 }),
            }),
        };
        event.push(CycleState { axis: 0, ..STATE });
        event.push(CycleState {
            state: AxisState::Armed,
            result: CycleResult::NoReply,
            age_us: 5_000,
            position_rad: None,
            velocity_rad_s: Some(0.0),
            current_a: None,
            ..STATE
        });
        event
    }

    #[test]
    fn an_event_of_a_cycle_is_these_bytes() {
        let mut out = [0; MAX_FRAME];
        let length = event().encode_frame(0x0418, 2, 3_000_000, &mut out).unwrap();
        let hex: Vec<u8, 1_100> = out[..length].iter().flat_map(|b| [b >> 4, b & 15]).collect();
        let digits = EVENT.bytes().map(|digit| char::from(digit).to_digit(16).unwrap());
        assert!(digits.eq(hex.iter().map(|digit| u32::from(*digit))), "{:02X?}", &out[..length]);

        let mut deframer = crate::Deframer::new();
        let mut found = None;
        for byte in &out[..length] {
            if let Some(Ok(frame)) = deframer.push(*byte) {
                assert_eq!(frame.number, CycleEvent::NUMBER);
                found = Some(CycleMessage::decode(frame.body).unwrap());
            }
        }
        let told = CycleMessage { dropped: 2, time_us: 3_000_000, event: event() };
        assert_eq!(found, Some(told.clone()));
        let results = told.event.states().map(|state| (state.axis, state.result));
        assert!(results.eq([(0, CycleResult::Answered), (3, CycleResult::NoReply)]));
    }

    #[test]
    fn the_largest_states_of_an_event_fit() {
        let mut event = CycleEvent { axes: 0, states: Bytes::new(), ..event() };
        for axis in 0..16 {
            event.push(CycleState {
                axis,
                result: CycleResult::Refused { error: u16::MAX },
                age_us: u32::MAX,
                velocity_rad_s: None,
                current_a: None,
                ..STATE
            });
        }
        assert_eq!((event.states.len(), event.states().count()), (MAX_FAST_STATES, 16));
        let cut = CycleMessage::decode(&[0, 0]);
        assert!(cut.is_err());
    }
}
