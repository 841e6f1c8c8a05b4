//! The requests: what a host asks for. [`messages`](crate::messages) gives each its number and its
//! reply.

use crate::axis::{ClearTarget, Setpoint as SetpointValue, StopTarget};
use crate::bus::{BusMode, RawFrame};
use crate::can_frame::MAX_CAN_DATA;
use crate::changes::Change;
use crate::cycle::{FixedU32, MAX_CYCLE_AXES};
use crate::image::{FirmwareVersion, MAX_IMAGE_BYTES, SIGNATURE_SIZE};
use crate::names::Subject;
use crate::protocol::{ProtocolSet, StateFields};
use crate::size::wire;
use crate::text::{Bytes, Text};
use crate::value::Value;
use heapless::Vec;

/// Axes that one request starts together.
pub const MAX_MEMBERS: usize = 8;
/// Changes of one [`AddChanges`]: no more than what keeps it from being the largest request.
pub const MAX_CHANGES_AT_ONCE: usize = 6;

/// Shortest and longest time between two samples of an axis, µs.
pub const SUBSCRIPTION_PERIOD_US: (u32, u32) = (1_000, 10_000_000);

wire! {
    /// Opens the session of a host link. Fixed for ever: every version of the gateway answers it.
    #[derive(Copy, Eq)]
    pub struct Hello {
        /// [`PROTOCOL_MAJOR`](crate::PROTOCOL_MAJOR) of the host.
        pub protocol_major: u16,
        /// [`PROTOCOL_MINOR`](crate::PROTOCOL_MINOR) of the host.
        pub protocol_minor: u16,
        /// A random number, new for each connection: it starts a new session, in which no earlier
        /// request counts as repeated.
        pub session: u32,
    }

    /// Asks for the gateway's time; feeds the link silence timer, but no setpoint.
    #[derive(Copy, Eq)]
    pub struct Ping {}

    /// Takes the right to command, if it is free.
    #[derive(Copy, Eq)]
    pub struct TakeAuthority {}

    /// Releases the right to command. Armed axes are stopped and disarmed; nothing trips.
    #[derive(Copy, Eq)]
    pub struct ReleaseAuthority {}

    /// Has this link, a UART, run at another rate: the reply still comes at the present one, what
    /// follows at the new one. The link goes back to [`DEFAULT_BAUD`](crate::DEFAULT_BAUD) when it
    /// hears nothing valid.
    #[derive(Copy, Eq)]
    pub struct SetBaud {
        /// Baud, one that the link offers; the error names them.
        pub baud: u32,
    }

    /// Sets a parameter of the gateway.
    #[derive(Copy)]
    pub struct ConfigureGateway {
        /// Number of a [`GatewayParameter`](crate::GatewayParameter).
        pub parameter: u16,
        /// Its new value.
        pub value: Value,
    }

    /// Starts a bus, or restarts it differently.
    #[derive(Copy, Eq)]
    pub struct ConfigureBus {
        pub bus: u8,
        /// bit/s, one that [`HelloReply`](crate::replies::HelloReply) lists.
        pub bitrate: u32,
        /// The protocols spoken on it.
        pub protocols: ProtocolSet,
        /// Whether every node on it belongs to this gateway: `StartTogether` needs it. Stops are
        /// never broadcast.
        pub exclusive: bool,
        /// How long a motor may take to answer, µs, 100 to 200 000.
        pub reply_window_us: u32,
    }

    /// Asks how a bus is.
    #[derive(Copy, Eq)]
    pub struct BusStatus { pub bus: u8 }

    /// Asks how the gateway itself is: who commands, e-stop, enable output.
    #[derive(Copy, Eq)]
    pub struct GatewayStatus {}

    /// Begins a list of changes that are made together; one that was begun before is forgotten. The
    /// list belongs to who is in command, and is forgotten with that.
    #[derive(Copy, Eq)]
    pub struct BeginChanges {}

    /// Adds changes to the list. Nothing changes yet. The list is forgotten if one cannot be.
    pub struct AddChanges {
        /// In the order in which they are made.
        pub changes: Vec<Change, MAX_CHANGES_AT_ONCE>,
    }

    /// Makes all changes of the list, or none, and forgets it.
    #[derive(Copy, Eq)]
    pub struct ApplyChanges {}

    /// Asks for a parameter of the gateway.
    #[derive(Copy, Eq)]
    pub struct ReadGatewayParameter {
        /// Number of a [`GatewayParameter`](crate::GatewayParameter).
        pub parameter: u16,
    }

    /// Stores the running configuration, so that it runs again after a loss of power. Only while
    /// all axes are at rest; answered when it is stored, or is not.
    #[derive(Copy, Eq)]
    pub struct SaveConfiguration {}

    /// Forgets the stored configuration: after a loss of power nothing is configured. The running
    /// one stays.
    #[derive(Copy, Eq)]
    pub struct ForgetStored {}

    /// Asks what is stored of the configuration.
    #[derive(Copy, Eq)]
    pub struct ReadStored {}

    /// Asks which names there are.
    #[derive(Copy, Eq)]
    pub struct ReadNames {
        /// The list starts here: the gateway, its buses, its axes.
        pub first: Subject,
    }

    /// Asks which parameters of an axis are set.
    #[derive(Copy, Eq)]
    pub struct ReadAxisSettings {
        pub axis: u8,
        /// The list starts at the parameter with this number.
        pub first: u16,
    }

    /// Sets a parameter of an axis.
    #[derive(Copy)]
    pub struct ConfigureAxis {
        pub axis: u8,
        /// Number of an [`AxisParameter`](crate::AxisParameter).
        pub parameter: u16,
        /// Its new value.
        pub value: Value,
    }

    /// Asks for a parameter of an axis.
    #[derive(Copy, Eq)]
    pub struct ReadAxisParameter {
        pub axis: u8,
        /// Number of an [`AxisParameter`](crate::AxisParameter).
        pub parameter: u16,
    }

    /// Asks which axes there are.
    #[derive(Copy, Eq)]
    pub struct ListAxes {
        /// The list starts at this axis.
        pub first: u8,
    }

    /// Forgets an axis and its parameters.
    #[derive(Copy, Eq)]
    pub struct RemoveAxis { pub axis: u8 }

    /// Programs the motor's own timeout, the second layer of safety. Writes to the motor's memory.
    #[derive(Copy, Eq)]
    pub struct ProvisionMotorTimeout {
        pub axis: u8,
        /// ms.
        pub timeout_ms: u32,
    }

    /// Allows motion, after the steps that the motor's protocol needs; opens an epoch.
    #[derive(Copy, Eq)]
    pub struct Arm { pub axis: u8 }

    /// Arms several axes in one epoch, so that one [`Cycle`] serves them: all of them or none.
    #[derive(Copy, Eq)]
    pub struct ArmTogether {
        /// The axes: bit 0 is axis 0.
        pub axes: u32,
    }

    /// Ends the permission to move, through the stop action. Needs no authority. A clearing under
    /// way, which never arms, goes on.
    #[derive(Copy, Eq)]
    pub struct Disarm { pub axis: u8 }

    /// Runs the stop action. Needs no authority.
    #[derive(Copy, Eq)]
    pub struct Stop {
        /// What to stop.
        pub target: StopTarget,
    }

    /// Emergency stop: trips every axis that may move, stops the others too, and latches the
    /// gateway until it is cleared. Needs no authority.
    #[derive(Copy, Eq)]
    pub struct EStop {}

    /// Clears a trip whose stop is confirmed and whose cause is gone, or the latched e-stop. Never
    /// arms.
    #[derive(Copy, Eq)]
    pub struct Clear {
        /// What to clear.
        pub target: ClearTarget,
    }

    /// Unsafe: forgets the trip of an axis whose motor cannot be reached, or does not come to rest
    /// within 5 s. The motor may still be turning, and the gateway does nothing more about it. Only
    /// for a motor that is known to be without power.
    #[derive(Copy, Eq)]
    pub struct ClearUnreachable { pub axis: u8 }

    /// Switches the output of a holding motor off: it lets go, and a load that it held may drop.
    /// The axis is idle once the motor has acknowledged.
    #[derive(Copy, Eq)]
    pub struct OutputOff { pub axis: u8 }

    /// Restarts the motor of a tripped axis whose stop is confirmed, waits until it is back, and
    /// clears the trip: some faults last until a restart. During the restart, at most 3 s, the
    /// motor's output is off and what it held may drop. Never arms.
    #[derive(Copy, Eq)]
    pub struct ClearByRestart { pub axis: u8 }

    /// Says what an armed axis should do now.
    #[derive(Copy)]
    pub struct Setpoint {
        pub axis: u8,
        pub epoch: u32,
        /// The low 32 bits of the gateway time at which it expires, µs; later than now by at most
        /// the axis's TTL.
        pub expires_at_us: u32,
        /// What to do.
        pub setpoint: SetpointValue,
    }

    /// Asks how an axis is.
    #[derive(Copy, Eq)]
    pub struct ReadState { pub axis: u8 }

    /// Moves an armed axis by a distance: reads its position once, and from then on holds the
    /// target like a position setpoint. To be kept up with position setpoints to that target.
    #[derive(Copy)]
    pub struct MoveRelative {
        pub axis: u8,
        pub epoch: u32,
        pub expires_at_us: u32,
        /// rad, positive is counter-clockwise.
        pub distance_rad: f32,
        /// Speed on the way, rad/s, above 0.
        pub speed_limit_rad_s: f32,
    }

    /// Has the motor of an axis carry out a command of its own manual. The gateway reads the bytes
    /// before it acts: what moves obeys the rules of setpoints, what stops is a stop, what changes
    /// the motor needs an idle axis, and what only asks is free.
    #[derive(Eq)]
    pub struct Native {
        pub axis: u8,
        /// For commands that move: the epoch that [`Arm`] returned.
        pub epoch: u32,
        /// For commands that move: as in [`Setpoint`].
        pub expires_at_us: u32,
        /// The data field of the manual, without CAN id or serial framing.
        pub data: Bytes<MAX_CAN_DATA>,
    }

    /// Sets several D5 motors of one bus in motion by one frame (D5 manual, quick start (3) and
    /// (4)): the speed of each waits in it until all are told to execute. From then on each is a
    /// setpoint like any other, to be kept up by [`Setpoint`].
    pub struct StartTogether {
        pub expires_at_us: u32,
        /// The armed axes with their speeds, two or more.
        pub members: Vec<Member, MAX_MEMBERS>,
    }

    /// An axis that is started together with others.
    #[derive(Copy)]
    pub struct Member { pub axis: u8, pub epoch: u32, pub velocity_rad_s: f32 }

    /// Setpoints for several axes that were [armed together](ArmTogether), answered by the state of
    /// each as soon as every motor has answered its own or its own time is over.
    pub struct Cycle {
        /// The epoch that [`ArmTogether`] returned.
        pub epoch: FixedU32,
        /// As in [`Setpoint`], for all of them.
        pub expires_at_us: FixedU32,
        /// What to tell of each.
        pub fields: StateFields,
        /// The axes: bit 0 is axis 0.
        pub axes: u32,
        /// As many setpoints, the first for the axis with the lowest number.
        pub setpoints: Vec<SetpointValue, MAX_CYCLE_AXES>,
    }

    /// Has the gateway refresh and poll the armed ones of these axes in each period and send one
    /// [`CycleEvent`](crate::CycleEvent) for it on this link, until the host has no authority any
    /// more. It replaces the cycle before.
    #[derive(Copy, Eq)]
    pub struct RunCycle {
        /// The axes: bit 0 is axis 0. None ends the cycle.
        pub axes: u32,
        /// What to tell: of position, velocity and current those of every axis, of the others
        /// those of one axis in a period, in turns.
        pub fields: StateFields,
        /// µs, 250 to 20 000.
        pub period_us: u32,
    }

    /// Has the gateway send [`Sample`](crate::Event::Sample) events on this link, one for each axis
    /// in each period. A new subscription replaces the one before; it ends 5 s after the last valid
    /// frame of the host.
    #[derive(Copy, Eq)]
    pub struct Subscribe {
        /// The axes: bit 0 is axis 0. None ends the subscription.
        pub axes: u32,
        /// What to tell of each.
        pub fields: StateFields,
        /// Time between the samples of an axis, µs, 1 000 to 10 000 000.
        pub period_us: u32,
    }

    /// Opens a bus for raw frames. Refused unless every axis on it is idle; while it is open arming
    /// there is refused.
    #[derive(Copy, Eq)]
    pub struct RawOpen {
        pub bus: u8,
        /// Frames that may move motors are sent too. Refused while an axis is configured on the
        /// bus.
        pub unsafe_access: bool,
    }

    /// Runs a bus without axes otherwise than it is configured, or one that is not configured, and
    /// opens it for raw frames that read. Closed, it is as it was.
    #[derive(Copy, Eq)]
    pub struct RawOpenAt {
        pub bus: u8,
        pub bitrate: u32,
        /// What its motors speak.
        pub protocols: ProtocolSet,
        /// How long a motor may take to answer, µs, 100 to 200 000.
        pub reply_window_us: u32,
        /// How it takes part in what happens there.
        pub mode: BusMode,
    }

    /// Sends a raw frame on an open bus.
    #[derive(Eq)]
    pub struct RawSend {
        pub bus: u8,
        /// The frame.
        pub frame: RawFrame,
    }

    /// Fetches the frames received on an open bus since the last time.
    #[derive(Copy, Eq)]
    pub struct RawReceive { pub bus: u8 }

    /// Closes a bus for raw frames.
    #[derive(Copy, Eq)]
    pub struct RawClose { pub bus: u8 }

    /// Asks the motor of an axis at rest which dialect it speaks, by reads that every dialect has;
    /// of an axis that is armed, arming, stopping or tripped what it answered last.
    #[derive(Copy, Eq)]
    pub struct Recognise { pub axis: u8 }

    /// Asks which firmware runs, and whether another may take its place.
    #[derive(Copy, Eq)]
    pub struct ReadImage {}

    /// Begins to send an image of the firmware, and forgets one that was begun before. Nothing runs
    /// otherwise until [`FinishImage`].
    #[derive(Eq)]
    pub struct BeginImage {
        /// The board that it is for, as [`HelloReply`](crate::replies::HelloReply) names it.
        pub board: Text<24>,
        /// Its version.
        pub version: FirmwareVersion,
        /// Its bytes, a multiple of [`IMAGE_UNIT`](crate::IMAGE_UNIT).
        pub length: u32,
        /// CRC-32C of all of them.
        pub checksum: u32,
        /// Whether it may be older than the one that runs.
        pub allow_older: bool,
    }

    /// The next bytes of the image that was begun. Only while all axes are at rest; answered when
    /// they are in the flash, which takes up to 4 s where a sector is erased first.
    #[derive(Eq)]
    pub struct WriteImage {
        /// Where they lie in the image: where the ones before end.
        pub offset: u32,
        /// One or more units of [`IMAGE_UNIT`](crate::IMAGE_UNIT) bytes.
        pub bytes: Bytes<MAX_IMAGE_BYTES>,
    }

    /// Has the image that was sent read back and checked, and run on trial: the gateway starts anew
    /// 100 ms after the answer. Only while all axes are at rest.
    #[derive(Eq)]
    pub struct FinishImage {
        /// Its Ed25519 signature (docs/update.md), or nothing.
        pub signature: Bytes<SIGNATURE_SIZE>,
    }

    /// Keeps the image that runs on trial: without it the one before runs again from the next start
    /// on, which comes 60 s after the first. Until then nothing is armed.
    #[derive(Copy, Eq)]
    pub struct ConfirmImage {}

    /// Asks for the last trips and starts, which outlive a reset.
    #[derive(Copy, Eq)]
    pub struct ReadIncidents {
        /// Where to begin: 0 is the latest.
        pub first: u8,
    }

    /// Asks for the crash report of the run before.
    #[derive(Copy, Eq)]
    pub struct ReadCrashReport {}

    /// Asks for bytes of what the flight recorder has kept of a trip. Not while it
    /// records, and after a trip it records no more once it has been read.
    #[derive(Copy, Eq)]
    pub struct ReadFlightRecord {
        /// Which part of it: 0 is the first.
        pub part: u16,
        /// From which byte of that part on.
        pub offset: u32,
    }
}
