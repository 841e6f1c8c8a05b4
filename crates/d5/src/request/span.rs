//! What a request touches in the motor, whatever form it has.

use super::Request;
use crate::payload::Width;
use crate::register::Register;

impl Request {
    /// Whether a write, at once or later, changes a register or a part of it: one data byte goes to
    /// the address, two go to the next one as well (D5 manual, frame format).
    pub fn writes(&self, register: Register) -> bool {
        let (Request::Write { register: Register(first), value }
        | Request::AsyncWrite { register: Register(first), value }) = *self
        else {
            return false;
        };
        let second = match value.width() {
            Width::Byte => first,
            // Behind the last address a motor may go on with the first.
            Width::Word => first.wrapping_add(1),
        };
        let Register(low) = register;
        let word = register.info().is_some_and(|info| info.width == Width::Word);
        let high = if word { low.wrapping_add(1) } else { low };
        [first, second].into_iter().any(|written| written == low || written == high)
    }

    /// Whether the motor may turn otherwise once it has carried this out: any write that touches
    /// the set speed, in whatever width and from whatever address, and the execution of what
    /// waits (D5 manual, registers 0x20 and 0x21, table rows 12 and 13).
    pub fn moves(&self) -> bool {
        *self == Request::Execute || self.writes(Register::SPEED)
    }
}

#[cfg(test)]
mod tests {
    use crate::frame::decode_request_frame;
    use crate::register::Register;

    fn request(frame: [u8; 8]) -> crate::Request {
        decode_request_frame(&frame).unwrap().1
    }

    /// D5 manual, table rows 9, 11 to 13, quick start (4): the set speed is the two bytes from 0x20
    /// on.
    #[test]
    fn whatever_touches_the_set_speed_moves() {
        for frame in [
            [0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D],
            [0xD5, 0x0B, 0x05, 0x04, 0x20, 0x0B, 0x04, 0x43],
            [0xD5, 0x0B, 0x04, 0x03, 0x20, 0x58, 0x00, 0x8A], // the low byte alone
            [0xD5, 0x0B, 0x04, 0x04, 0x21, 0x84, 0x00, 0xB8], // the high one, as printed
            [0xD5, 0x0B, 0x05, 0x03, 0x1F, 0x00, 0x58, 0x8A], // from the register below
            [0xD5, 0x0B, 0x05, 0x03, 0x21, 0x02, 0x00, 0x36], // into the register above
            [0xD5, 0x0B, 0x05, 0x05, 0x00, 0x00, 0x00, 0x15],
            [0xD5, 0xFE, 0x05, 0x03, 0x20, 0x58, 0x02, 0x80], // to all
            [0xD5, 0xFE, 0x05, 0x05, 0x00, 0x00, 0x00, 0x08],
        ] {
            assert!(request(frame).moves(), "{frame:02X?}");
        }
        for frame in [
            [0xD5, 0x0B, 0x05, 0x02, 0x20, 0x00, 0x00, 0x32],
            [0xD5, 0x0B, 0x04, 0x03, 0x1F, 0x58, 0x00, 0x89],
            [0xD5, 0x0B, 0x05, 0x03, 0x1E, 0x00, 0x58, 0x89],
            [0xD5, 0x0B, 0x04, 0x03, 0x22, 0x58, 0x00, 0x8C],
            [0xD5, 0x0B, 0x05, 0x01, 0x00, 0x00, 0x00, 0x11],
        ] {
            assert!(!request(frame).moves(), "{frame:02X?}");
        }
    }

    /// D5 manual, registers 0x10 and 0x11, common commands, row 1.
    #[test]
    fn a_write_of_two_bytes_touches_two_registers() {
        let both = request([0xD5, 0x0B, 0x05, 0x03, 0x10, 0x01, 0x00, 0x24]);
        assert!(both.writes(Register::ACK_LEVEL) && both.writes(Register::TIMEOUT_SWITCH));
        let one = request([0xD5, 0x0B, 0x04, 0x03, 0x10, 0x01, 0x00, 0x23]);
        assert!(one.writes(Register::ACK_LEVEL) && !one.writes(Register::TIMEOUT_SWITCH));
        let id = request([0xD5, 0x0B, 0x05, 0x03, 0x03, 0x0D, 0x00, 0x23]);
        assert!(id.writes(Register::ID) && !id.moves());
    }
}
