//! What only a terminal gets: a colour, and a line that tells what is waited for.

use std::io::{self, IsTerminal};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::failure::Failure;
use crate::interrupt;
use crate::printable::printable;
use crate::session::Session;
use crate::stream;

/// What takes longer than this is told.
const PATIENCE: Duration = Duration::from_secs(1);
/// Between two looks at the time.
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// Between two looks at the link while an answer is waited for.
const LISTEN_EVERY: Duration = Duration::from_millis(50);
/// Back to the beginning of the line, and the rest of it empty.
const CLEAR: &str = "\r\u{1b}[K";

/// Standard error's last line, while somebody waits.
struct Line {
    quiet_since: Instant,
    is_shown: bool,
}

static LINE: Mutex<Option<Line>> = Mutex::new(None);

/// Tells on standard error, where that is a terminal, what the program waits for, while it lasts.
pub struct Progress {
    ends: Option<Sender<()>>,
    teller: Option<JoinHandle<()>>,
}

impl Progress {
    /// Tells nothing.
    pub fn none() -> Self {
        Self { ends: None, teller: None }
    }

    /// Begins to wait for something.
    pub fn of(what: &'static str) -> Self {
        if !io::stderr().is_terminal() {
            return Self::none();
        }
        set(Some(Line { quiet_since: Instant::now(), is_shown: false }));
        let (ends, end) = channel::<()>();
        let teller = thread::spawn(move || {
            while end.recv_timeout(LOOK_EVERY) == Err(RecvTimeoutError::Timeout) {
                tell(what);
            }
        });
        Self { ends: Some(ends), teller: Some(teller) }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        drop(self.ends.take());
        if let Some(teller) = self.teller.take() {
            let _ = teller.join();
            something_is_printed();
            set(None);
        }
    }
}

fn set(line: Option<Line>) {
    *LINE.lock().unwrap_or_else(PoisonError::into_inner) = line;
}

fn tell(what: &str) {
    let mut line = LINE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(line) = line.as_mut()
        && line.quiet_since.elapsed() >= PATIENCE
    {
        line.is_shown = true;
        let seconds = line.quiet_since.elapsed().as_secs();
        // With nobody to hear it there is nothing more to do.
        drop(stream::ERR.send(format!("{CLEAR}{what}: {seconds} s")));
    }
}

/// Takes the line away before something else is printed.
pub fn something_is_printed() {
    let mut line = LINE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(line) = line.as_mut() {
        line.quiet_since = Instant::now();
        if std::mem::take(&mut line.is_shown) {
            let _ = stream::ERR.print(CLEAR.to_owned());
        }
    }
}

/// Asks on a terminal whether to do something, unless that is said already; without a terminal it
/// is refused. The link stays alive meanwhile, and an interrupt ends it.
pub fn agree(session: &mut Session, yes: bool, what: &str) -> Result<(), Failure> {
    if yes {
        return Ok(());
    }
    let out = session.out;
    let no = || Failure::Usage(format!("{what}. Add --yes"));
    if out.is_json() || !io::stdin().is_terminal() {
        return Err(no());
    }
    something_is_printed();
    let _ = stream::ERR.print(format!("{}. Go on? [y/N] ", printable(what)));
    let heard = typed_line();
    loop {
        match heard.recv_timeout(LISTEN_EVERY) {
            Ok(answer) if matches!(answer.trim(), "y" | "Y" | "yes") => return Ok(()),
            Ok(_) | Err(RecvTimeoutError::Disconnected) => return Err(no()),
            Err(RecvTimeoutError::Timeout) => session.client.pause(Duration::ZERO)?,
        }
    }
}

/// The next line that is typed. Nobody else reads there until it has come: a thread waits for it,
/// as a signal does not end that.
fn typed_line() -> Receiver<String> {
    let (told, heard) = channel();
    thread::spawn(move || {
        let mut answer = String::new();
        let _ = io::stdin().read_line(&mut answer);
        let _ = told.send(answer);
    });
    heard
}

/// The line that is typed, before there is a session; nothing where Ctrl-C comes first.
pub fn answer() -> Option<String> {
    let heard = typed_line();
    while !interrupt::is_raised() {
        match heard.recv_timeout(LISTEN_EVERY) {
            Err(RecvTimeoutError::Timeout) => {}
            answered => return answered.ok(),
        }
    }
    None
}

/// Whether colours are wanted.
pub fn has_colour() -> bool {
    std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Whether the terminal does nothing but print.
pub fn is_dumb() -> bool {
    std::env::var_os("TERM").is_some_and(|terminal| terminal == "dumb")
}

/// The name of the program before a failure: red on a terminal, unless NO_COLOR says otherwise.
pub fn failed() -> &'static str {
    let is_red = io::stderr().is_terminal() && has_colour() && !is_dumb();
    if is_red { "\u{1b}[1;31mmgw:\u{1b}[0m" } else { "mgw:" }
}
