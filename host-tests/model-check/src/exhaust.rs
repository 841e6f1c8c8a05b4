//! Small-scope exhaustion: from prepared states every sequence of letters up to a depth, each
//! judged by the model of the promises.
//!
//! A [letter](alphabet::Letter) is what a host, a motor, a bus or time does; a sequence that is
//! judged is a prefix of longer ones. Two axes are configured, of each pair of protocols that may
//! share a bus and of pairs on two buses ([`PAIRS`]), and brought into a
//! [prepared state](Prepared). A state that was reached before with as many letters to go is not
//! gone on from: what follows is the same.

mod alphabet;
mod bytes;
mod pairs;
mod prepared;
mod run;
mod search;
#[cfg(test)]
mod tests;

pub use alphabet::{Letter, alphabet};
pub use pairs::{PAIRS, Pair};
pub use prepared::{Prepared, prepare};
pub use run::{Limits, Part, run};
pub use search::{Found, Search, What};
