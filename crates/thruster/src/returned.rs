//! What a device returns by itself or instead of an echo: the frames of VM and SR.

use codec::{CommandInfo, Decode, Encode, FieldInfo, FieldKind, Shown, Visit};

use crate::command;
use crate::error::DecodeError;
use crate::faults::Faults;
use crate::field::{DATA, FULL_LEN};
use crate::payload::Payload;
use crate::table;
use crate::units::{Celsius, Deciamps, Decidegrees, Decivolts, Rpm};

codec::flags! {
    /// Which frames are returned: byte 7 of VM (Thruster manual §2.4), byte 5 of SR (§2.5).
    ///
    /// The reserved bits 3 to 7 stay as received.
    struct ReturnFrames: u8, sent;

    /// Frame 1: speed, voltage, current.
    MOTION = 1 << 0;
    /// Frame 2: status, motor temperature, driver temperature.
    CONDITION = 1 << 1;
    /// Frame 3: absolute and relative position.
    POSITION = 1 << 2;
}

codec::flags! {
    /// How frames are returned: byte 6 of VM (Thruster manual §2.4).
    ///
    /// The sentence above the table contradicts it; the table holds. The reserved bits 2 to 7 stay
    /// as received.
    struct ReturnFlags: u8, sent;

    /// Nothing is returned at all.
    NO_RETURN = 1 << 0;
    /// One frame without a header is returned; see [`Headerless`].
    NO_HEADER = 1 << 1;
}

/// VM has nothing before its flags (Thruster manual §2.4).
impl Decode<Payload> for ReturnFlags {
    fn get<const AT: usize>(data: &Payload) -> Result<ReturnFlags, DecodeError> {
        u16::get::<DATA>(data).map(upper).map(ReturnFlags::from_bits_retain)
    }
}

impl Encode<Payload> for ReturnFlags {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        data.put_bytes::<AT, _>([self.bits()]);
    }
}

/// SR has nothing before its frames (Thruster manual §2.5); in VM they stand behind the flags.
impl Decode<Payload> for ReturnFrames {
    fn get<const AT: usize>(data: &Payload) -> Result<ReturnFrames, DecodeError> {
        let [reserved, in_stream, _, in_return] = data.data()?;
        match (AT, reserved) {
            (FRAMES_OF_STREAM, 0) => Ok(ReturnFrames::from_bits_retain(in_stream)),
            (FRAMES_OF_STREAM, got) => {
                Err(DecodeError::FixedByte { offset: DATA, got, expected: 0 })
            }
            _ => Ok(ReturnFrames::from_bits_retain(in_return)),
        }
    }
}

impl Encode<Payload> for ReturnFrames {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        data.put_bytes::<AT, _>([self.bits()]);
    }
}

/// Place of the frames in SR (Thruster manual §2.5).
const FRAMES_OF_STREAM: usize = 5;

/// Why a frame was returned: the upper byte of its header (Thruster manual §2.4, §2.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ReturnSource {
    /// `54 0n`: a TC was taken.
    Signal,
    /// `56 0n`: a VC was taken.
    Speed,
    /// `41 0n`: the stream that SR configures; nobody asked.
    Stream,
}

impl ReturnSource {
    // The command word with its lower byte replaced by the frame's number (Thruster manual §2.4).
    const SIGNAL: u8 = upper(command::SIGNAL);
    const SPEED: u8 = upper(command::SPEED);
    /// No command word explains it (Thruster manual §2.5).
    const STREAM: u8 = 0x41;

    const fn upper_byte(self) -> u8 {
        match self {
            ReturnSource::Signal => Self::SIGNAL,
            ReturnSource::Speed => Self::SPEED,
            ReturnSource::Stream => Self::STREAM,
        }
    }

    const fn of(upper_byte: u8) -> Option<ReturnSource> {
        match upper_byte {
            Self::SIGNAL => Some(ReturnSource::Signal),
            Self::SPEED => Some(ReturnSource::Speed),
            Self::STREAM => Some(ReturnSource::Stream),
            _ => None,
        }
    }
}

const fn upper(word: u16) -> u8 {
    let [upper, _] = word.to_be_bytes();
    upper
}

/// The header of the frame of this number.
pub(crate) const fn header(source: ReturnSource, number: u8) -> u16 {
    u16::from_be_bytes([source.upper_byte(), number])
}

/// What a returned frame carries: three words behind the header (Thruster manual §2.4, §2.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReturnedFrame {
    /// Frame 1.
    Motion {
        /// rpm.
        speed: Rpm,
        /// 0.1 V each.
        voltage: Decivolts,
        /// 0.1 A each.
        current: Deciamps,
    },
    /// Frame 2.
    Condition {
        /// The status word, taken to be the fault word of EF.
        faults: Faults,
        /// °C.
        motor_temperature: Celsius,
        /// °C.
        driver_temperature: Celsius,
    },
    /// Frame 3.
    Position {
        /// Absolute, then relative position; how six bytes hold the two is not given.
        raw: [u8; 6],
    },
}

impl ReturnedFrame {
    pub(crate) const MOTION: u8 = 1;
    pub(crate) const CONDITION: u8 = 2;
    pub(crate) const POSITION: u8 = 3;

    /// The number of the frame, 1..=3.
    pub const fn number(&self) -> u8 {
        match self {
            ReturnedFrame::Motion { .. } => Self::MOTION,
            ReturnedFrame::Condition { .. } => Self::CONDITION,
            ReturnedFrame::Position { .. } => Self::POSITION,
        }
    }

    /// The first word of frame 3 as an absolute position. An assumption: the manual does not give
    /// the layout.
    pub fn absolute_position(&self) -> Option<Decidegrees> {
        let ReturnedFrame::Position { raw: [high, low, ..] } = *self else { return None };
        Some(Decidegrees(i32::from(i16::from_be_bytes([high, low]))))
    }

    fn bytes(&self) -> [u8; 6] {
        match *self {
            ReturnedFrame::Motion { speed, voltage, current } => {
                joined([speed.0.to_be_bytes(), voltage.0.to_be_bytes(), current.0.to_be_bytes()])
            }
            ReturnedFrame::Condition { faults, motor_temperature, driver_temperature } => joined([
                faults.bits().to_be_bytes(),
                motor_temperature.0.to_be_bytes(),
                driver_temperature.0.to_be_bytes(),
            ]),
            ReturnedFrame::Position { raw } => raw,
        }
    }

    fn of(number: u8, raw: [u8; 6]) -> Option<ReturnedFrame> {
        let [a0, a1, b0, b1, c0, c1] = raw;
        Some(match number {
            Self::MOTION => ReturnedFrame::Motion {
                speed: Rpm(i16::from_be_bytes([a0, a1])),
                voltage: Decivolts(u16::from_be_bytes([b0, b1])),
                current: Deciamps(i16::from_be_bytes([c0, c1])),
            },
            Self::CONDITION => ReturnedFrame::Condition {
                faults: Faults::from_bits_retain(u16::from_be_bytes([a0, a1])),
                motor_temperature: Celsius(i16::from_be_bytes([b0, b1])),
                driver_temperature: Celsius(i16::from_be_bytes([c0, c1])),
            },
            Self::POSITION => ReturnedFrame::Position { raw },
            _ => return None,
        })
    }
}

const SPEED: FieldInfo = <Rpm as Shown>::INFO.named("speed_rpm");
const VOLTAGE: FieldInfo = <Decivolts as Shown>::INFO.named("voltage_v");
const CURRENT: FieldInfo = <Deciamps as Shown>::INFO.named("current_a");
const FAULTS: FieldInfo = <Faults as Shown>::INFO.named("faults");
const MOTOR_TEMPERATURE: FieldInfo = <Celsius as Shown>::INFO.named("motor_temperature_c");
const DRIVER_TEMPERATURE: FieldInfo = <Celsius as Shown>::INFO.named("driver_temperature_c");
/// The first word of frame 3.
const ABSOLUTE_ANGLE: FieldInfo = <Decidegrees as Shown>::INFO
    .named("absolute_angle_deg")
    .within(i16::MIN as i64, i16::MAX as i64);
/// The two positions of frame 3.
const DATA_FIELD: FieldInfo = FieldInfo::other(FieldKind::Bytes, "data");

/// Frame 1, 2 or 3 of a source as a row of the table; never sent by a host.
pub(crate) const fn row(name: &'static str, source: ReturnSource, number: u8) -> CommandInfo {
    let (section, note) = match source {
        ReturnSource::Signal | ReturnSource::Speed => (
            "Thruster manual §2.4",
            "never sent; returned instead of an echo, see configure_return",
        ),
        ReturnSource::Stream => {
            ("Thruster manual §2.5", "never sent; an event, see configure_stream")
        }
    };
    let fields: &[FieldInfo] = match number {
        ReturnedFrame::MOTION => &[SPEED, VOLTAGE, CURRENT],
        ReturnedFrame::CONDITION => &[FAULTS, MOTOR_TEMPERATURE, DRIVER_TEMPERATURE],
        _ => &[ABSOLUTE_ANGLE, DATA_FIELD],
    };
    CommandInfo::new(name, header(source, number), section).with_reply(fields).with_note(note)
}

const fn joined([[a0, a1], [b0, b1], [c0, c1]]: [[u8; 2]; 3]) -> [u8; 6] {
    [a0, a1, b0, b1, c0, c1]
}

/// A returned frame with its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Returned {
    /// Why it was returned.
    pub source: ReturnSource,
    /// What it carries.
    pub frame: ReturnedFrame,
}

impl Returned {
    /// The header: the upper byte tells the source, the lower one numbers the frame.
    pub const fn header(&self) -> u16 {
        header(self.source, self.frame.number())
    }

    pub(crate) fn payload(&self) -> Payload {
        let [h0, h1] = self.header().to_be_bytes();
        let [b0, b1, b2, b3, b4, b5] = self.frame.bytes();
        Payload::Full([h0, h1, b0, b1, b2, b3, b4, b5])
    }

    /// Its row in the table of commands.
    pub(crate) fn info(&self) -> &'static CommandInfo {
        use ReturnSource::{Signal, Speed, Stream};
        use ReturnedFrame::{Condition, Motion, Position};
        match (self.source, self.frame) {
            (Signal, Motion { .. }) => &table::SIGNAL_RETURN_1,
            (Signal, Condition { .. }) => &table::SIGNAL_RETURN_2,
            (Signal, Position { .. }) => &table::SIGNAL_RETURN_3,
            (Speed, Motion { .. }) => &table::SPEED_RETURN_1,
            (Speed, Condition { .. }) => &table::SPEED_RETURN_2,
            (Speed, Position { .. }) => &table::SPEED_RETURN_3,
            (Stream, Motion { .. }) => &table::STREAM_1,
            (Stream, Condition { .. }) => &table::STREAM_2,
            (Stream, Position { .. }) => &table::STREAM_3,
        }
    }

    pub(crate) fn visit(&self, visit: &mut Visit<'_>) {
        match &self.frame {
            ReturnedFrame::Motion { speed, voltage, current } => {
                speed.visit(&SPEED, visit);
                voltage.visit(&VOLTAGE, visit);
                current.visit(&CURRENT, visit);
            }
            ReturnedFrame::Condition { faults, motor_temperature, driver_temperature } => {
                faults.visit(&FAULTS, visit);
                motor_temperature.visit(&MOTOR_TEMPERATURE, visit);
                driver_temperature.visit(&DRIVER_TEMPERATURE, visit);
            }
            ReturnedFrame::Position { raw } => {
                if let Some(absolute) = self.frame.absolute_position() {
                    ABSOLUTE_ANGLE.visit_count(visit, absolute.0);
                }
                DATA_FIELD.visit_bytes(visit, raw);
            }
        }
    }

    /// The returned frame in a data field, if it begins with the header of one.
    pub(crate) fn of(payload: Payload) -> Option<Returned> {
        let Payload::Full([upper, number, raw @ ..]) = payload else { return None };
        let frame = ReturnedFrame::of(number, raw)?;
        Some(Returned { source: ReturnSource::of(upper)?, frame })
    }
}

/// The header and the words.
impl Encode<Payload> for Returned {
    fn put<const AT: usize>(&self, data: &mut Payload) {
        *data = self.payload();
    }
}

/// What TC and VC return in the form without a header (Thruster manual §2.4, VM byte 6 bit 1).
///
/// Nothing in these eight bytes tells them from any other reply, so
/// [`Reply::decode`](crate::Reply::decode) never yields them: decode them only from a device that
/// is set so, while its reply to TC or VC is due. Its refusal of TC or VC has the header all the
/// same, or so it is assumed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Headerless {
    /// rpm.
    pub speed: Rpm,
    /// 0.1 V each.
    pub voltage: Decivolts,
    /// 0.1 A each.
    pub current: Deciamps,
    /// The status word, taken to be the fault word of EF.
    pub faults: Faults,
}

impl Headerless {
    /// Name of the frame in listings; no row of [`COMMANDS`](crate::COMMANDS), as it has no command
    /// word.
    pub const NAME: &'static str = "headerless_return";

    /// Hands on every field in the order of the wire.
    pub fn visit_fields(&self, visit: &mut Visit<'_>) {
        self.speed.visit(&SPEED, visit);
        self.voltage.visit(&VOLTAGE, visit);
        self.current.visit(&CURRENT, visit);
        self.faults.visit(&FAULTS, visit);
    }

    /// The eight bytes.
    pub fn encode(&self) -> Payload {
        let ([s0, s1], [v0, v1]) = (self.speed.0.to_be_bytes(), self.voltage.0.to_be_bytes());
        let ([c0, c1], [f0, f1]) = (self.current.0.to_be_bytes(), self.faults.bits().to_be_bytes());
        Payload::Full([s0, s1, v0, v1, c0, c1, f0, f1])
    }

    /// The values in eight bytes.
    pub fn decode(bytes: &[u8]) -> Result<Headerless, DecodeError> {
        let got = bytes.len();
        let bytes = <[u8; FULL_LEN]>::try_from(bytes)
            .map_err(|_| DecodeError::Length { got, expected: FULL_LEN })?;
        let [s0, s1, v0, v1, c0, c1, f0, f1] = bytes;
        Ok(Headerless {
            speed: Rpm(i16::from_be_bytes([s0, s1])),
            voltage: Decivolts(u16::from_be_bytes([v0, v1])),
            current: Deciamps(i16::from_be_bytes([c0, c1])),
            faults: Faults::from_bits_retain(u16::from_be_bytes([f0, f1])),
        })
    }
}
