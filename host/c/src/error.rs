//! What went wrong, as a number and in words.

use std::cell::RefCell;
use std::ffi::{CString, c_char};

use mgw_client::ClientError;

/// How a call ended.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum mgw_result {
    /// It is done.
    Ok = 0,
    /// The gateway refused it, or could not do it: `mgw_error_number` has the number of
    /// PROTOCOL.md.
    Refused = 1,
    /// No answer came in time. Whether it was done is not known.
    NoAnswer = 2,
    /// The connection failed, or could not be made.
    Lost = 3,
    /// A stop was sent and nothing answered. The gateway may have stopped the motors all the same,
    /// and does when it no longer hears this host.
    StopNotConfirmed = 4,
    /// An argument is wrong; nothing was sent.
    WrongArgument = 5,
}

/// A call that has failed.
#[derive(Debug)]
pub(crate) struct Failure {
    result: mgw_result,
    number: u16,
    text: String,
}

impl Failure {
    /// An argument is wrong.
    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self { result: mgw_result::WrongArgument, number: 0, text: text.into() }
    }

    /// The connection could not be made.
    pub(crate) fn lost(text: impl Into<String>) -> Self {
        Self { result: mgw_result::Lost, ..Self::argument(text) }
    }
}

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        let result = match &error {
            ClientError::Gateway(_) | ClientError::Incompatible { .. } => mgw_result::Refused,
            ClientError::NamedTwice { .. }
            | ClientError::NoSuchAxis { .. }
            | ClientError::TooLong { .. } => mgw_result::WrongArgument,
            ClientError::StopUnanswered { .. } => mgw_result::StopNotConfirmed,
            ClientError::NoAnswer { .. } | ClientError::UnreadableReply { .. } => {
                mgw_result::NoAnswer
            }
            _ => mgw_result::Lost,
        };
        let number = match &error {
            ClientError::Gateway(error) => error.number(),
            _ => 0,
        };
        Self { result, number, text: error.to_string() }
    }
}

thread_local! {
    /// The number and the text of the last failure of this thread.
    static LAST: RefCell<(u16, CString)> = RefCell::new((0, CString::default()));
}

/// Notes how a call of this thread has ended.
pub(crate) fn ended(result: Result<(), Failure>) -> mgw_result {
    let Err(Failure { result, number, text }) = result else { return mgw_result::Ok };
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    LAST.set((number, text));
    result
}

/// What was wrong with the last call of this thread that failed, and what to do, as UTF-8. It is
/// valid until the next call of this thread that fails; empty before the first.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_error_text() -> *const c_char {
    LAST.with_borrow(|(_, text)| text.as_ptr())
}

/// The number of the gateway's error behind the last call of this thread that failed, as
/// PROTOCOL.md lists them; 0 where it was none.
#[unsafe(no_mangle)]
pub extern "C" fn mgw_error_number() -> u16 {
    LAST.with_borrow(|(number, _)| *number)
}
