//! The page of `mgw serve --view`, and who may open it: HTTP and WebSockets with a token, a check
//! of Host and Origin, and bounds on everything. It knows no motor: what is said is up to the
//! [`House`].
#![forbid(unsafe_code)]

pub mod foxglove;
mod gate;
mod http;
mod outbox;
mod page;
mod shell;
mod socket;

pub use gate::{Gate, Grant, Refusal};
pub use outbox::{Outbox, WAITING};
pub use shell::{House, PAGE_PROTOCOL, STRANGERS, Speech, VISITORS, Visitor, serve};
pub use tungstenite::Message;

/// Bytes of a token that is made here.
const TOKEN_BYTES: usize = 16;

/// A token that nobody can guess: 128 bits of the system's random numbers, in hexadecimal digits.
///
/// # Errors
/// When the system has none.
pub fn new_token() -> std::io::Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(std::io::Error::other)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
