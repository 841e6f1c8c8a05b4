//! `mgw play`

use serde_json::json as object;

use super::export::{Columns, Lines, candump};
use super::read::{self, Recorded};
use super::show::Show;
use super::tell_cut_off;
use crate::args::{Part, PlayArgs};
use crate::failure::Failure;
use crate::output::Output;

/// Prints recordings, or exports them.
pub fn run(arguments: &PlayArgs, out: Output) -> Result<(), Failure> {
    let (part, topics) = (&arguments.part, &*arguments.topics);
    // Lines of an export have no JSON among them.
    let aside = if out.is_json() { Output::none() } else { out };
    if arguments.csv {
        // A line has a place for each field of any.
        let mut columns = Columns::default();
        each(part, topics, Output::none(), |message| {
            columns.add(&message);
            Ok(())
        })?;
        let mut lines = Lines::new();
        lines.line(&columns.head())?;
        print_each(part, topics, aside, |message| {
            lines.line(&columns.row(&message)).map(|()| true)
        })?;
        return lines.end();
    }
    if arguments.candump {
        let mut lines = Lines::new();
        print_each(part, topics, aside, |message| {
            let Some(line) = candump(&message) else { return Ok(false) };
            lines.line(&line).map(|()| true)
        })?;
        return lines.end();
    }
    let mut show = Show::default();
    print_each(part, topics, out, |message| {
        if out.is_json() {
            out.object(&object!({
                "event": "recorded", "topic": message.topic, "host_time_ns": message.log_ns,
                "message": message.value,
            }))?;
        } else {
            show.lines(&message).iter().try_for_each(|line| out.text(line))?;
        }
        Ok(true)
    })
}

/// Has each of these messages printed by `print`, which returns whether it was one to print. Where
/// none was, there may be a slip in what was asked for.
fn print_each(
    part: &Part,
    topics: &[String],
    out: Output,
    mut print: impl FnMut(Recorded) -> Result<bool, Failure>,
) -> Result<(), Failure> {
    let mut is_empty = true;
    each(part, topics, out, |message| {
        is_empty &= !print(message)?;
        Ok(())
    })?;
    if is_empty {
        let files: Vec<String> = part.files.iter().map(|file| file.display().to_string()).collect();
        out.aside(format!("there is nothing of that in {}", files.join(", ")));
    }
    Ok(())
}

/// Calls `take` with the messages of a part that are of these topics, and says which of its files
/// were cut off.
pub fn each(
    part: &Part,
    topics: &[String],
    out: Output,
    mut take: impl FnMut(Recorded) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for path in &part.files {
        let is_whole =
            read::file(
                path,
                |message| {
                    if part.takes(topics, &message) { take(message) } else { Ok(()) }
                },
            )?;
        if !is_whole {
            tell_cut_off(path, out)?;
        }
    }
    Ok(())
}
