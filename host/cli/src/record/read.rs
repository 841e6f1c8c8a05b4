//! Reads recordings, one message after the other: those that were cut off, and those of others,
//! too.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde_json::Value;

use crate::args::Part;
use crate::failure::Failure;
use crate::given;

/// The longest record of a file that is believed, bytes.
const LONGEST: usize = 256 * 1024 * 1024;

/// A message of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    pub topic: String,
    /// Host time, ns since 1970.
    pub log_ns: u64,
    pub value: Value,
}

impl Recorded {
    /// Gateway time, s; none where the message has no such time.
    pub fn time_s(&self) -> Option<f64> {
        self.value["time_us"].as_f64().map(|us| us / 1e6)
    }

    /// The axes that it is about.
    pub fn axes(&self) -> Vec<u64> {
        let own = [&self.value["axis"], &self.value["body"]["axis"]];
        let of_cycle =
            self.value["axes"].as_array().into_iter().flatten().map(|axis| &axis["axis"]);
        own.into_iter().chain(of_cycle).filter_map(Value::as_u64).collect()
    }
}

impl Part {
    /// Whether a message is of it, and of topics that begin so, where there are any.
    pub fn takes(&self, topics: &[String], message: &Recorded) -> bool {
        let topic = topics.is_empty()
            || topics.iter().any(|topic| message.topic.starts_with(topic.as_str()));
        let axes = message.axes();
        let axis =
            self.axes.is_empty() || self.axes.iter().any(|axis| axes.contains(&u64::from(*axis)));
        let (from, to) = (self.from.unwrap_or(f64::MIN), self.to.unwrap_or(f64::MAX));
        let is_timed = self.from.is_some() || self.to.is_some();
        let in_time = message.time_s().map_or(!is_timed, |at| (from..=to).contains(&at));
        topic && axis && in_time
    }
}

/// Calls `each` with the messages of a file, each chunk of them when its checksum is right. Whether
/// it ends as a recording that was ended does: one that was cut off has no footer.
pub fn file(
    path: &Path,
    mut each: impl FnMut(Recorded) -> Result<(), Failure>,
) -> Result<bool, Failure> {
    let failed = |source| given::unread(path, source);
    let mut source = given::open(path)?;
    let is_whole = has_end(&mut source).map_err(failed)?;
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_record_length_limit(LONGEST)
        .with_prevalidate_chunk_crcs(true);
    for message in MessageReader::new_with_options(BufReader::new(source), options) {
        let message = match message {
            Ok(message) => message,
            // Where it was cut.
            Err(error) if !is_whole && is_cut(&error) => break,
            Err(McapError::Io(error)) => return Err(failed(error)),
            Err(error) => {
                return Err(failed(std::io::Error::new(
                    ErrorKind::InvalidData,
                    format!("it is no MCAP file, or damaged: {error}"),
                )));
            }
        };
        // What others have put in need not be JSON.
        let Ok(value) = serde_json::from_slice::<Value>(&message.data) else { continue };
        each(Recorded { topic: message.channel.topic.clone(), log_ns: message.log_time, value })?;
    }
    Ok(is_whole)
}

/// An end in the middle of a record, and no other fault.
fn is_cut(error: &McapError) -> bool {
    match error {
        McapError::UnexpectedEof | McapError::UnexpectedEoc => true,
        McapError::Io(error) => error.kind() == ErrorKind::UnexpectedEof,
        _ => false,
    }
}

fn has_end(source: &mut File) -> std::io::Result<bool> {
    let length = source.seek(SeekFrom::End(0))?;
    let mut end = [0; mcap::MAGIC.len()];
    // Twice: one is its beginning.
    let is_long = length >= 2 * mcap::MAGIC.len() as u64;
    if is_long {
        source.seek(SeekFrom::Start(length - mcap::MAGIC.len() as u64))?;
        source.read_exact(&mut end)?;
    }
    source.seek(SeekFrom::Start(0))?;
    Ok(is_long && end == mcap::MAGIC)
}
