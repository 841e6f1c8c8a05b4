//! Every command: its name, code, section and fields.

use codec::CommandInfo;

use super::field as f;
use crate::field::command;

/// Defines each command as a constant and all of them as [`COMMANDS`].
macro_rules! commands {
    ($($constant:ident = $info:expr;)*) => {
        $(pub(crate) const $constant: CommandInfo = $info;)*

        /// Every command of the manual, in the order of its codes.
        pub const COMMANDS: &[CommandInfo] = &[$($constant),*];
    };
}

/// A command with this name, code and section "D5 manual, …".
const fn named(name: &'static str, code: u8, section: &'static str) -> CommandInfo {
    CommandInfo::new(name, code as u16, section)
}

commands! {
    QUERY_ID = named("query_id", command::QUERY_ID, "D5 manual, table rows 1 and 2").with_note("may be broadcast");
    READ = named("read", command::READ, "D5 manual, table rows 7 and 8")
        .with_request(f::READ)
        .with_reply(f::REGISTER_VALUE)
        .with_note("without bytes, as many as the register has; the value comes under the register's own name");
    WRITE = named("write", command::WRITE, "D5 manual, table rows 9 and 10")
        .with_request(f::WRITE)
        .with_reply(f::REGISTER_VALUE)
        .with_note("value in the register's unit, or under the register's own name: register 32 takes speed_dps");
    ASYNC_WRITE = named("async_write", command::ASYNC_WRITE, "D5 manual, table rows 11 and 12")
        .with_request(f::WRITE)
        .with_reply(f::REGISTER_VALUE)
        .with_note("as write; waits in the motor for execute");
    EXECUTE = named("execute", command::EXECUTE, "D5 manual, table row 13")
        .with_reply(f::REGISTER_VALUE)
        .with_note("may be broadcast, then unanswered");
    RESET = named("reset", command::RESET, "D5 manual, table row 6")
        .with_note("factory reset, the id becomes 11; may be broadcast, then unanswered");
    SELF_TEST = named("self_test", command::SELF_TEST, "D5 manual, table rows 3 to 5")
        .with_reply(&[f::DATA])
        .with_note("what a healthy motor answers is not printed");
    FAULTY_SELF_TEST = named("faulty_self_test", command::FAULTY_SELF_TEST, "D5 manual, table row 4")
        .with_reply(&[f::MOTOR_ERROR, f::COMMAND_CODE])
        .with_note("a motor answers it with a command error");
    READ_MAGNETIC_ANGLE =
        named("read_magnetic_angle", command::READ_MAGNETIC_ANGLE, "D5 manual, table row 14").with_reply(&[f::ANGLE]);
}
