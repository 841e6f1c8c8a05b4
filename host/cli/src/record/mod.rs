//! Recordings: what a gateway says, and what it is asked, as an MCAP file that other programs read.
//!
//! Whoever has something to record puts it into a [`Tap`], which never waits. A thread takes it
//! out, has the [`Encoder`] make messages of it, and writes them. docs/recording.md says what a
//! file has.

mod encode;
mod export;
mod file;
mod item;
mod picture;
mod play;
mod plot;
mod read;
mod schemas;
mod show;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use host_protocol::Kind;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::output::Output;
use crate::written::unwritten;

use file::{Files, Limits};

pub use encode::{Encoder, Losses, Message};
pub use item::{Item, What};
pub use mcap::MAGIC;
pub use picture::{has_font, not_drawn};
pub use play::run as play;
pub use plot::run as plot;
pub use read::file as each_message;
pub use schemas::Schema;

/// Says of a recording that it has no end.
pub fn tell_cut_off(path: &Path, out: Output) -> Result<(), Failure> {
    let file = path.display().to_string();
    out.aside(format!("{file} was cut off: what was written before that is here"));
    out.object(&crate::json::line("cut_off", json!({ "file": file })))
}

/// What waits to be written, at most: 4 s of eight axes at 1 kHz. Beyond that it is lost, and
/// counted.
const WAITING: usize = 32_768;
/// What was taken is in the file after this time at the latest, if the disk is fast enough.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// Files of a recording that are looked for before it begins.
const LOOKED_AT: usize = 1_000;

/// Where a recording goes.
#[derive(Debug, Clone)]
pub struct Place {
    /// The first file; the others have a number before the extension.
    pub path: PathBuf,
    /// A file ends when it has grown to this, bytes.
    pub longest: u64,
    /// A file that is there already is written over.
    pub force: bool,
}

/// How a recording went.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Summary {
    /// The files, in order.
    pub files: Vec<PathBuf>,
    /// Messages in all of them.
    pub messages: u64,
    /// Bytes of these messages.
    pub bytes: u64,
    /// What is not in them.
    pub losses: Losses,
}

impl Summary {
    /// For people.
    pub fn text(&self) -> String {
        let Losses { by_gateway, on_the_way, unwritten } = self.losses;
        let files: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        format!(
            "{} messages in {}; lost: {by_gateway} by the gateway, {on_the_way} on the way, \
             {unwritten} because the disk was too slow",
            self.messages,
            files.join(", ")
        )
    }

    /// For programs.
    pub fn fields(&self) -> Value {
        let files: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        let mut fields = self.losses.fields();
        crate::json::extend(
            &mut fields,
            json!({ "files": files, "messages": self.messages, "bytes": self.bytes }),
        );
        fields
    }
}

/// What is put into the queue.
enum Put {
    Item(Box<Item>),
    End,
}

/// The way into a recording. It never waits: what finds the queue full is lost, and counted.
#[derive(Clone)]
pub struct Tap {
    queue: SyncSender<Put>,
    unwritten: Arc<Unwritten>,
    start: Instant,
}

/// What has found the queue full.
#[derive(Debug, Default)]
struct Unwritten {
    all: AtomicU64,
    /// Events of a cable that the encoder has not been told of: their numbers will be missing.
    events: AtomicU64,
}

impl Tap {
    /// Records this, now.
    pub fn put(&self, what: What) {
        let is_event = matches!(&what, What::Seen(seen) if seen.kind == Kind::Event);
        let item = Item { at: self.start.elapsed(), what };
        // A recording that has failed has told so itself.
        if let Err(TrySendError::Full(_)) = self.queue.try_send(Put::Item(Box::new(item))) {
            self.unwritten.all.fetch_add(1, Ordering::Relaxed);
            self.unwritten.events.fetch_add(is_event.into(), Ordering::Relaxed);
        }
    }
}

/// A recording under way.
pub struct Recording {
    tap: Tap,
    writer: JoinHandle<Result<Summary, Failure>>,
}

impl Recording {
    /// Creates the first file and the thread that writes. `motors`: what they speak, as far as that
    /// is known.
    ///
    /// # Errors
    /// The file cannot be written, or is there already.
    pub fn start(place: Place, motors: Protocols) -> Result<Self, Failure> {
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let limits = Limits { longest: place.longest, since_epoch };
        let files = Files::create(place.path.clone(), limits, file::opener(place))?;
        let (queue, items) = sync_channel(WAITING);
        let unwritten = Arc::new(Unwritten::default());
        let tap = Tap { queue, unwritten: unwritten.clone(), start: Instant::now() };
        let encoder = Encoder::new(motors);
        let writer = thread::spawn(move || write_down(&items, &unwritten, encoder, files));
        Ok(Self { tap, writer })
    }

    /// Refuses a place whose file is there already, or one of those behind it: hours later that
    /// would be the end of the recording.
    ///
    /// # Errors
    /// Which is.
    pub fn refuse_existing(place: &Place) -> Result<(), Failure> {
        if place.force {
            return Ok(());
        }
        let behind = (2..=LOOKED_AT).map(|number| file::numbered(&place.path, number));
        let mut files = [place.path.clone()].into_iter().chain(behind);
        let taken = files.find(|file| file.is_file());
        taken.map_or(Ok(()), |file| Err(unwritten(&file, io::ErrorKind::AlreadyExists.into())))
    }

    /// The way into it.
    pub fn tap(&self) -> Tap {
        self.tap.clone()
    }

    /// Whether it has ended by itself, which it does by failing.
    pub fn has_failed(&self) -> bool {
        self.writer.is_finished()
    }

    /// Ends it: everything that was put in is in the file.
    ///
    /// # Errors
    /// It could not be written.
    pub fn finish(self) -> Result<Summary, Failure> {
        // One that has failed takes nothing more.
        let _ = self.tap.queue.send(Put::End);
        self.writer
            .join()
            .unwrap_or_else(|_| Err(Failure::not_measured("the thread that records has panicked")))
    }
}

/// Takes what is put in and writes it, until the end or a failure.
fn write_down(
    items: &Receiver<Put>,
    unwritten: &Unwritten,
    mut encoder: Encoder,
    mut files: Files,
) -> Result<Summary, Failure> {
    let mut flushed = Instant::now();
    // Of what was written last: what others put in at once is not in the order of its times.
    let mut latest = Duration::ZERO;
    loop {
        match items.recv_timeout(FLUSH_EVERY.saturating_sub(flushed.elapsed())) {
            Ok(Put::Item(mut item)) => {
                latest = latest.max(item.at);
                item.at = latest;
                encoder.not_queued(unwritten.events.swap(0, Ordering::Relaxed));
                encoder.take(*item).iter().try_for_each(|message| files.write(message))?;
            }
            Ok(Put::End) | Err(RecvTimeoutError::Disconnected) => break,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            let told = encoder.losses(latest, unwritten.all.load(Ordering::Relaxed));
            told.iter().try_for_each(|message| files.write(message))?;
            files.flush()?;
            flushed = Instant::now();
        }
    }
    let told = encoder.losses(latest, unwritten.all.load(Ordering::Relaxed));
    told.iter().try_for_each(|message| files.write(message))?;
    files.finish(encoder.lost())
}

#[cfg(test)]
mod tests;
