//! Who goes first where several tasks are ready: those between an event and the frames that must
//! follow from it.
//!
//! One executor runs everything in turn, and a task that is polled is not interrupted by another.
//! Urgent tasks, which serve the buses and what can stop them, are taken before the others. So that
//! a flood on one of them takes the processor from nobody, one that never comes to wait goes behind
//! everybody else after a few turns.

use core::cell::Cell;
use core::pin::pin;

use embassy_executor::Metadata;
use embassy_futures::yield_now;

/// Who is taken first; the longer waiting one among equals. What is not said to be urgent comes
/// last.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Urgency {
    /// Hosts are told, lines are logged.
    None,
    /// Deadlines: when one falls due together with a demand, the frames that this demands go first.
    Deadline,
    /// Buses.
    Bus,
    /// What can demand a stop: hosts and the e-stop input.
    Demand,
}

/// Turns that an urgent task has in a row, without ever having to wait, before it goes behind
/// everybody.
const IN_A_ROW: u8 = 4;

/// The turns of a loop of an urgent task.
pub struct Turn {
    task: &'static Metadata,
    urgency: Urgency,
    in_a_row: Cell<u8>,
}

impl Turn {
    /// From now on the task that runs this is so urgent.
    pub async fn of(urgency: Urgency) -> Self {
        let task = Metadata::for_current_task().await;
        task.set_priority(urgency as u8);
        Self { task, urgency, in_a_row: Cell::new(0) }
    }

    /// Waits for the event of a turn.
    pub async fn wait<F: Future>(&self, event: F) -> F::Output {
        // A turn whose end was not waited for has left it otherwise.
        self.task.set_priority(self.urgency as u8);
        let mut event = pin!(event);
        core::future::poll_fn(|context| {
            let poll = event.as_mut().poll(context);
            if poll.is_pending() {
                self.in_a_row.set(0);
            }
            poll
        })
        .await
    }

    /// In the midst of a long turn: those as urgent that are ready go first.
    pub async fn pause(&self) {
        yield_now().await;
    }

    /// Ends a turn behind which the next stands ready: buses and deadlines go first too. A packet
    /// holds several requests, and each may have to wait for one of them only. After
    /// [`IN_A_ROW`] turns everybody goes first.
    pub async fn end_one_of_many(&self) {
        self.task.set_priority(Urgency::Deadline as u8);
        self.yield_once().await;
    }

    /// Ends a turn: those as urgent that are ready go first, and after [`IN_A_ROW`] turns
    /// everybody.
    pub async fn end(&self) {
        self.yield_once().await;
    }

    async fn yield_once(&self) {
        let in_a_row = self.in_a_row.get() + 1;
        let is_flooded = in_a_row >= IN_A_ROW;
        self.in_a_row.set(if is_flooded { 0 } else { in_a_row });
        if is_flooded {
            self.task.set_priority(Urgency::None as u8);
        }
        yield_now().await;
        self.task.set_priority(self.urgency as u8);
    }
}
