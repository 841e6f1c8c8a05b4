//! The requests that the promises speak of (PROTOCOL.md, Requests).

use super::body::Body;
use super::frame::Message;

/// What a host asks for. What the promises do not speak of is `Other`.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// 0x0001
    Hello,
    /// 0x0003, and others that take authority and of which nothing else matters.
    Takes,
    /// 0x0004
    ReleaseAuthority,
    /// 0x0010: the link silence in microseconds, if it is that parameter.
    LinkSilence(u32),
    /// 0x0011
    ConfigureBus { bus: u8, setting: BusSetting },
    /// 0x0014
    BeginChanges,
    /// 0x0015
    AddChanges(Vec<Change>),
    /// 0x0016
    ApplyChanges,
    /// 0x0020: the value as its bits.
    ConfigureAxis { axis: u8, parameter: u16, value: u32 },
    /// 0x0023
    RemoveAxis(u8),
    /// 0x0024
    Provision { axis: u8, timeout_ms: u32 },
    /// 0x0030 and 0x0038: a bit for each axis.
    Arm(u32),
    /// 0x0031
    Disarm(u8),
    /// 0x0032
    Stop(Stops),
    /// 0x0033
    EStop,
    /// 0x0034
    Clear(Clears),
    /// Restart the motor of a tripped axis and clear.
    ClearByRestart(u8),
    /// 0x0035
    ClearUnreachable(u8),
    /// 0x0036
    OutputOff(u8),
    /// 0x0040
    Setpoint { axis: u8, epoch: u32, expires_at_us: u32 },
    /// 0x0042
    MoveRelative { axis: u8, epoch: u32, expires_at_us: u32 },
    /// 0x0043
    Native { axis: u8, epoch: u32, expires_at_us: u32, data: Vec<u8> },
    /// 0x0045: axis and epoch of each.
    StartTogether { expires_at_us: u32, members: Vec<(u8, u32)> },
    /// 0x0046: a bit for each axis.
    Cycle { axes: u32, epoch: u32, expires_at_us: u32 },
    /// 0x0047
    RunCycle,
    /// 0x0050
    RawOpen { bus: u8, unsafe_access: bool },
    /// 0x0073
    RawOpenAt { bus: u8 },
    /// 0x0051: an arbitration id with its flags and data, or bytes.
    RawSend { bus: u8, id: Option<u32>, data: Vec<u8> },
    /// 0x0053
    RawClose(u8),
    /// 0x0012
    BusStatus(u8),
    /// 0x0060
    ReadIncidents(u8),
    /// Anything else.
    Other,
    /// What cannot be read.
    Unreadable,
}

/// One change of those that are made together; values are bits.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// The link silence in microseconds.
    LinkSilence(u32),
    /// A bus; nothing: it no longer runs.
    Bus(u8, Option<BusSetting>),
    /// An axis, its parameter and value; nothing: it is no longer set.
    Axis(u8, u16, Option<u32>),
    /// A name, of which no promise speaks.
    Name,
}

impl Change {
    /// Whether it sets what another one sets.
    pub fn is_of_the_row_of(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::LinkSilence(_), Self::LinkSilence(_)) => true,
            (Self::Bus(bus, _), Self::Bus(other, _)) => bus == other,
            (Self::Axis(axis, parameter, _), Self::Axis(other, others, _)) => {
                (axis, parameter) == (other, others)
            }
            _ => false,
        }
    }
}

/// How a bus is configured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BusSetting {
    pub bitrate: u32,
    pub protocols: u8,
    pub exclusive: bool,
    pub reply_window_us: u32,
}

/// Whom a `Stop` names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stops {
    /// One axis.
    Axis(u8),
    /// All.
    All,
}

/// What a `Clear` names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clears {
    /// One axis.
    Axis(u8),
    /// The latched e-stop.
    Gateway,
}

/// Axes that start together, at most.
const MAX_MEMBERS: usize = 8;
/// Changes of one message, at most.
const MAX_CHANGES: usize = 6;
/// Bytes of a name, at most.
const MAX_NAME: usize = 16;
/// Axes of a cycle, at most.
const MAX_CYCLE_AXES: u64 = 16;
/// Gateway parameter `link_silence_us`.
const LINK_SILENCE: u16 = 256;

impl Request {
    /// Reads a message of kind request.
    pub fn read(message: &Message) -> Self {
        Self::fields(message.number, Body(message.body())).unwrap_or(Self::Unreadable)
    }

    fn fields(number: u16, mut body: Body<'_>) -> Option<Self> {
        let b = &mut body;
        let request = match number {
            0x0001 => {
                let _version = (b.u16()?, b.u16()?);
                let _session = b.u32()?;
                Self::Hello
            }
            0x0003 => Self::Takes,
            0x0004 => Self::ReleaseAuthority,
            0x0010 => {
                let (parameter, value) = (b.u16()?, value(b)?);
                if parameter == LINK_SILENCE { Self::LinkSilence(value) } else { Self::Takes }
            }
            0x0011 => Self::ConfigureBus { bus: b.byte()?, setting: bus_setting(b)? },
            0x0014 => Self::BeginChanges,
            0x0015 => {
                let count = usize::try_from(b.varint(64)?).ok().filter(|n| *n <= MAX_CHANGES)?;
                Self::AddChanges((0..count).map(|_| change(b)).collect::<Option<_>>()?)
            }
            0x0016 => Self::ApplyChanges,
            0x0018 | 0x0019 => Self::Takes,
            0x0020 => {
                Self::ConfigureAxis { axis: b.byte()?, parameter: b.u16()?, value: value(b)? }
            }
            0x0023 => Self::RemoveAxis(b.byte()?),
            0x0024 => Self::Provision { axis: b.byte()?, timeout_ms: b.u32()? },
            0x0030 => Self::Arm(1u32.checked_shl(b.byte()?.into()).unwrap_or(0)),
            // No axis is no body that it takes.
            0x0038 => Self::Arm(b.u32().filter(|axes| *axes != 0)?),
            0x0031 => Self::Disarm(b.byte()?),
            0x0032 => Self::Stop(match b.varint(32)? {
                0 => Stops::Axis(b.byte()?),
                1 => Stops::All,
                _ => return None,
            }),
            0x0033 => Self::EStop,
            0x0034 => Self::Clear(match b.varint(32)? {
                0 => Clears::Axis(b.byte()?),
                1 => Clears::Gateway,
                _ => return None,
            }),
            0x0035 => Self::ClearUnreachable(b.byte()?),
            0x0036 => Self::OutputOff(b.byte()?),
            0x0037 => Self::ClearByRestart(b.byte()?),
            0x0040 => {
                let (axis, epoch, expires_at_us) = (b.byte()?, b.u32()?, b.u32()?);
                setpoint(b)?;
                Self::Setpoint { axis, epoch, expires_at_us }
            }
            0x0046 => {
                let (epoch, expires_at_us) = (b.fixed_u32()?, b.fixed_u32()?);
                let (_fields, axes) = (b.byte()?, b.u32()?);
                let count = b.varint(64)?;
                if count > MAX_CYCLE_AXES || count != u64::from(axes.count_ones()) {
                    return None;
                }
                for _ in 0..count {
                    setpoint(b)?;
                }
                Self::Cycle { axes, epoch, expires_at_us }
            }
            0x0047 => {
                let _axes_fields_period = (b.u32()?, b.byte()?, b.u32()?);
                Self::RunCycle
            }
            0x0042 => {
                let (axis, epoch, expires_at_us) = (b.byte()?, b.u32()?, b.u32()?);
                let _distance_and_speed = (b.f32()?, b.f32()?);
                Self::MoveRelative { axis, epoch, expires_at_us }
            }
            0x0043 => {
                let (axis, epoch, expires_at_us) = (b.byte()?, b.u32()?, b.u32()?);
                Self::Native { axis, epoch, expires_at_us, data: b.bytes(8)?.to_vec() }
            }
            0x0045 => {
                let expires_at_us = b.u32()?;
                let count =
                    usize::try_from(b.varint(64)?).ok().filter(|count| *count <= MAX_MEMBERS)?;
                let mut members = Vec::new();
                for _ in 0..count {
                    let (axis, epoch, _velocity) = (b.byte()?, b.u32()?, b.f32()?);
                    members.push((axis, epoch));
                }
                Self::StartTogether { expires_at_us, members }
            }
            0x0050 => Self::RawOpen { bus: b.byte()?, unsafe_access: b.bool()? },
            0x0051 => {
                let bus = b.byte()?;
                match b.varint(32)? {
                    0 => Self::RawSend { bus, id: Some(b.u32()?), data: b.bytes(8)?.to_vec() },
                    1 => Self::RawSend { bus, id: None, data: b.bytes(64)?.to_vec() },
                    _ => return None,
                }
            }
            0x0073 => {
                let (bus, _bitrate, _protocols) = (b.byte()?, b.u32()?, b.byte()?);
                let (_window, mode) = (b.u32()?, b.varint(32)?);
                if mode > 2 {
                    return None;
                }
                Self::RawOpenAt { bus }
            }
            0x0052 => {
                b.byte()?;
                Self::Takes
            }
            0x0081 => {
                std::str::from_utf8(b.bytes(24)?).ok()?;
                let _version = (b.u16()?, b.u16()?, b.u16()?);
                let _bytes = (b.u32()?, b.u32()?, b.bool()?);
                Self::Takes
            }
            0x0082 => {
                let _bytes = (b.u32()?, b.bytes(128)?);
                Self::Takes
            }
            0x0083 => {
                b.bytes(64)?;
                Self::Takes
            }
            0x0084 | 0x0085 => Self::Takes,
            0x0012 => Self::BusStatus(b.byte()?),
            0x0060 => Self::ReadIncidents(b.byte()?),
            0x0053 => Self::RawClose(b.byte()?),
            _ => Self::Other,
        };
        if request == Self::Other { Some(request) } else { body.end(request) }
    }

    /// Whether it asks for this axis to be armed.
    pub fn arms(&self, axis: u8) -> bool {
        matches!(self, Self::Arm(axes) if axes.checked_shr(axis.into()).is_some_and(|at| at & 1 == 1))
    }

    /// Whether it takes authority, or is refused where another link has it. A native command does
    /// by what its bytes do.
    pub fn takes_authority(&self) -> bool {
        match self {
            Self::Takes
            | Self::LinkSilence(_)
            | Self::ConfigureBus { .. }
            | Self::BeginChanges
            | Self::AddChanges(_)
            | Self::ApplyChanges
            | Self::ConfigureAxis { .. }
            | Self::RemoveAxis(_)
            | Self::Provision { .. }
            | Self::Arm(_)
            | Self::Clear(_)
            | Self::ClearUnreachable(_)
            | Self::OutputOff(_)
            | Self::ClearByRestart(_)
            | Self::Setpoint { .. }
            | Self::MoveRelative { .. }
            | Self::StartTogether { .. }
            | Self::Cycle { .. }
            | Self::RunCycle
            | Self::RawOpen { .. }
            | Self::RawOpenAt { .. }
            | Self::RawSend { .. }
            | Self::RawClose(_) => true,
            Self::Hello
            | Self::ReleaseAuthority
            | Self::Disarm(_)
            | Self::Stop(_)
            | Self::EStop
            | Self::Native { .. }
            | Self::BusStatus(_)
            | Self::ReadIncidents(_)
            | Self::Other
            | Self::Unreadable => false,
        }
    }
}

fn bus_setting(body: &mut Body<'_>) -> Option<BusSetting> {
    Some(BusSetting {
        bitrate: body.u32()?,
        protocols: body.byte()?,
        exclusive: body.bool()?,
        reply_window_us: body.u32()?,
    })
}

fn change(body: &mut Body<'_>) -> Option<Change> {
    match body.varint(32)? {
        // There is one parameter of the gateway.
        0 => (body.u16()? == LINK_SILENCE).then_some(Change::LinkSilence(value(body)?)),
        1 => Some(Change::Bus(body.byte()?, body.optional(bus_setting)?)),
        2 => Some(Change::Axis(body.byte()?, body.u16()?, body.optional(value)?)),
        3 => {
            match body.varint(32)? {
                0 => {}
                1 | 2 => drop(body.byte()?),
                _ => return None,
            }
            let name = body.optional(|body| body.bytes(MAX_NAME))?;
            name.is_none_or(|name| str::from_utf8(name).is_ok()).then_some(Change::Name)
        }
        _ => None,
    }
}

/// Passes over a `Setpoint`.
fn setpoint(body: &mut Body<'_>) -> Option<()> {
    let numbers = match body.varint(32)? {
        0..=2 => 1,
        3 => 2,
        4 => 5,
        _ => return None,
    };
    for _ in 0..numbers {
        body.f32()?;
    }
    Some(())
}

/// A `Value` as its bits: a signed one zigzag, as it comes.
fn value(body: &mut Body<'_>) -> Option<u32> {
    match body.varint(32)? {
        0 => body.bool().map(u32::from),
        1 | 2 => body.u32(),
        3 => body.f32().map(f32::to_bits),
        _ => None,
    }
}
