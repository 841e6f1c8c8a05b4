//! A branch of a run: the process is forked where the board stands, and the child runs on from
//! there and says what came of it.
//!
//! It is as good as a run from a snapshot, and takes a twentieth of its time: the child has the
//! code that the emulator has translated so far.

use std::io::{PipeWriter, Read as _, Write as _};
use std::time::Duration;

use rigless::emulator::Host;
use rigless::session::Session;
use rigless::time::VirtualNanos;

use super::recorder::Recorder;
use super::{Machine, nanos};
use virtual_stm32::Chip;
use virtual_stm32::socket::Socket;

/// What a child does with its board.
pub(super) trait Play: Send {
    /// Where to stand still next.
    fn next_stop(&self) -> VirtualNanos;

    /// The board stands at that instant. What is known of it then ends the child.
    fn stands(
        &mut self,
        session: &mut Session<Socket>,
        host: &mut dyn Host,
        recorder: &mut Recorder,
        now: VirtualNanos,
    ) -> Option<Vec<u8>>;

    /// The core has done something that the recorder keeps.
    fn noted(&mut self, _: &mut dyn Host, _: &Recorder) -> Option<Vec<u8>> {
        None
    }
}

/// A play, and where its report goes.
pub(super) struct Script {
    pub(super) play: Box<dyn Play>,
    pub(super) to: PipeWriter,
}

impl Script {
    /// Hands the report over, which is the end of the process.
    pub(super) fn end(mut self, report: &[u8]) -> ! {
        let length = u64::try_from(report.len()).unwrap_or_default().to_le_bytes();
        // The parent complains if it misses something.
        let _ = self.to.write_all(&length).and_then(|()| self.to.write_all(report));
        // Safety: ends the process at once; nobody else lives in it whose destructors would have to
        // run.
        unsafe { libc::_exit(0) }
    }
}

/// Something done to the part at an instant.
type Act = Box<dyn FnOnce(&mut Chip, VirtualNanos) + Send>;
/// What is to be known of it at the end.
type Report = Box<dyn FnOnce(&mut Chip) -> Vec<u8> + Send>;

/// One act and a report.
struct ActAndReport {
    act: Option<(VirtualNanos, Act)>,
    end: VirtualNanos,
    report: Option<Report>,
}

impl Play for ActAndReport {
    fn next_stop(&self) -> VirtualNanos {
        self.act.as_ref().map_or(self.end, |(at, _)| *at)
    }

    fn stands(
        &mut self,
        session: &mut Session<Socket>,
        _: &mut dyn Host,
        _: &mut Recorder,
        now: VirtualNanos,
    ) -> Option<Vec<u8>> {
        let mut part = session.board_mut().lend();
        if let Some((_, act)) = self.act.take_if(|(at, _)| *at <= now) {
            act(&mut part, now);
        }
        let report = if now < self.end { None } else { self.report.take() };
        let report = report.map(|report| report(&mut part));
        session.board_mut().take_back(part);
        report
    }
}

/// Forks the process: true in the child, of which only the calling thread lives on.
pub(super) fn fork() -> Fork {
    // Safety: the child goes on in this thread alone. It takes no lock that another thread may have
    // held, but for the allocator's, which the C library frees for it; and it ends with
    // `_exit`.
    match unsafe { libc::fork() } {
        0 => Fork::Child,
        -1 => panic!("no process for a branch: {}", std::io::Error::last_os_error()),
        child => Fork::Parent(child),
    }
}

/// Which of the two processes this is.
pub(super) enum Fork {
    /// The parent, with the child's number.
    Parent(libc::pid_t),
    /// The child.
    Child,
}

impl Machine {
    /// Runs a branch of this run: `act` is done `after` a while, and `report` is made `span` after
    /// that. The board itself stays where it stands, and never knows. One thread of a process
    /// is to do so at a time with one board.
    /// Panics if the branch panics.
    pub fn branch(
        &mut self,
        after: Duration,
        act: impl FnOnce(&mut Chip, VirtualNanos) + Send + 'static,
        span: Duration,
        report: impl FnOnce(&mut Chip) -> Vec<u8> + Send + 'static,
    ) -> Vec<u8> {
        let at = VirtualNanos(self.reached.0 + nanos(after));
        let end = VirtualNanos(at.0 + nanos(span));
        let (act, report) = (Some((at, Box::new(act) as Act)), Some(Box::new(report) as Report));
        self.play(Box::new(ActAndReport { act, end, report }))
    }

    /// Has a child play, and waits for its report.
    pub(super) fn play(&mut self, play: Box<dyn Play>) -> Vec<u8> {
        let (mut from, to) = std::io::pipe().unwrap_or_else(|error| panic!("no pipe: {error}"));
        let child = self.core.branch(Script { play, to });
        let mut length = [0; 8];
        let mut bytes = Vec::new();
        let read = from.read_exact(&mut length).and_then(|()| {
            bytes.resize(usize::try_from(u64::from_le_bytes(length)).expect("it fits"), 0);
            from.read_exact(&mut bytes)
        });
        // Safety: a child of ours that nobody else waits for.
        unsafe { libc::waitpid(child, std::ptr::null_mut(), 0) };
        read.unwrap_or_else(|error| panic!("the branch failed: {error}"));
        bytes
    }
}
