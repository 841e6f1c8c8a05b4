//! What the tests and benchmarks of the codecs share.

mod line;
mod table;
mod vector;
mod wire;

pub use host_protocol::CanFrame;
pub use line::{check_deframer, deframed};
pub use table::{check_names, fields_in_range, numbers_of};
pub use vector::{Codec, Decoded, Vector, check, found_on_line, vectors};
pub use wire::{Wire, hex};
