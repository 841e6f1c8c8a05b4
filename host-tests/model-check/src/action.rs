//! What may happen in a run.

use crate::text::hex;
use serde::{Deserialize, Serialize};

/// Something that happens at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Since the start of the run, µs.
    pub at_us: u64,
    /// What.
    pub action: Action,
}

/// What happens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Action {
    /// A host asks.
    Ask { link: u8, ask: Ask },
    /// A host asks for a program that only watches.
    Watch { link: u8, ask: Ask },
    /// A host repeats, byte for byte, the request so many before its latest.
    Again { link: u8, back: u8 },
    /// A host sends bytes that are what they are.
    Bytes {
        link: u8,
        #[serde(with = "hex")]
        bytes: Vec<u8>,
    },
    /// A host reads nothing for a while.
    Unread { link: u8, for_us: u64 },
    /// The e-stop input.
    EStopInput { open: bool },
    /// A motor does something else than it should.
    Motor { motor: u8, does: Does },
    /// The cable of a CAN bus is cut for a while: nobody acknowledges, nothing arrives.
    Cut { bus: u8, for_us: u64 },
    /// A CAN bus is shorted for a while: its controller goes off, again after each start.
    Short { bus: u8, for_us: u64 },
    /// Another node loads a CAN bus for a while with frames of this id and length: so long after
    /// one has left it has the next.
    Foreign { bus: u8, id: u32, length: u8, pause_us: u64, for_us: u64 },
    /// A frame that nobody asked for comes in at the end of what is on the bus.
    Stray {
        bus: u8,
        id: u32,
        #[serde(with = "hex")]
        data: Vec<u8>,
    },
    /// Bytes that nobody asked for come in on a serial line.
    Noise {
        bus: u8,
        #[serde(with = "hex")]
        bytes: Vec<u8>,
    },
    /// For a while the controller gives nothing back that it is asked for.
    Stubborn { bus: u8, for_us: u64 },
    /// The controller of a CAN bus that is not off reports its error counters.
    Errors { bus: u8, transmit: u16, receive: u16 },
    /// The port reports that it lost frames.
    Overflow { bus: u8 },
    /// The port of a bus that exists or not reports that a frame has left a slot that holds none.
    StraySlot { bus: u8, slot: u8 },
    /// The clock goes back by this much for one tick.
    ClockBack { by_us: u64 },
    /// The watchdog resets the gateway.
    Reset,
    /// It does, and so many of the words that the last e-stop wrote to what outlives a reset are
    /// damaged.
    DamagingReset { words: u8 },
    /// It does so when the gateway has stored so many more words of what outlives a reset: the last
    /// of them is whole, or garbage. What was going to be said or sent behind that is not.
    ResetWhileSaving { words: u32, garbles: bool },
    /// It does so after so many more of the steps that follow from events, each a word stored, a
    /// frame handed to a bus or asked back, or a frame told to a host.
    ResetAfter { steps: u32 },
    /// The gateway loses its power for a moment.
    PowerLoss,
    /// What is being stored is written, or the storage fails.
    Stored { done: bool },
}

/// What a motor does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Does {
    /// It answers nothing for a while.
    Mute { for_us: u64 },
    /// It hears nothing for a while.
    Deaf { for_us: u64 },
    /// Its next answer is late by this much.
    Late { by_us: u64 },
    /// Its next answer comes twice.
    Twice,
    /// Its next answer has these data.
    Lies {
        #[serde(with = "hex")]
        data: Vec<u8>,
    },
    /// It refuses the next command.
    Refuses,
    /// Its fault word is this.
    Faults { word: u16 },
    /// It is switched off and on.
    Restarts,
    /// It has no power for a while.
    Off { for_us: u64 },
    /// It answers and does not obey for a while.
    Disobeys { for_us: u64 },
    /// D5: it answers what is for others, or not any more (D5 manual, table row 5).
    AnswersOthers { on: bool },
    /// D5: somebody else has told it a speed that waits, degrees a second.
    Waits { speed: f32 },
    /// Thruster: it was told a VM with these bytes 6 and 7 (manual §2.4).
    Returns { mode: u16 },
    /// RMD: it speaks the dialect with this number in `rmd_dialect`.
    Speaks { dialect: u8 },
    /// Something turns its shaft for a while, degrees a second.
    Turns { speed: f32, for_us: u64 },
}

/// A request. Epoch and expiry are relative to what the host knows, so that a list of steps that
/// has become shorter means the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    Hello,
    Ping,
    Take,
    Release,
    Silence {
        us: u32,
    },
    Bus {
        bus: u8,
        window_us: u32,
        protocols: u8,
        exclusive: bool,
    },
    Set {
        axis: u8,
        parameter: u16,
        value: Number,
    },
    Begin,
    /// A change of those that are made together; without a value it is no longer set.
    Change {
        axis: u8,
        parameter: u16,
        value: Option<Number>,
    },
    /// A name among those that are made together: of the gateway (0), of bus or of axis `number`.
    Name {
        kind: u8,
        number: u8,
        name: Option<String>,
    },
    Apply,
    Save,
    Forget,
    Remove {
        axis: u8,
    },
    Provision {
        axis: u8,
        timeout_ms: u32,
    },
    Arm {
        axis: u8,
    },
    Disarm {
        axis: u8,
    },
    Stop {
        axis: u8,
    },
    StopAll,
    EStop,
    ClearGateway,
    Clear {
        axis: u8,
    },
    ClearByRestart {
        axis: u8,
    },
    ClearUnreachable {
        axis: u8,
    },
    OutputOff {
        axis: u8,
    },
    Setpoint {
        permit: Permit,
        goal: Goal,
    },
    Move {
        permit: Permit,
        distance: f32,
        speed: f32,
    },
    Native {
        permit: Permit,
        #[serde(with = "hex")]
        data: Vec<u8>,
    },
    /// Axis, epoch as in a [`Permit`], and rad/s of each motor.
    Together {
        lead_us: i32,
        members: Vec<(u8, i32, f32)>,
    },
    ArmTogether {
        axes: u32,
    },
    /// Axis and goal of each; the epoch of the first, off by so much.
    Cycle {
        lead_us: i32,
        epoch: i32,
        members: Vec<(u8, Goal)>,
    },
    /// The gateway's own cycle.
    RunCycle {
        axes: u32,
        period_us: u32,
    },
    Read {
        axis: u8,
    },
    Subscribe {
        axes: u32,
        period_us: u32,
    },
    Status,
    List,
    Incidents {
        first: u8,
    },
    FlightRecord {
        offset: u32,
    },
    BusStatus {
        bus: u8,
    },
    RawOpen {
        bus: u8,
        unsafe_access: bool,
    },
    RawOpenAt {
        bus: u8,
        /// Its mode, by its number.
        mode: u8,
    },
    RawSend {
        bus: u8,
        id: u32,
        #[serde(with = "hex")]
        data: Vec<u8>,
    },
    RawReceive {
        bus: u8,
    },
    RawClose {
        bus: u8,
    },
}

/// A value of an axis parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Number {
    Bool(bool),
    Unsigned(u32),
    Signed(i32),
    Float(f32),
}

/// Axis, epoch and expiry of what moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Permit {
    pub axis: u8,
    /// Added to the epoch that the host knows.
    pub epoch: i32,
    /// From now.
    pub lead_us: i32,
}

/// What a setpoint sets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    Signal(f32),
    Current(f32),
    Velocity(f32),
    Position(f32, f32),
    Impedance(f32),
}
