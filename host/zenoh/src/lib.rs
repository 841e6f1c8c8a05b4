//! A gateway of motors in the key space of a zenoh network: `mgw-zenoh`.
//!
//! The program is a client of its gateway like any other, through `mgw serve`. Three of its parts
//! have a connection each: [`eye`](crate) tells what is, the hand does what the one peer in command
//! asks, a brake stops for anybody. What may be sent for whom is decided in `authority`, `keys` and
//! `command`, which know neither zenoh nor sockets nor a clock.
//!
//! [`Commander`] is the other side: a peer that takes command of a gateway, wherever it is.
#![forbid(unsafe_code)]

mod args;
mod authority;
mod brake;
mod clock;
mod command;
mod commander;
mod door;
mod eye;
mod hand;
mod keys;
mod leash;
mod network;
mod program;
mod reach;
mod refusal;
mod state;

pub use commander::{Armed, Commander, Refused, ask};
pub use keys::ROOT;
pub use network::{Endpoints, open};
pub use program::main;
