//! One cable to a gateway for many programs: `mgw serve`.
//!
//! [`Multiplexer`] is the whole of it without input or output: bytes and the time in, bytes out.
//! [`serve()`] runs one on a cable and on sockets. PROTOCOL.md, "A server", says what a program
//! sees of it.
#![forbid(unsafe_code)]

mod ask;
mod cable;
mod door;
mod events;
mod multiplexer;
mod program;
mod seen;
mod shell;

pub use multiplexer::{Multiplexer, News, ProgramId};
pub use seen::{SERVER, Seen};
pub use shell::{Listener, Tap, serve};
