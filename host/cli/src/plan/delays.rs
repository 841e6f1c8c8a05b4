//! The file of reply delays that `mgw bench --delays` writes and `mgw plan --delays` reads.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::config::Source;
use crate::failure::Failure;

/// The longest delay that is taken for one, µs.
const LONGEST_US: u32 = 1_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// By axis, µs.
    reply_delay_us: BTreeMap<String, u32>,
}

/// The delays of a file: axis and µs.
pub fn read(source: &Source) -> Result<Vec<(u8, u32)>, Failure> {
    let wrong = |what: &str| Failure::Usage(format!("{}: {what}", source.path));
    let file: File = toml::from_str(&source.text).map_err(|error| {
        wrong(&format!(
            "{}; it takes a table reply_delay_us with AXIS = MICROSECONDS",
            error.message()
        ))
    })?;
    file.reply_delay_us
        .into_iter()
        .map(|(axis, us)| {
            let number = axis.parse().ok().filter(|axis| usize::from(*axis) < gateway::MAX_AXES);
            let number: u8 = number.ok_or_else(|| wrong(&format!("{axis} is no axis, 0 to 31")))?;
            let range =
                format!("the delay of axis {axis} is {us}, and may be 0 to {LONGEST_US} µs");
            if us > LONGEST_US { Err(wrong(&range)) } else { Ok((number, us)) }
        })
        .collect()
}
