//! A file that has what a flight recorder has kept.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use flight_recorder::{Recording, Unreadable};

/// A file for what a flight recorder has kept. It is replaced as a whole: whatever happens
/// meanwhile, the recording before or the new one is there.
pub struct RecordingFile {
    path: PathBuf,
}

impl RecordingFile {
    /// A file with this path: none yet, or a recording, which stays until it is replaced.
    ///
    /// # Errors
    /// Where it is another file, or none can be written there.
    pub fn new(path: &Path) -> io::Result<Self> {
        match std::fs::metadata(path) {
            Ok(found) if !found.is_file() => return Err(io::Error::other("no regular file")),
            Ok(_) => {
                let before = std::fs::read(path)?;
                if !before.is_empty() && Recording::read_file(&before) == Err(Unreadable::Nothing) {
                    let why = "it is there and no recording; choose another name";
                    return Err(io::Error::other(why));
                }
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        // A link is kept, and what it leads to is replaced.
        let path = path.canonicalize().unwrap_or(path.to_owned());
        let file = Self { path };
        std::fs::write(file.beside(), [])?;
        std::fs::remove_file(file.beside())?;
        Ok(file)
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where a new one is written, before it takes the place of the old one.
    fn beside(&self) -> PathBuf {
        let mut name = OsString::from(&self.path);
        name.push(".new");
        PathBuf::from(name)
    }

    /// Puts a whole recording in the place of the one before.
    ///
    /// # Errors
    /// Where it cannot be written; the one before stays.
    pub fn replace(&self, recording: &[u8]) -> io::Result<()> {
        let beside = self.beside();
        let replaced =
            std::fs::write(&beside, recording).and_then(|()| std::fs::rename(&beside, &self.path));
        if replaced.is_err() {
            let _ = std::fs::remove_file(&beside);
        }
        replaced
    }
}
