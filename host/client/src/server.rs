//! Where a running `mgw serve` of this user is found, the Unix socket of a well-known name; and what
//! a server tells that a gateway does not know.

use std::path::PathBuf;

use host_protocol::{Call, Error};
use serde::Serialize;

use crate::client::Client;
use crate::error::ClientError;
use crate::transport::Transport;

/// Asks a server which of its programs is in command. To a gateway, and to a server that is older,
/// it is an unknown request.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ReadCommander {}

impl Call for ReadCommander {
    const NUMBER: u16 = 0x7F00;
    /// The program as the server knows it; nothing where none of its own is in command.
    type Reply = Option<String>;
}

impl<T: Transport> Client<T> {
    /// The program of the server behind this connection that is in command. `None` where none of
    /// its programs is, or there is no server.
    ///
    /// # Errors
    /// As [`request`](Self::request).
    pub fn commander(&mut self) -> Result<Option<String>, ClientError> {
        if self.has_no_server {
            return Ok(None);
        }
        match self.request(&ReadCommander {}) {
            Err(ClientError::Gateway(Error::UnknownRequest { .. })) => {
                self.has_no_server = true;
                Ok(None)
            }
            answer => answer,
        }
    }
}

/// Names another socket; empty: none is looked for.
const SOCKET_VARIABLE: &str = "MGW_SOCKET";
/// The directory of a user's sockets, where the system has one.
const DIRECTORY_VARIABLE: &str = "XDG_RUNTIME_DIR";

/// The socket of this user's server, whether one runs or not: `MGW_SOCKET`, `mgw.sock` in
/// `XDG_RUNTIME_DIR`, or in a directory of the user's own among the temporary files. `None` where
/// the system has no such sockets, or `MGW_SOCKET` is empty.
pub fn server_socket() -> Option<PathBuf> {
    if !cfg!(unix) {
        return None;
    }
    if let Some(named) = std::env::var_os(SOCKET_VARIABLE) {
        return Some(PathBuf::from(named)).filter(|path| !path.as_os_str().is_empty());
    }
    match std::env::var_os(DIRECTORY_VARIABLE).filter(|directory| !directory.is_empty()) {
        Some(directory) => Some(PathBuf::from(directory).join("mgw.sock")),
        None => own_directory().map(|directory| directory.join("mgw.sock")),
    }
}

#[cfg(unix)]
fn own_directory() -> Option<PathBuf> {
    Some(std::env::temp_dir().join(format!("mgw-{}", nix::unistd::getuid())))
}

#[cfg(not(unix))]
fn own_directory() -> Option<PathBuf> {
    None
}

/// The name of the port of this user's server, if its socket is there and belongs to this user.
pub fn server_port() -> Option<String> {
    let path = server_socket()?;
    is_own(&path).then(|| format!("{}{}", crate::port::UNIX_PREFIX, path.display()))
}

/// In a directory that everybody may write somebody else could have made it.
#[cfg(unix)]
fn is_own(path: &std::path::Path) -> bool {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};
    std::fs::symlink_metadata(path).is_ok_and(|socket| {
        socket.file_type().is_socket() && socket.uid() == nix::unistd::getuid().as_raw()
    })
}

#[cfg(not(unix))]
fn is_own(_path: &std::path::Path) -> bool {
    false
}
