//! What the three codecs share: command tables as data, building and visiting fields, and the
//! window that finds frames in a stream of bytes.
//!
//! It knows no protocol: names, units, ranges and bytes are the codecs', each of which re-exports
//! the types that its own callers meet.
//!
//! ```
//! use codec::{BuildError, CommandInfo, FieldInfo, FieldValue, Fields};
//!
//! /// A hundredth of an ampere on the wire, as a signed word.
//! const CURRENT: FieldInfo = FieldInfo::physical("current_a", "A", (-32_768, 32_767), 100.0);
//! const TORQUE: CommandInfo = CommandInfo::new("torque_current", 0xA1, "§2.17").with_request(&[CURRENT]);
//!
//! let given = |name: &str| (name == "current_a").then_some(1.5);
//! assert_eq!(Fields(&given).count(&TORQUE.request[0]), Ok(150_i16));
//!
//! let mut shown = None;
//! CURRENT.visit_count(&mut |name, value| shown = Some((name, matches!(value, FieldValue::Physical(1.5)))), 150);
//! assert_eq!(shown, Some(("current_a", true)));
//!
//! let refused = BuildError::OutOfRange { field: "current_a", value: 400.0, min: -327.68, max: 327.67 };
//! assert_eq!(Fields(&|_| Some(400.0)).count::<i16>(&CURRENT), Err(refused));
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod build;
mod command;
mod commands;
mod count;
mod deframer;
mod error;
mod field;
mod flags;
mod layout;
mod node;
mod shown;
mod value;

pub use build::{BuildError, Fields};
pub use command::{CommandInfo, UNKNOWN};
pub use commands::Effect;
#[doc(hidden)]
pub use commands::{ascii, count, joined, snake_case};
pub use count::nearest_count;
pub use deframer::{Deframer, Framing};
pub use error::{EncodeError, check_number, check_range};
pub use field::{FieldInfo, FieldKind};
pub use layout::{Decode, Encode, Layout};
pub use shown::{Built, Number, Shown};
pub use value::{FieldValue, Visit};
