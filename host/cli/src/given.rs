//! Files that are given to commands.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use crate::failure::Failure;

/// Opens a file to read it.
pub fn open(path: &Path) -> Result<File, Failure> {
    File::open(path).map_err(|source| unread(path, source))
}

/// What a file begins with: so many bytes at most.
pub fn begin(path: &Path, most: u64) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let read = open(path)?.take(most).read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|source| unread(path, source))
}

/// Why a file could not be read.
pub fn unread(path: impl AsRef<Path>, source: io::Error) -> Failure {
    Failure::File { path: path.as_ref().display().to_string(), source }
}
