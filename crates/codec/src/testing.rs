//! What the tests and benchmarks of the codecs share.

extern crate std;

mod can_frame;
mod line;
mod vector;

pub use can_frame::CanFrame;
pub use line::{check_deframer, deframed};
pub use vector::{Vector, vectors};
