//! A row of a command table.

use crate::field::FieldInfo;

/// Name of whatever has none in a codec's table.
pub const UNKNOWN: &str = "unknown";

/// One command of a manual: what its request and its reply carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandInfo {
    /// Name in snake_case, the same for the request and the reply; unique in its table.
    pub name: &'static str,
    /// Command code or word on the wire; of a frame that a motor returns by itself, its header.
    pub code: u16,
    /// Where the manual describes it.
    pub section: &'static str,
    /// Fields of the request in the order of the wire: those that the codec's `Request::build`
    /// asks for.
    pub request: &'static [FieldInfo],
    /// Fields of the reply in the order of the wire.
    pub reply: &'static [FieldInfo],
    /// What else a sender should know; often empty.
    pub note: &'static str,
}

impl CommandInfo {
    /// A command without fields and note.
    pub const fn new(name: &'static str, code: u16, section: &'static str) -> CommandInfo {
        CommandInfo { name, code, section, request: &[], reply: &[], note: "" }
    }

    /// The command with these fields in its request.
    pub const fn with_request(self, request: &'static [FieldInfo]) -> CommandInfo {
        CommandInfo { request, ..self }
    }

    /// The command with these fields in its reply.
    pub const fn with_reply(self, reply: &'static [FieldInfo]) -> CommandInfo {
        CommandInfo { reply, ..self }
    }

    /// The command with this note.
    pub const fn with_note(self, note: &'static str) -> CommandInfo {
        CommandInfo { note, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: FieldInfo = FieldInfo::integer("id", "", 1, 32);
    const ENABLED: FieldInfo = FieldInfo::boolean("enabled");

    #[test]
    fn a_row_is_put_together() {
        let bare = CommandInfo::new("set_id", 0x4349, "§2.2");
        let full =
            bare.with_request(&[ID]).with_reply(&[ID, ENABLED]).with_note("acts after a restart");
        let expected = CommandInfo {
            name: "set_id",
            code: 0x4349,
            section: "§2.2",
            request: &[ID],
            reply: &[ID, ENABLED],
            note: "acts after a restart",
        };
        assert_eq!(full, expected);
        assert_eq!(bare, CommandInfo { request: &[], reply: &[], note: "", ..expected });
    }
}
