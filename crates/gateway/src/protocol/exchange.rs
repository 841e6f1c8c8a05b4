//! What the core can want from a motor, in words that belong to no protocol.

use serde::{Deserialize, Serialize};

/// One request to a motor and its reply. Each protocol says which command serves it, if any.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Exchange {
    /// The setpoint in force; its command is kept with the setpoint.
    Motion,
    /// A native command that is no motion; its command is kept with the job.
    Native,
    /// The stop command of the axis's stop action.
    Stop,
    /// A further stop command for devices with a position controller (thruster protocol, LS).
    PositionStop,
    /// Read whether an asynchronous write waits in the motor (D5 0x2C).
    PendingWrite,
    /// Replace the asynchronous write that waits by speed 0 (D5).
    OverwritePending,
    /// Carry out the asynchronous write that waits, a speed of 0, so that nothing waits any more
    /// (D5).
    ExecutePending,
    /// Have every motor of the bus carry out what waits in it (D5).
    ExecuteAll,
    /// Read the commanded speed back (D5: how a motor confirms that does not answer writes).
    CommandedSpeed,
    /// Lock the holding brake (RMD).
    LockBrake,
    /// Free the holding brake (RMD).
    ReleaseBrake,
    /// Switch the output off (RMD), the last step of stopping by the brake.
    OutputOff,
    /// Read the speed.
    Velocity,
    /// Read the position.
    Position,
    /// Read the current.
    Current,
    /// Read the supply voltage.
    Voltage,
    /// Read the motor's temperature.
    MotorTemperature,
    /// Read the driver's temperature.
    DriverTemperature,
    /// Read the time since the motor started (RMD).
    RunTime,
    /// Have the motor start anew (RMD).
    Restart,
    /// Read the fault word.
    Faults,
    /// Read all faults since the motor started.
    FaultRecord,
    /// Clear the faults that can be cleared.
    ClearFaults,
    /// Read which requests the motor answers (D5 0x10).
    AckLevel,
    /// Read whether the motor holds by its brake and ignores speeds (D5 0x2B).
    BrakeSwitch,
    /// Read whether the motor's own timeout is on (D5 0x11).
    TimeoutSwitch,
    /// Program the motor's own timeout, milliseconds.
    SetTimeout {
        /// Time without a command after which the motor stops by itself; 0 switches it off.
        timeout_ms: u32,
    },
    /// Program the motor's own timeout again as it was provisioned.
    RenewTimeout,
    /// Read something whose answer tells which version of its protocol the motor speaks (RMD): the
    /// place of the read among those that do.
    Version(u8),
    /// Read something whose answer tells which motor it is (RMD): 0 its firmware, 1 to 3 the parts
    /// of its model.
    Identity(u8),
}

impl Exchange {
    /// Whether it is a command that stops, or keeps a stopped motor so.
    pub fn is_stop(self) -> bool {
        matches!(
            self,
            Self::Stop
                | Self::PositionStop
                | Self::OverwritePending
                | Self::LockBrake
                | Self::OutputOff
        )
    }
}
