//! Files that commands write.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::ErrorKind::{IsADirectory, ResourceBusy};
use std::io::{self, Write};
use std::path::Path;

use crate::failure::Failure;

/// Opens a file to write it; one that is there already only with `force`, and no file that another
/// `mgw` is writing.
pub fn open(path: &Path, force: bool) -> io::Result<File> {
    if path.is_dir() {
        return Err(IsADirectory.into());
    }
    let mut options = OpenOptions::new();
    options.write(true).create(force).truncate(false).create_new(!force);
    let file = options.open(path)?;
    // A device, such as /dev/null, is for all.
    if file.metadata()?.is_file() {
        // On Windows a lock would keep others from reading it, too.
        if cfg!(unix) && matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(io::Error::new(ResourceBusy, "another program is writing it"));
        }
        file.set_len(0)?;
    }
    Ok(file)
}

/// Writes a whole file; over one that is there already only with `force`.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>, force: bool) -> Result<(), Failure> {
    let written = open(path, force).and_then(|mut file| file.write_all(bytes.as_ref()));
    written.map_err(|source| unwritten(path, source))
}

/// Why a file could not be written.
pub fn unwritten(path: &Path, source: io::Error) -> Failure {
    Failure::Unwritten { path: path.display().to_string(), source }
}
