//! Where programs come in: their connections are accepted, show their token, and are read.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::net::{Shutdown, TcpStream};
#[cfg(unix)]
use std::os::fd::OwnedFd;
use std::sync::mpsc::{Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use socket2::Socket;
use subtle::ConstantTimeEq;

use crate::shell::{Event, Listener, Newcomer, PROGRAMS, TICK, UNPROVED, WAITING, nothing_came};

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

/// The connections that are to show their token, the oldest first.
#[derive(Clone, Default)]
struct Showing(Arc<Mutex<Places>>);

#[derive(Default)]
struct Places {
    given: u64,
    taken: VecDeque<(u64, Socket)>,
}

impl Showing {
    fn places(&self) -> MutexGuard<'_, Places> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives a connection a place, if need be that of the oldest one, which ends.
    fn enter(&self, stream: &Socket) -> io::Result<u64> {
        let mut places = self.places();
        places.given += 1;
        let place = places.given;
        places.taken.push_back((place, stream.try_clone()?));
        if places.taken.len() > UNPROVED
            && let Some((_, oldest)) = places.taken.pop_front()
        {
            let _ = oldest.shutdown(Shutdown::Both);
        }
        Ok(place)
    }

    /// Takes a place back; whether it was still there.
    fn leave(&self, place: u64) -> bool {
        let taken = &mut self.places().taken;
        let at = taken.iter().position(|(of, _)| *of == place);
        at.and_then(|at| taken.remove(at)).is_some()
    }
}

/// Accepts programs for ever.
pub(crate) fn accept(listener: &Listener, sender: &Sender<Event>) {
    let showing = Showing::default();
    let (given_back, leaves) = channel();
    (0..CONNECTIONS).for_each(|_| drop(Leave(given_back.clone())));
    while leaves.recv().is_ok() {
        let leave = Leave(given_back.clone());
        let Ok((mut stream, name, token)) = next(listener) else {
            // The program has gone again, or there are no descriptors left for now.
            thread::sleep(TICK);
            continue;
        };
        let sender = sender.clone();
        let read: Box<dyn FnOnce() + Send> = if let Some(token) = token {
            // It is read by its own thread alone.
            let place = if has_come(&stream) { None } else { Some(showing.enter(&stream)) };
            let Ok(place) = place.transpose() else { continue };
            let showing = showing.clone();
            Box::new(move || {
                let proved = shows(&mut stream, &token);
                if place.is_none_or(|place| showing.leave(place)) {
                    read_program(stream, name, Vec::new(), proved, &sender);
                }
                drop(leave);
            })
        } else {
            let Some(said) = said_by_now(&mut stream) else { continue };
            Box::new(move || {
                read_program(stream, name, said, true, &sender);
                drop(leave);
            })
        };
        // Where the system has no thread left the connection ends.
        drop(thread::Builder::new().spawn(read));
    }
}

/// The next connection, what is called so, and the token that it has to show.
fn next(listener: &Listener) -> io::Result<(Socket, String, Option<String>)> {
    match listener {
        Listener::Tcp(listener, token) => {
            let (stream, peer) = listener.accept()?;
            stream.set_nodelay(true)?;
            Ok((stream.into(), format!("the program at {peer}"), token.clone()))
        }
        #[cfg(unix)]
        Listener::Unix(listener) => {
            let stream = OwnedFd::from(listener.accept()?.0);
            let name = name_of_process(&stream);
            Ok((stream.into(), name, None))
        }
    }
}

/// What the process behind a Unix socket is called.
#[cfg(target_os = "linux")]
fn name_of_process(stream: &OwnedFd) -> String {
    let Ok(process) = rustix::net::sockopt::socket_peercred(stream) else { return unknown() };
    let process = process.pid.as_raw_nonzero();
    // A process gives itself this name of 15 bytes, and may have gone.
    let name = std::fs::read_to_string(format!("/proc/{process}/comm")).unwrap_or_default();
    match name.trim() {
        "" => format!("process {process}"),
        name => format!("{name} (process {process})"),
    }
}

#[cfg(all(unix, not(target_os = "linux")))]
fn name_of_process(_stream: &OwnedFd) -> String {
    unknown()
}

#[cfg(unix)]
fn unknown() -> String {
    "a program on this computer".to_owned()
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
fn read_program(
    mut stream: Socket,
    name: String,
    said: Vec<u8>,
    proved: bool,
    sender: &Sender<Event>,
) {
    let (go, may_read) = sync_channel(1);
    let Ok(ours) = stream.try_clone() else { return };
    let mut is_first = said.is_empty();
    if sender.send(Event::Connected(Newcomer { stream: ours, name, proved, said, go })).is_err() {
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

/// Whether the whole of what may be the token is there already, so that nobody waits for it.
fn has_come(stream: &Socket) -> bool {
    let Ok(stream) = stream.try_clone().map(TcpStream::from) else { return false };
    let mut bytes = [0; LONGEST_TOKEN];
    let peeked = stream.set_nonblocking(true).and_then(|()| stream.peek(&mut bytes));
    let is_whole = |count| bytes.iter().take(count).any(|byte| *byte == 0);
    stream.set_nonblocking(false).is_ok() && peeked.is_ok_and(is_whole)
}

/// Whether a connection begins with the token.
fn shows(stream: &mut Socket, token: &str) -> bool {
    let mut shown = Vec::new();
    let mut byte = [0];
    let end = Instant::now() + TOKEN_WITHIN;
    while shown.len() < LONGEST_TOKEN
        && let Some(left) =
            end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
        && stream.set_read_timeout(Some(left)).is_ok()
        && matches!(stream.read(&mut byte), Ok(1))
        && byte != [0]
    {
        shown.extend(byte);
    }
    let _ = stream.set_read_timeout(None);
    let wanted = [TOKEN, token.as_bytes()].concat();
    bool::from(shown.as_slice().ct_eq(&wanted))
}
