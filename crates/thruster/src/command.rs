//! Command words: the first two bytes of every data field, two ASCII letters.

use codec::Effect;

use crate::table::Request;
pub use crate::table::codes::*;

/// Whether this command sets something: those a device can refuse (Thruster manual §1.3).
pub(crate) const fn sets(command: u16) -> bool {
    matches!(Request::effect_of(command), Some(Effect::Changes | Effect::Later))
}

/// The commands among them that carry something in bytes 2–3, a speed or a sub-command.
pub(crate) const WITH_PARAMETER: [u16; 3] = [ABSOLUTE_POSITION, RELATIVE_POSITION, SET_PARAMETER];
