//! What the tests and benchmarks of the codecs share.

mod can_frame;
mod line;

pub use can_frame::CanFrame;
pub use line::{check_deframer, deframed};
