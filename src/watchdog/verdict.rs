//! What retained RAM knows of the tasks, for the run after one that the watchdog ended.
//!
//! The executor says which task it polls. A task whose poll never returns is the last one that it
//! named; where a task only waits for ever, the supervisor still runs and notes which is missing.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use super::TaskId;
use super::check_in::TASKS;
use crate::retained::{self, CHECK_INS};

/// The task that has the processor, by the address that the executor knows it by; 0: none has.
const RUNNING: usize = 0;
/// The loops that were missing when the watchdog was no longer fed, as a mask; 0: none.
const MISSING: usize = 1;
/// The task of each loop.
const FIRST_TASK: usize = 2;
/// Words in all.
pub const CHECK_IN_WORDS: usize = FIRST_TASK + TASKS;

/// A watched loop belongs to the task that has the processor.
pub fn note_task(task: TaskId) {
    retained::write(CHECK_INS, FIRST_TASK + task.index(), retained::read(CHECK_INS, RUNNING));
    retained::push();
}

/// The watchdog is not fed, as these are missing; 0 when all are back.
pub fn note_missing(missing: u32) {
    retained::write(CHECK_INS, MISSING, missing);
    retained::push();
}

/// What the run before has left has been read: from now on this run is noted.
static READ: AtomicBool = AtomicBool::new(false);

/// Forgets the run before. To be closed.
pub fn forget() {
    (0..CHECK_IN_WORDS).for_each(|index| retained::write(CHECK_INS, index, 0));
    READ.store(true, Ordering::Relaxed);
}

/// Says which loop failed to check in in the run before.
pub fn write_verdict(text: &mut impl Write) -> fmt::Result {
    let (missing, running) =
        (retained::read(CHECK_INS, MISSING), retained::read(CHECK_INS, RUNNING));
    text.write_str("watchdog: ")?;
    if missing != 0 {
        text.write_str("no check-in from ")?;
        let mut between = "";
        for task in TaskId::all().filter(|task| missing & task.bit() != 0) {
            write!(text, "{between}{task}")?;
            between = ", ";
        }
        return Ok(());
    }
    let name = |task: &TaskId| retained::read(CHECK_INS, FIRST_TASK + task.index()) == running;
    match (running, TaskId::all().find(name)) {
        (0, _) => text.write_str("the processor was lost at the start or in an interrupt"),
        (_, Some(task)) => write!(text, "no check-in from {task}, which kept the processor"),
        (address, None) => {
            write!(text, "no check-in from the task at {address:#010x}, which kept the processor")
        }
    }
}

fn set_running(task: u32) {
    if READ.load(Ordering::Relaxed) {
        retained::write(CHECK_INS, RUNNING, task);
        retained::push();
    }
}

/// The executor's hooks (embassy-executor, feature `trace`).
mod hooks {
    use super::set_running;

    #[unsafe(no_mangle)]
    fn _embassy_trace_task_exec_begin(_executor: u32, task: u32) {
        set_running(task);
    }

    #[unsafe(no_mangle)]
    fn _embassy_trace_executor_idle(_executor: u32) {
        set_running(0);
    }

    #[unsafe(no_mangle)]
    fn _embassy_trace_task_exec_end(_executor: u32, _task: u32) {}

    #[unsafe(no_mangle)]
    fn _embassy_trace_poll_start(_executor: u32) {}

    #[unsafe(no_mangle)]
    fn _embassy_trace_task_new(_executor: u32, _task: u32) {}

    #[unsafe(no_mangle)]
    fn _embassy_trace_task_end(_executor: u32, _task: u32) {}

    #[unsafe(no_mangle)]
    fn _embassy_trace_task_ready_begin(_executor: u32, _task: u32) {}
}
