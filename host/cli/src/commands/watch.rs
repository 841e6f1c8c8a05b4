//! `mgw watch`

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use host_protocol::{Error, Event, EventMessage, StateField, StateFields};
use mgw_client::ClientError;
use serde_json::json as object;

use crate::args::WatchArgs;
use crate::failure::Failure;
use crate::json;
use crate::names::Names;
use crate::session::{Session, print_event};
use crate::states;

/// A motor's silence is looked for this often.
const LONGEST_WAIT: Duration = Duration::from_millis(100);
/// A motor that has told nothing for so long is asked whether it answers.
const SILENT_AFTER: Duration = Duration::from_secs(2);
/// What was lost is told this often.
const TELL_LOST_EVERY: Duration = Duration::from_secs(1);

/// Prints samples at the rhythm of the subscription and events as they come.
pub fn run(session: &mut Session, arguments: &WatchArgs) -> Result<(), Failure> {
    let mut axes = session.axes_or_all(&arguments.axes)?;
    let names = session.known_names();
    let mut seen = BTreeSet::new();
    axes.retain(|axis| seen.insert(*axis));
    session.refuse_unconfigured(&axes, "there is nothing to watch")?;
    if axes.is_empty() {
        session.out.text("no axis is configured: there are only events to follow")?;
    }
    let fields = states::or_all(&arguments.fields);
    let left = arguments.count.map(|count| axes.iter().map(|axis| (*axis, count)).collect());
    let period = Duration::from_millis(arguments.period);
    session.client.subscribe(&axes, fields, period)?;
    let now = session.client.now();
    let unheard = axes
        .iter()
        .map(|axis| (*axis, Unheard { look_at: now + SILENT_AFTER, told: false }))
        .collect();
    let watched =
        Watch { names, fields, left, unheard, lost: 0, lost_on_the_way: 0, widths: Vec::new() }
            .follow(session);
    let watched = match watched {
        // Ctrl-C is how it ends.
        Err(Failure::Client(ClientError::Interrupted { .. })) => Ok(()),
        watched => watched,
    };
    if watched.as_ref().map_or_else(Failure::is_from_gateway, |()| true) {
        watched.and(session.client.unsubscribe().map_err(Failure::from))
    } else {
        watched
    }
}

/// Whether a motor answers.
struct Unheard {
    /// When it is asked.
    look_at: Duration,
    /// Once is enough.
    told: bool,
}

struct Watch {
    names: Names,
    fields: StateFields,
    /// How many samples of each axis are still to come; `None` for no end.
    left: Option<Vec<(u8, u64)>>,
    unheard: BTreeMap<u8, Unheard>,
    /// What was lost since that was said last.
    lost: u64,
    /// What was lost so far between the gateway and here.
    lost_on_the_way: u64,
    /// Of the columns so far; none before the headings.
    widths: Vec<usize>,
}

impl Watch {
    fn follow(&mut self, session: &mut Session) -> Result<(), Failure> {
        let mut tell_lost_at = session.client.now() + TELL_LOST_EVERY;
        while !self.is_complete() {
            session.client.keep_subscription()?;
            if let Some(message) = session.client.poll_event(LONGEST_WAIT)? {
                self.count_lost(session, message.dropped);
                self.note_readings(session, &message.event);
                match &message.event {
                    Event::Sample { axis, .. } if self.is_wanted(*axis) => {
                        self.print(session, &message)?
                    }
                    Event::Sample { .. } => {}
                    _ => print_event(&EventMessage { dropped: 0, ..message }, session.out)?,
                }
            }
            self.tell_silent(session)?;
            if session.client.now() >= tell_lost_at {
                tell_lost_at = session.client.now() + TELL_LOST_EVERY;
                self.tell_lost(session)?;
            }
        }
        self.tell_lost(session)
    }

    /// A motor that has just told something need not be asked whether it answers.
    fn note_readings(&mut self, session: &Session, event: &Event) {
        let Event::Sample { axis, .. } = event else { return };
        let heard = states::youngest_us(event)
            .is_some_and(|age_us| Duration::from_micros(u64::from(age_us)) < SILENT_AFTER);
        if heard && let Some(unheard) = self.unheard.get_mut(axis) {
            *unheard = Unheard { look_at: session.client.now() + SILENT_AFTER, told: false };
        }
    }

    /// Says once of each motor that has told nothing for a while that it does not answer, if it
    /// does not.
    fn tell_silent(&mut self, session: &mut Session) -> Result<(), Failure> {
        let now = session.client.now();
        for (axis, unheard) in &mut self.unheard {
            if unheard.told || now < unheard.look_at {
                continue;
            }
            unheard.look_at = now + SILENT_AFTER;
            // The fields asked for may be such as this motor has not, so silence alone does not
            // tell.
            match session.client.read_state(*axis) {
                Err(ClientError::Gateway(error @ Error::NoReply { .. })) => {
                    unheard.told = true;
                    session.out.event(
                        "motor_silent",
                        error.to_string(),
                        object!({ "axis": axis, "message": error.to_string() }),
                    )?;
                }
                Ok(_) | Err(ClientError::Gateway(_) | ClientError::NoAnswer { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn is_complete(&self) -> bool {
        self.left.as_ref().is_some_and(|left| left.iter().all(|(_, count)| *count == 0))
    }

    /// Counts a sample of an axis; whether it is to be printed.
    fn is_wanted(&mut self, axis: u8) -> bool {
        let Some(left) = &mut self.left else { return true };
        let count = left.iter_mut().find(|(of, count)| *of == axis && *count > 0);
        count.map(|(_, count)| *count -= 1).is_some()
    }

    /// Counts the samples and events that are missing before what comes next: those that the
    /// gateway had no room for, and those that got lost or were too many on the way.
    fn count_lost(&mut self, session: &Session, dropped: u32) {
        let on_the_way = session.client.losses().events();
        self.lost += u64::from(dropped) + (on_the_way - self.lost_on_the_way);
        self.lost_on_the_way = on_the_way;
    }

    /// Says how many were lost since it was said last.
    fn tell_lost(&mut self, session: &Session) -> Result<(), Failure> {
        match std::mem::take(&mut self.lost) {
            0 => Ok(()),
            lost => session.out.event(
                "lost",
                format!("{lost} samples or events were lost"),
                object!({ "count": lost }),
            ),
        }
    }

    fn print(&mut self, session: &Session, message: &EventMessage) -> Result<(), Failure> {
        if session.out.is_json() {
            let Event::Sample { axis, .. } = message.event else { return Ok(()) };
            let sample = json::event(message, &session.out.motors);
            let mut sample = json::with_name(sample, self.names.axis(axis));
            if let Some(sample) = sample.as_object_mut() {
                let left_out =
                    StateField::ALL.iter().filter(|field| !self.fields.contains(**field));
                left_out.flat_map(states::json_names).for_each(|name| drop(sample.remove(*name)));
            }
            return session.out.object(&sample);
        }
        let Some(table) = states::sample(&message.event, self.fields, &self.names) else {
            return Ok(());
        };
        let headings_printed = !self.widths.is_empty();
        let lines = table.lines_in(&mut self.widths);
        lines.iter().skip(usize::from(headings_printed)).try_for_each(|line| session.out.text(line))
    }
}
