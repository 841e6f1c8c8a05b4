//! The promises, one by one, and how a broken one is told.

use std::fmt;

macro_rules! checks {
    ($($(#[$rule:meta])+ $name:ident,)+) => {
        /// A promise that is checked. `Gn` is its rule in the product's guarantees.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Check {
            $($(#[$rule])+ $name,)+
        }

        impl Check {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name,)+];
        }
    };
}

checks! {
    /// G1: no motion frame for an axis that is not armed; native and raw ones included.
    MotionUnarmed,
    /// G2: no motion frame without a setpoint that still lives; refreshes included.
    MotionExpired,
    /// G4: no motion frame after a stop or a trip until the next arming.
    MotionAfterStop,
    /// G2: what is refreshed is the newest setpoint, unchanged.
    MotionStale,
    /// G2: native 0xA8, LR and D5 04, 05 go out exactly once.
    MotionTwice,
    /// G4: motion that waits in the controller when its axis is stopped is asked back.
    MotionKept,
    /// G2: broadcast motion is never sent.
    Broadcast,
    /// G10: what starts several D5 motors goes out once, when a speed waits in each that was named
    /// and may move, and nothing in any other of its bus, which is exclusive; its result says what
    /// has happened.
    StartUnproved,
    /// G5: the first stop frame leaves within its bound.
    StopLate,
    /// G4: until the first stop has left, nothing else is started on that bus.
    StopNotFirst,
    /// G4: every stop is sent at least twice.
    StopOnce,
    /// G4: a stop is repeated, until it is confirmed and while the axis is tripped.
    StopForgotten,
    /// G4: a stop is confirmed by its acknowledgement and, for hold and brake, two readings of
    /// standstill after that.
    ConfirmedUnproved,
    /// G4: what is sent is the stop action of the configuration.
    WrongStopAction,
    /// G4: a stop that has not left 100 ms after its bound is told not to be sent, and its axis to
    /// be unreachable unless it was at rest.
    UnsentUntold,
    /// G1: a trip ends only by a request to clear it.
    TripForgotten,
    /// G1: only an arm request of the link in command arms.
    ArmedUnasked,
    /// G1: an axis is armed when its motor has answered what its protocol asks, stands, has no
    /// fault and, unless the axis allows otherwise, a timeout of its own that is known.
    ArmedUnproved,
    /// G1: while the e-stop is latched nothing is armed.
    EStopIgnored,
    /// G1: a setpoint of another epoch is refused.
    EpochIgnored,
    /// G2: a setpoint is refused unless now < expiry ≤ now + TTL.
    ExpiryIgnored,
    /// G9: a link that is not in command is refused.
    AuthorityIgnored,
    /// G9: a request has at most one result, and a result belongs to a request.
    ResultUnasked,
    /// G9: every request has a result.
    ResultMissing,
    /// G9: a repeated request gets the same bytes.
    ResultChanged,
    /// G9: a host is told one whole frame after another, and loses no event while it reads.
    ToldInPart,
    /// G10: raw access only where it is open, while every axis there is at rest and no e-stop is
    /// latched.
    RawUnopened,
    /// G10: a raw frame that a lenient motor might obey is refused.
    RawHarmful,
    /// G7: a frame to one axis moves and changes no other's motor.
    WrongMotor,
    /// G7: ids on which one axis is sent requests are none on which another's motor acts or
    /// answers.
    IdShared,
    /// G7: D5 motors run at 200001 to 222222 bit/s (D5 manual, point 3), so a bus with them has
    /// such a rate and carries nothing else.
    BusShared,
    /// G7: an axis that is moved leaves nothing behind.
    LeftBehind,
    /// G2: an accepted setpoint is sent in time, or the axis trips.
    NotDelivered,
    /// G3: the fault words of armed axes are read in time.
    FaultsUnread,
    /// G2: what is sent exceeds no limit, by rounding either.
    LimitOnWire,
    /// G2: a limit that nothing can measure is refused.
    LimitBlind,
    /// G1: a threshold of standstill below the unit of the motor's readings is refused.
    StandstillBlind,
    /// G1: an epoch is not given twice, nor after a loss of power.
    EpochRepeated,
    /// G2: nothing changes a motor while its axis is armed; arming frees a brake only where the
    /// axis says so, and changes nothing else (G1).
    ChangedWhileArmed,
    /// A motor is sent nothing that its dialect lacks, or takes for something else
    /// (docs/rmd-dialects.md).
    NotInDialect,
    /// G7: a bus that goes off trips what may move there.
    BusOffIgnored,
    /// G7: frames sent, received, lost, not acknowledged and given back, and times that a bus went
    /// off, are counted as they were.
    CountWrong,
    /// G6: after a reset nothing is armed, what was in motion or tripped is tripped, the e-stop
    /// stays latched, the configuration is the same, and the starts are counted.
    ResetForgot,
    /// What follows from an event comes to an end: nothing is asked back for what is asked back for
    /// it in turn (G4).
    Restless,
    /// Nothing that comes in makes the core panic, and what it keeps is what a look at everything
    /// gives.
    Panicked,
    /// A bus had a frame, and nobody was told to ask for it.
    NotNamed,
    /// G8: the last 16 trips and starts are remembered, over a reset too.
    HistoryWrong,
    /// G6: after a loss of power nothing is configured but what is stored.
    PowerLossKept,
    /// G6: the configuration is stored only while every axis is at rest, and nothing is armed
    /// before that is done.
    StoredInMotion,
}

/// A broken promise.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Which.
    pub check: Check,
    /// When, µs of the gateway's time.
    pub at_us: u64,
    /// What was seen.
    pub seen: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?} at {} µs: {}", self.check, self.at_us, self.seen)
    }
}
