//! Standard output that nobody reads, whose reader goes, or that takes nothing.

use std::io::{PipeReader, PipeWriter, Write, pipe};
use std::os::unix::process::ExitStatusExt;

use nix::fcntl::{FcntlArg, fcntl};
use nix::sys::signal::Signal;

use crate::support::{Process, Sim};

/// What a pipe holds at least.
const PIPE: i32 = 4_096;
/// Enough for the line of the arming, not for the table of states.
const ROOM: usize = 200;

/// A pipe that is nearly full.
fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = pipe().expect("a pipe");
    let size = fcntl(&writer, FcntlArg::F_SETPIPE_SZ(PIPE)).expect("a small pipe");
    let filler = vec![b'\n'; usize::try_from(size).unwrap() - ROOM];
    writer.write_all(&filler).expect("there is room");
    (reader, writer)
}

/// A command that turns an axis and whose output nobody reads.
fn turning(sim: &Sim, output: PipeWriter) -> Process {
    let arguments = ["--port", &sim.port, "set", "0", "velocity", "2"];
    let process = Process::printing_to(output, &arguments);
    sim.process.wait_for("motion", |line| line.contains("moving").then_some(()));
    process
}

#[test]
fn ctrl_c_stops_although_nobody_reads() {
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let sim = Sim::patient();
        let (_reader, writer) = full_pipe();
        let mut host = turning(&sim, writer);
        assert_eq!(host.signal(signal), Some(0), "{signal}");
        let state = sim.await_state("0", |_| true);
        assert_eq!(state["state"], "holding", "{signal}: {state}");
    }
}

#[test]
fn a_second_signal_ends_it_whatever_it_waits_for() {
    let mut sim = Sim::patient();
    let (_reader, writer) = full_pipe();
    let mut host = turning(&sim, writer);
    sim.typed("motor 0 mute");
    assert_eq!(host.insist(Signal::SIGINT).signal(), Some(Signal::SIGINT as i32));
}
