//! The protocol as data: every command with its code, its section of the manual, and its values
//! with place, name, unit and range. Requests, replies, their bytes, and how tools list, build and
//! print them follow from it. What registers hold is in their [table](crate::register).
//!
//! Numbers of a line are counts of the wire; their units and ranges are those of their types.

use codec::Effect;

use crate::command::RESET_DONE;
use crate::field::{ID_MARK, RESET_MARK, SELF_TEST_BYTES};
use crate::motor_error::{ErrorFields, MotorError};
use crate::payload::{Payload, Value, Width};
use crate::register::Register;
use crate::register_fields::{ReadFields, ReadValue, WrittenValue};
use crate::units::TurnDegrees;

codec::commands! {
    /// Every command of the manual, in the order of its codes.
    COMMANDS of "D5 manual, ";

    /// A request, to one motor or, where [`Address::Broadcast`](crate::Address::Broadcast) allows
    /// it, to all.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    enum Request;

    /// A reply of one motor.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    #[cfg_attr(feature = "defmt", derive(defmt::Format))]
    enum Reply;

    layout Payload, code u8;

    /// Report the id.
    QUERY_ID = 0x01, Reads, "table rows 1 and 2", "may be broadcast";
        request(QueryId);
        reply(/** The frame's id byte is the motor's id. */ Id [[ID_MARK; 3]]);
    /// Read a register, or two.
    READ = 0x02, Reads, "table rows 7 and 8",
        "without bytes, as many as the register has; the value comes under the register's own name";
        request(Read {
            /// The register, or the lower of two.
            register: Register = 2,
            width: Width = 0,
        } via ReadFields);
        reply(Read {
            /// The register, or the lower of two.
            register: Register = 2,
            value: Value = 3,
        } via ReadValue);
    /// Write a register.
    WRITE = 0x03, Changes, "table rows 9 and 10",
        "value in the register's unit, or under the register's own name: register 32 takes speed_dps";
        request(Write { register: Register = 2, value: Value = 3 } via WrittenValue);
        reply(
            /// The write repeated.
            Written { register: Register = 2, value: Value = 3 } via WrittenValue
        );
    /// Prepare a write that the next execute carries out.
    ASYNC_WRITE = 0x04, Changes, "table rows 11 and 12", "as write; waits in the motor for execute";
        request(AsyncWrite { register: Register = 2, value: Value = 3 } via WrittenValue);
        reply(
            /// The asynchronous write repeated; it waits.
            AsyncWritten { register: Register = 2, value: Value = 3 } via WrittenValue
        );
    /// Carry out the write that waits.
    EXECUTE = 0x05, Changes, "table row 13", "may be broadcast, then unanswered";
        request(Execute);
        reply(
            /// The write that waited has been carried out.
            Executed { register: Register = 2, value: Value = 3 } via WrittenValue
        );
    /// Reset to factory settings; the id becomes 0x0B as well.
    RESET = 0x06, Changes, "table row 6",
        "factory reset, the id becomes 11; may be broadcast, then unanswered";
        request(Reset);
    /// Self test.
    SELF_TEST = 0xCF, Reads, "table rows 3 to 5", "what a healthy motor answers is not printed";
        request(SelfTest [SELF_TEST_BYTES]);
        reply(
            /// Whatever a motor answers that is not an error.
            SelfTest { raw: Payload = 0 as "data" }
        );
    /// The self test spoilt with a command that no motor knows.
    FAULTY_SELF_TEST = 0xCE, Reads, "table row 4", "a motor answers it with a command error";
        request(FaultySelfTest [SELF_TEST_BYTES]; elsewhere);
        shows(ErrorFields::SHOWN);
    /// Read the magnetic angle.
    READ_MAGNETIC_ANGLE = 0xD4, Reads, "table row 14";
        request(ReadMagneticAngle);
        reply(MagneticAngle { angle: TurnDegrees = 3 as "angle_deg" span (0, 360) });

    also request {
        (
            /// A command that has no variant here: length, command, address, low and high byte as
            /// they are.
            Unknown { raw: Payload = 0 as "data" }
        ) code raw.command(), info None, effect Effect::Changes;
    }
    also reply {
        (
            /// 00: the reset is done; it comes from the factory id (D5 manual, table row 6).
            ResetDone [[RESET_MARK; 3]]
        ) code RESET_DONE, info Some(&RESET);
        (
            /// The motor finds a request faulty (D5 manual, table rows 3 to 5).
            Error {
                /// What is wrong.
                error: MotorError = 2,
                /// Command code of that request; for a checksum error of the one before.
                command: u8 = 1,
            } via ErrorFields
        ) code *command, info COMMANDS.iter().find(|info| info.code == u16::from(*command));
        (
            /// A reply that has no variant here: length, command, address, low and high byte as
            /// they are.
            Unknown { raw: Payload = 0 as "data" }
        ) code raw.command(), info None;
    }
    also rows {}
}
