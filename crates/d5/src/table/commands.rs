//! Every command: its name, code, section and fields.

use super::CommandInfo;
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
    QUERY_ID = named("query_id", command::QUERY_ID, "D5 manual, table rows 1 and 2").note("may be broadcast");
    READ = named("read", command::READ, "D5 manual, table rows 7 and 8")
        .request(f::READ)
        .reply(f::REGISTER_VALUE)
        .note("without bytes, as many as the register has; the value comes under the register's own name");
    WRITE = named("write", command::WRITE, "D5 manual, table rows 9 and 10")
        .request(f::WRITE)
        .reply(f::REGISTER_VALUE)
        .note("value in the register's unit, or under the register's own name: register 32 takes speed_dps");
    ASYNC_WRITE = named("async_write", command::ASYNC_WRITE, "D5 manual, table rows 11 and 12")
        .request(f::WRITE)
        .reply(f::REGISTER_VALUE)
        .note("as write; waits in the motor for execute");
    EXECUTE = named("execute", command::EXECUTE, "D5 manual, table row 13")
        .reply(f::REGISTER_VALUE)
        .note("may be broadcast, then unanswered");
    RESET = named("reset", command::RESET, "D5 manual, table row 6")
        .note("factory reset, the id becomes 11; may be broadcast, then unanswered");
    SELF_TEST = named("self_test", command::SELF_TEST, "D5 manual, table rows 3 to 5")
        .reply(&[f::DATA])
        .note("what a healthy motor answers is not printed");
    FAULTY_SELF_TEST = named("faulty_self_test", command::FAULTY_SELF_TEST, "D5 manual, table row 4")
        .reply(&[f::MOTOR_ERROR, f::COMMAND_CODE])
        .note("a motor answers it with a command error");
    READ_MAGNETIC_ANGLE =
        named("read_magnetic_angle", command::READ_MAGNETIC_ANGLE, "D5 manual, table row 14").reply(&[f::ANGLE]);
}
