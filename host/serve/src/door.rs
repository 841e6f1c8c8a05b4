//! Where programs come in: their connections are accepted, show their token, and are read.

use std::io::{self, Read};
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::sync::mpsc::{Sender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use socket2::Socket;
use subtle::ConstantTimeEq;

use crate::shell::{Event, Listener, Newcomer, PROGRAMS, TICK, WAITING, nothing_came};

/// Connections of one listener at a time: those that have a place, and some that come and go. More
/// of them wait in the system, so that no crowd of them stands in front of what programs send.
const CONNECTIONS: usize = PROGRAMS + WAITING + 64;
/// Bytes of a program taken at once: the others have their turn behind them.
const READ: usize = 512;
/// How long a connection may take to show its token.
const TOKEN_WITHIN: Duration = Duration::from_secs(2);
/// What the token stands behind.
const TOKEN: &[u8] = b"token=";
/// Longest token with what it stands behind.
const LONGEST_TOKEN: usize = 256;

/// Leave for one connection, which is given back when that has ended.
struct Leave(Sender<()>);

impl Drop for Leave {
    fn drop(&mut self) {
        let _ = self.0.send(());
    }
}

/// Accepts programs for ever.
pub(crate) fn accept(listener: &Listener, sender: &Sender<Event>) {
    let (given_back, leaves) = channel();
    (0..CONNECTIONS).for_each(|_| drop(Leave(given_back.clone())));
    while leaves.recv().is_ok() {
        let leave = Leave(given_back.clone());
        let Ok((mut stream, token)) = next(listener) else {
            // The program has gone again, or there are no descriptors left for now.
            thread::sleep(TICK);
            continue;
        };
        // Whoever has a token to show is read by its own thread alone.
        let said = if token.is_some() { Some(Vec::new()) } else { said_by_now(&mut stream) };
        let Some(said) = said else { continue };
        let sender = sender.clone();
        let read = move || {
            read_program(stream, said, token.as_deref(), &sender);
            drop(leave);
        };
        // Where the system has no thread left the connection ends.
        drop(thread::Builder::new().spawn(read));
    }
}

/// The next connection, and the token that it has to show.
fn next(listener: &Listener) -> io::Result<(Socket, Option<String>)> {
    match listener {
        Listener::Tcp(listener, token) => {
            let (stream, _) = listener.accept()?;
            stream.set_nodelay(true)?;
            Ok((stream.into(), token.clone()))
        }
        #[cfg(unix)]
        Listener::Unix(listener) => Ok((OwnedFd::from(listener.accept()?.0).into(), None)),
    }
}

/// What a connection has said by now; `None` where it has ended: no thread is made for it.
fn said_by_now(stream: &mut Socket) -> Option<Vec<u8>> {
    let mut bytes = [0; READ];
    stream.set_nonblocking(true).ok()?;
    let said = match stream.read(&mut bytes) {
        Ok(count @ 1..) => bytes.get(..count)?.to_vec(),
        Err(error) if nothing_came(&error) => Vec::new(),
        Ok(0) | Err(_) => return None,
    };
    stream.set_nonblocking(false).ok()?;
    (!begins_as_http(&said)).then_some(said)
}

/// Passes a program's bytes on, one piece at a time: who floods waits for the others.
fn read_program(mut stream: Socket, said: Vec<u8>, token: Option<&str>, sender: &Sender<Event>) {
    let proved = token.is_none_or(|token| shows(&mut stream, token));
    let (go, may_read) = sync_channel(1);
    let Ok(ours) = stream.try_clone() else { return };
    let mut is_first = said.is_empty();
    if sender.send(Event::Connected(Newcomer { stream: ours, proved, said, go })).is_err() {
        return;
    }
    let Ok(id) = may_read.recv() else { return };
    loop {
        let mut bytes = [0; READ];
        let read = match stream.read(&mut bytes) {
            Ok(_) if is_first && begins_as_http(&bytes) => Vec::new(),
            Ok(count) => bytes.get(..count).unwrap_or_default().to_vec(),
            Err(error) if nothing_came(&error) => continue,
            Err(_) => Vec::new(),
        };
        is_first = false;
        let has_gone = read.is_empty();
        if sender.send(Event::Program(id, read)).is_err() || has_gone || may_read.recv().is_err() {
            return;
        }
    }
}

/// Whether the first bytes of a connection are a browser's: any page can have it post bytes to this
/// computer. A frame begins with 0x00, and the token with a small letter.
fn begins_as_http(bytes: &[u8]) -> bool {
    bytes.first().is_some_and(u8::is_ascii_uppercase)
}

/// Whether a connection begins with the token.
fn shows(stream: &mut Socket, token: &str) -> bool {
    let _ = stream.set_read_timeout(Some(TOKEN_WITHIN));
    let mut shown = Vec::new();
    let mut byte = [0];
    let end = Instant::now() + TOKEN_WITHIN;
    while shown.len() < LONGEST_TOKEN
        && Instant::now() < end
        && matches!(stream.read(&mut byte), Ok(1))
        && byte != [0]
    {
        shown.extend(byte);
    }
    let _ = stream.set_read_timeout(None);
    let wanted = [TOKEN, token.as_bytes()].concat();
    bool::from(shown.as_slice().ct_eq(&wanted))
}
