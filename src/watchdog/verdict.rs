//! What retained RAM knows of the tasks, for the run after one that the watchdog ended.
//!
//! The executor says which task it gives the processor to. A task that never gives it back is the
//! one it was given last; where a task only waits for ever, the supervisor still runs and notes who
//! is missing.

use core::fmt::{self, Write};
use core::sync::atomic::{AtomicBool, Ordering};

use super::Life;
use super::life::LIVES;
use crate::retained::{self, LIFE};

/// The task that has the processor, by the address that the executor knows it by; 0: none has.
const RUNNING: usize = 0;
/// Who was missing when the watchdog was no longer fed, as a mask; 0: nobody.
const MISSING: usize = 1;
/// The task of each loop.
const TASKS: usize = 2;
/// Words in all.
pub const LIFE_WORDS: usize = TASKS + LIVES;

/// A loop has shown life: it belongs to the task that has the processor.
pub fn note_task(life: Life) {
    retained::write(LIFE, TASKS + life.index(), retained::read(LIFE, RUNNING));
    retained::push();
}

/// The watchdog is not fed, as these are missing; 0 when all are back.
pub fn note_missing(missing: u32) {
    retained::write(LIFE, MISSING, missing);
    retained::push();
}

/// What the run before has left has been read: from now on this run is noted.
static READ: AtomicBool = AtomicBool::new(false);

/// Forgets the run before. To be closed.
pub fn forget() {
    (0..LIFE_WORDS).for_each(|index| retained::write(LIFE, index, 0));
    READ.store(true, Ordering::Relaxed);
}

/// Says who failed to show life in the run before.
pub fn write_verdict(text: &mut impl Write) -> fmt::Result {
    let (missing, running) = (retained::read(LIFE, MISSING), retained::read(LIFE, RUNNING));
    text.write_str("watchdog: ")?;
    if missing != 0 {
        text.write_str("no life from ")?;
        let mut between = "";
        for life in Life::all().filter(|life| missing & life.bit() != 0) {
            write!(text, "{between}{life}")?;
            between = ", ";
        }
        return Ok(());
    }
    let name = |life: &Life| retained::read(LIFE, TASKS + life.index()) == running;
    match (running, Life::all().find(name)) {
        (0, _) => text.write_str("the processor was lost at the start or in an interrupt"),
        (_, Some(life)) => write!(text, "no life from {life}, which kept the processor"),
        (task, None) => {
            write!(text, "no life from the task at {task:#010x}, which kept the processor")
        }
    }
}

fn set_running(task: u32) {
    if READ.load(Ordering::Relaxed) {
        retained::write(LIFE, RUNNING, task);
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
