//! A board as it stood, to start others from.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rigless::emulator::Resume;
use rigless::session::Session;
use rigless::snapshot::{self, Error};
use rigless::time::VirtualNanos;

use super::recorder::Recorder;
use virtual_stm32::socket::Socket;

/// Everything as it stood. Copies share it.
#[derive(Debug, Clone)]
pub struct Snapshot {
    kept: Arc<snapshot::Snapshot>,
    /// The instant to which the machine had been ordered to run.
    reached: VirtualNanos,
}

impl Snapshot {
    /// Of the bytes that the emulator has made. It reads them back from a file only, so they take
    /// that way once; and it keeps them for the rest of the process.
    pub(super) fn keep(file: &[u8], reached: VirtualNanos) -> Self {
        let path = temporary_path();
        std::fs::write(&path, file).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let read = snapshot::Snapshot::read(&path);
        // Left behind it would only take room.
        let _ = std::fs::remove_file(&path);
        Self { kept: Arc::new(read.unwrap_or_else(|error| panic!("{error}"))), reached }
    }

    /// Where the machine stood.
    pub(super) fn at(&self) -> VirtualNanos {
        self.kept.stop().at
    }

    /// Where the machine had been ordered to.
    pub(super) fn reached(&self) -> VirtualNanos {
        self.reached
    }

    /// Puts a session that was built alike where it stood.
    pub(super) fn load(
        &self,
        session: &mut Session<Socket>,
        firmware: &[u8; 32],
        recorder: &mut Recorder,
    ) -> Result<Resume<'static>, Error> {
        self.kept.restore(session, firmware, recorder)
    }
}

fn temporary_path() -> PathBuf {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let name = format!("virtual-board-{}-{number}.snapshot", std::process::id());
    Path::join(&std::env::temp_dir(), name)
}
