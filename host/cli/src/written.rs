//! Files that commands write.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

use crate::failure::Failure;

/// Opens a file to write it; one that is there already only with `force`.
pub fn open(path: &Path, force: bool) -> io::Result<File> {
    if path.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    OpenOptions::new().write(true).create(force).truncate(force).create_new(!force).open(path)
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
