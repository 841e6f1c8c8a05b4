//! `mgw play`

use std::path::Path;

use serde_json::json as object;

use super::export::{Columns, Lines, candump};
use super::read::{self, Recorded, Wanted};
use super::show::Show;
use crate::args::{Part, PlayArgs};
use crate::failure::Failure;
use crate::output::Output;

/// What is wanted of recordings, as it was typed.
pub fn wanted(part: &Part, topics: &[String]) -> Wanted {
    Wanted { topics: topics.to_vec(), axes: part.axes.clone(), from: part.from, to: part.to }
}

/// Prints recordings, or exports them.
pub fn run(arguments: &PlayArgs, out: Output) -> Result<(), Failure> {
    let wanted = wanted(&arguments.part, &arguments.topics);
    let files = &arguments.part.files;
    if arguments.csv {
        // A line has a place for each field of any.
        let mut columns = Columns::default();
        each(files, &wanted, Output::none(), |message| {
            columns.add(&message);
            Ok(())
        })?;
        let mut lines = Lines::new();
        lines.line(&columns.head())?;
        each(files, &wanted, out, |message| lines.line(&columns.row(&message)))?;
        return lines.end();
    }
    if arguments.candump {
        let mut lines = Lines::new();
        each(files, &wanted, out, |message| {
            candump(&message).map_or(Ok(()), |line| lines.line(&line))
        })?;
        return lines.end();
    }
    let mut show = Show::default();
    each(files, &wanted, out, |message| {
        if out.is_json() {
            return out.object(&object!({
                "event": "recorded", "topic": message.topic, "host_time_ns": message.log_ns,
                "message": message.value,
            }));
        }
        show.lines(&message).iter().try_for_each(|line| out.text(line))
    })
}

/// Calls `take` with what is wanted of these files, and says which of them were cut off.
pub fn each(
    files: &[impl AsRef<Path>],
    wanted: &Wanted,
    out: Output,
    mut take: impl FnMut(Recorded) -> Result<(), Failure>,
) -> Result<(), Failure> {
    for path in files {
        let path = path.as_ref();
        let is_whole =
            read::file(
                path,
                |message| {
                    if wanted.takes(&message) { take(message) } else { Ok(()) }
                },
            )?;
        if !is_whole {
            out.aside(format!(
                "{} was cut off: what was written before that is here",
                path.display()
            ));
        }
    }
    Ok(())
}
