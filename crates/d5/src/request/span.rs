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
