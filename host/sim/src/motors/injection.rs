//! What a test can break in a motor.

use std::time::Duration;

use host_protocol::MAX_CAN_DATA;

/// How something outside turns a shaft: at a speed, then it holds it still, and so on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Turning {
    /// mrad/s.
    pub speed: i32,
    /// So long it turns the shaft.
    pub turns: Duration,
    /// So long it holds the shaft; zero: never.
    pub holds: Duration,
}

/// How the data of an answer begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
pub struct Beginning {
    bytes: [u8; MAX_CAN_DATA],
    length: usize,
}

impl Beginning {
    /// The first bytes of an answer, at most a data field of CAN.
    #[must_use]
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut beginning = Self { length: bytes.len(), ..Self::default() };
        beginning.bytes.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(beginning)
    }

    /// Whether `data` begin so.
    pub(crate) fn is_of(&self, data: &[u8]) -> bool {
        self.length > 0 && data.starts_with(&self.bytes[..self.length])
    }
}

/// The faults: switches with the names that scenarios give them, values, and what the world does to
/// the shaft and its sensors.
macro_rules! injections {
    (
        switches: $($(#[$switch_doc:meta])+ $switch:ident $switch_field:ident $name:literal;)+
        values: $($(#[$value_doc:meta])+ $value:ident $value_field:ident: $value_type:ty;)+
        outside: $($(#[$out_doc:meta])+ $out:ident $out_field:ident: $out_type:ty;)+
    ) => {
        /// A fault to put into a motor, or to take out of it again. Each kind is independent of the
        /// others.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Injection {
            $($(#[$switch_doc])+ $switch(bool),)+
            $($(#[$value_doc])+ $value($value_type),)+
            $($(#[$out_doc])+ $out($out_type),)+
        }

        impl Injection {
            /// The names of the faults that are switched on and off.
            pub const SWITCHES: &[&str] = &[$($name),+];

            /// The fault with this name, switched on or off; those that take a value have none.
            #[must_use]
            pub fn switch(name: &str, on: bool) -> Option<Self> {
                match name { $($name => Some(Self::$switch(on)),)+ _ => None }
            }
        }

        /// The faults that are in force in one motor.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
        pub(crate) struct Injections {
            $(pub(crate) $switch_field: bool,)+
            $(pub(crate) $value_field: $value_type,)+
            pub(crate) outside: Outside,
        }

        /// What the world does to a shaft and its sensors.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
        #[cfg_attr(feature = "snapshot", derive(serde::Serialize, serde::Deserialize))]
        pub(crate) struct Outside {
            $(pub(crate) $out_field: $out_type,)+
        }

        impl Injections {
            pub(crate) fn apply(&mut self, injection: Injection) {
                match injection {
                    $(Injection::$switch(on) => self.$switch_field = on,)+
                    $(Injection::$value(value) => self.$value_field = value,)+
                    $(Injection::$out(value) => self.outside.$out_field = value,)+
                }
            }
        }
    };
}

injections! {
    switches:
    /// Its transmitter is dead: it hears and obeys, and answers nothing.
    Mute mute "mute";
    /// Its cable is off the bus: it hears nothing and acknowledges nothing.
    Unplugged unplugged "unplugged";
    /// The data of its answers are random bytes.
    Garbage garbage "garbage";
    /// Its answers have a wrong checksum. On CAN, where the protocol has none of its own, the
    /// frame's own checksum.
    WrongChecksum wrong_checksum "wrong-checksum";
    /// Its shaft cannot turn.
    StuckRotor stuck_rotor "stuck-rotor";
    /// It answers stop commands and does not stop.
    IgnoreStop ignore_stop "ignore-stop";
    /// It answers commands that move and does not carry them out. An RMD answers with the command's
    /// own bytes.
    IgnoreMotion ignore_motion "ignore-motion";
    /// Thruster: it refuses whatever sets something, without a fault.
    Refuse refuse "refuse";
    /// RMD: when a fault goes it resumes what it did before the fault, whatever it was told
    /// meanwhile.
    ResumeAfterFault resume_after_fault "resume-after-fault";
    /// Thruster: the device has an encoder and takes position commands.
    Encoder encoder "encoder";
    /// Thruster: after its own timeout the next command, a poll too, lets it run on. The manual
    /// leaves that open.
    ResumeAfterTimeout resume_after_timeout "resume-after-timeout";
    /// It reads leniently: unused bytes may be anything, missing ones count as zero, no pause ends
    /// a frame on RS485, a D5 motor looks at no checksum and obeys any command to all.
    Lenient lenient "lenient";
    /// RMD: it has a holding brake, locked from when it is switched on until 0x77 (RMD V3.6 §2.27).
    Brake brake "brake";
    /// RMD: it hears 0x76 and does not restart.
    IgnoreRestart ignore_restart "ignore-restart";
    /// RMD: its brake does not open; 0x77 is echoed.
    StuckBrake stuck_brake "stuck-brake";
    /// RMD: it answers a command that it does not know with a copy of its last answer (observed).
    StaleReplies stale_replies "stale-replies";
    /// RMD: after its own timeout it neither swallows a command nor says 0xF1 every second.
    PlainTimeout plain_timeout "plain-timeout";
    /// RMD: it answers 0x77 at once, without the 50 to 150 ms that real brakes take.
    PromptBrake prompt_brake "prompt-brake";
    /// RMD: it restarts in 10 ms, without the silence of about 1.1 s.
    PromptRestart prompt_restart "prompt-restart";
    /// RMD: after 0x20 index 5 it answers from its old id until it restarts.
    KeepsReplyId keeps_reply_id "keeps-reply-id";
    /// RMD: what it stores it stores only while its output is off, and echoes it all the same
    /// (V4.4).
    StoresOnlyOff stores_only_off "stores-only-off";
    /// RMD: it sends its status 2 every 100 ms by itself, and does not answer 0x9C any more (0xB6
    /// of V3.9).
    ActiveReplies active_replies "active-replies";
    /// D5: it hears what goes to other motors, and answers that it was not for it (D5 manual, table
    /// row 5).
    AnswersOthers answers_others "answers-others";
    /// D5: its register 0x2B is 1. It holds, and ignores speeds.
    BrakeOn brake_on "brake-on";

    values:
    /// RMD: the number of the dialect that it speaks; 0: V3.6.
    RmdDialect rmd_dialect: u8;
    /// RMD: the date of its firmware; 0: 20220206.
    RmdFirmware rmd_firmware: u32;
    /// These bits stand in its fault word; 0 takes the cause away. Whether the bits then go depends
    /// on the motor.
    FaultBits fault_bits: u16;
    /// It begins its answers so long after a request; nothing: as long as its make takes.
    ReplyTime reply_time: Option<Duration>;
    /// It answers later than usual by this much.
    LateReply late_reply: Duration;
    /// So many of its next answers get lost on the way.
    LoseReplies lose_replies: u32;
    /// Its answers that begin with these bytes get lost on the way; none where there are no bytes.
    LoseAnswersLike lost: Beginning;
    /// It answers later than usual by a random time up to this.
    ReplyJitter reply_jitter: Duration;

    outside:
    /// Something outside turns its shaft, whatever the motor does.
    Turning turning: Option<Turning>;
    /// Its sensor of the current reads this, mA.
    Current current_ma: Option<i32>;
    /// Its winding is so hot, °C.
    MotorTemperature motor_c: Option<i16>;
    /// Its driver is so hot, °C.
    DriverTemperature driver_c: Option<i16>;
}
