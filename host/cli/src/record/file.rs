//! The files of a recording: MCAP, one behind the other as each gets long.

use std::collections::{BTreeMap, HashMap};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};

use super::encode::{Losses, Message};
use super::schemas::Schema;
use super::{Place, Summary};
use crate::failure::Failure;
use crate::written::{self, unwritten};

/// What a message takes in a file besides its text: record, header, and its place in the index.
const OVERHEAD: u64 = 9 + 22 + 16;

/// Where bytes go.
pub type Sink = Box<dyn Write + Send>;
/// Opens the file of this path.
pub type Opener = Box<dyn FnMut(&Path) -> io::Result<Sink> + Send>;

/// What holds for every file.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// A file ends when it has grown to this, bytes.
    pub longest: u64,
    /// When the recording began, since 1970.
    pub since_epoch: Duration,
}

/// Opens files on the disk.
pub fn opener(place: Place) -> Opener {
    Box::new(move |path| Ok(Box::new(written::open(path, place.force)?)))
}

/// The files of a recording.
pub struct Files {
    first: PathBuf,
    limits: Limits,
    open: Opener,
    current: Current,
    summary: Summary,
}

/// The file that is written.
struct Current {
    writer: Writer<NoSeek<Sink>>,
    channels: HashMap<String, (u16, u32)>,
    bytes: u64,
}

impl Files {
    /// Creates the first one.
    pub fn create(first: PathBuf, limits: Limits, mut open: Opener) -> Result<Self, Failure> {
        let current = Current::create(&first, &mut open)?;
        let summary = Summary { files: vec![first.clone()], ..Summary::default() };
        Ok(Self { first, limits, open, current, summary })
    }

    pub fn write(&mut self, message: &Message) -> Result<(), Failure> {
        if self.current.bytes >= self.limits.longest {
            self.next()?;
        }
        let written = self.current.write(message, self.limits.since_epoch);
        let written = written.map_err(|error| self.failed(error))?;
        self.summary.messages += 1;
        self.summary.bytes += written;
        Ok(())
    }

    fn next(&mut self) -> Result<(), Failure> {
        self.current.writer.finish().map_err(|error| self.failed(error))?;
        let path = numbered(&self.first, self.summary.files.len() + 1);
        self.current = Current::create(&path, &mut self.open)?;
        self.summary.files.push(path);
        Ok(())
    }

    /// What was written so far can be read, also when nothing more follows.
    pub fn flush(&mut self) -> Result<(), Failure> {
        self.current.writer.flush().map_err(|error| self.failed(error))
    }

    /// Ends the last file.
    pub fn finish(mut self, losses: Losses) -> Result<Summary, Failure> {
        let Losses { by_gateway, on_the_way, unwritten } = losses;
        let losses_of = [
            ("lost_by_gateway", by_gateway),
            ("lost_on_the_way", on_the_way),
            ("lost_unwritten", unwritten),
        ];
        let metadata = losses_of.map(|(name, count)| (name.to_owned(), count.to_string()));
        let metadata =
            Metadata { name: "mgw.losses".to_owned(), metadata: BTreeMap::from(metadata) };
        let writer = &mut self.current.writer;
        let ended = writer.write_metadata(&metadata).and_then(|()| writer.finish().map(drop));
        ended.map_err(|error| self.failed(error))?;
        Ok(Summary { losses, ..self.summary })
    }

    fn failed(&self, error: McapError) -> Failure {
        let path = self.summary.files.last().unwrap_or(&self.first);
        failed(path, error)
    }
}

fn failed(path: &Path, error: McapError) -> Failure {
    let source = match error {
        McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    };
    unwritten(path, source)
}

/// `run.mcap` as `run.2.mcap`.
pub fn numbered(first: &Path, number: usize) -> PathBuf {
    let extension = first.extension().map(|extension| extension.to_string_lossy());
    first.with_extension(match extension {
        Some(extension) => format!("{number}.{extension}"),
        None => number.to_string(),
    })
}

impl Current {
    fn create(path: &Path, open: &mut Opener) -> Result<Self, Failure> {
        let sink = open(path).map_err(|source| unwritten(path, source))?;
        // Without seeking a chunk goes out whole, so no reader ever finds one half described.
        let mut writer = WriteOptions::new()
            .compression(None)
            .disable_seeking(true)
            .library(concat!("mgw ", env!("CARGO_PKG_VERSION")))
            .create(NoSeek::new(sink))
            .map_err(|error| failed(path, error))?;
        writer.flush().map_err(|error| failed(path, error))?;
        Ok(Self { writer, channels: HashMap::new(), bytes: 0 })
    }

    fn write(&mut self, message: &Message, since_epoch: Duration) -> Result<u64, McapError> {
        let (channel_id, sequence) = match self.channels.get_mut(&message.topic) {
            Some((channel, sequence)) => {
                *sequence = sequence.wrapping_add(1);
                (*channel, *sequence)
            }
            None => {
                let channel = self.channel(&message.topic, message.schema)?;
                self.channels.insert(message.topic.clone(), (channel, 0));
                (channel, 0)
            }
        };
        let log_time = nanoseconds(since_epoch + message.at);
        let publish_time = message.gateway_us.map_or(log_time, |us| us.saturating_mul(1_000));
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        let data = message.value.to_string();
        self.writer.write_to_known_channel(&header, data.as_bytes())?;
        self.bytes += OVERHEAD + data.len() as u64;
        Ok(data.len() as u64)
    }

    /// A channel of a topic, with its schema.
    fn channel(&mut self, topic: &str, schema: Schema) -> Result<u16, McapError> {
        let text = schema.json().to_string();
        // The same schema again is the same one.
        let schema = self.writer.add_schema(schema.name(), "jsonschema", text.as_bytes())?;
        self.writer.add_channel(schema, topic, "json", &BTreeMap::new())
    }
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
