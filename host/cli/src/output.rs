//! Standard output: text for people, or JSON for programs. Never panics when nobody reads it.

use std::cell::RefCell;

use serde::Serialize;
use serde_json::Value;

use crate::failure::Failure;
use crate::faults::Protocols;
use crate::json;
use crate::printable::printable;
use crate::stream;
use crate::table::Table;
use crate::terminal::{self, Progress};

/// Where a command prints.
#[derive(Debug, Clone, Copy)]
pub struct Output {
    form: Form,
    /// By which faults are named.
    pub motors: Protocols,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Text,
    Json,
    /// Nothing is printed: a test looks at what the command does.
    Nothing,
    /// Text, which a test takes with [`take_kept`].
    Kept,
}

thread_local! {
    /// What was printed on an output that keeps it.
    static KEPT: RefCell<String> = const { RefCell::new(String::new()) };
}

/// What this thread has printed on outputs that keep it, since the last time.
pub fn take_kept() -> String {
    KEPT.take()
}

impl Output {
    /// Prints JSON if `json`, else text.
    pub fn new(json: bool) -> Self {
        Self { form: if json { Form::Json } else { Form::Text }, motors: Protocols::default() }
    }

    /// Prints nothing.
    pub fn none() -> Self {
        Self { form: Form::Nothing, motors: Protocols::default() }
    }

    /// Prints text that is kept for [`take_kept`].
    pub fn kept() -> Self {
        Self { form: Form::Kept, motors: Protocols::default() }
    }

    /// Prints a line for people; nothing in JSON.
    pub fn text(self, line: impl AsRef<str>) -> Result<(), Failure> {
        match self.form {
            Form::Text | Form::Kept => self.line(line.as_ref()),
            Form::Json | Form::Nothing => Ok(()),
        }
    }

    /// Prints a table for people; nothing in JSON.
    pub fn table(self, table: &Table) -> Result<(), Failure> {
        table.lines().iter().try_for_each(|line| self.text(line))
    }

    /// Prints a line of JSON for programs; nothing in text.
    pub fn object(self, value: &Value) -> Result<(), Failure> {
        if self.form == Form::Json { print_line(&value.to_string()) } else { Ok(()) }
    }

    /// Prints what `line` says, or a line of a stream of JSON: the event of this name.
    pub fn event(self, name: &str, line: impl AsRef<str>, fields: Value) -> Result<(), Failure> {
        self.either(line, &json::line(name, fields))
    }

    /// Prints the event of something that goes on where nobody reads this.
    pub fn progress(self, name: &str, line: impl AsRef<str>, fields: Value) {
        let _ = self.event(name, line, fields);
    }

    /// Tells people something that is not what they asked for: it goes to standard error.
    pub fn aside(self, line: impl AsRef<str>) {
        if self.form == Form::Text {
            terminal::something_is_printed();
            // With nobody to hear it there is nothing more to do.
            let _ = stream::ERR.print(format!("mgw: {}\n", printable(line.as_ref())));
        }
    }

    /// Tells people, until it is dropped, what takes longer than a second.
    pub fn waiting_for(self, what: &'static str) -> Progress {
        if self.form == Form::Text { Progress::of(what) } else { Progress::none() }
    }

    /// Whether anything is printed.
    pub fn is_heard(self) -> bool {
        self.form != Form::Nothing
    }

    /// Whether it is JSON.
    pub fn is_json(self) -> bool {
        self.form == Form::Json
    }

    /// Prints a line that is already in the form asked for.
    pub fn line(self, line: &str) -> Result<(), Failure> {
        match self.form {
            Form::Nothing => {}
            Form::Kept => KEPT.with_borrow_mut(|kept| {
                kept.push_str(&printable(line));
                kept.push('\n');
            }),
            Form::Text | Form::Json => print_line(line)?,
        }
        Ok(())
    }

    /// Prints either what `line` says, or `value`.
    pub fn either(self, line: impl AsRef<str>, value: &Value) -> Result<(), Failure> {
        self.text(line)?;
        self.object(value)
    }
}

fn print_line(line: &str) -> Result<(), Failure> {
    terminal::something_is_printed();
    stream::OUT.print(format!("{}\n", printable(line))).map_err(Failure::Output)
}

/// A type of the wire as JSON, its numbers as short as they are precise.
pub fn to_json(value: &impl Serialize) -> Value {
    let mut value = serde_json::to_value(value).unwrap_or(Value::Null);
    shorten(&mut value);
    value
}

/// A single-precision number as JSON: 0.1 and not 0.10000000149011612; null where JSON has no such
/// number.
pub fn number(value: f32) -> Value {
    value
        .to_string()
        .parse::<f64>()
        .ok()
        .and_then(serde_json::Number::from_f64)
        .map_or(Value::Null, Value::Number)
}

fn shorten(value: &mut Value) {
    match value {
        Value::Number(wide) if wide.is_f64() => {
            #[allow(clippy::cast_possible_truncation)]
            let narrow = wide.as_f64().map(|wide| wide as f32);
            *value = narrow.map_or(Value::Null, number);
        }
        Value::Array(items) => items.iter_mut().for_each(shorten),
        Value::Object(fields) => fields.values_mut().for_each(shorten),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_stays_short() {
        #[derive(Serialize)]
        struct Reading {
            value: f32,
            age_us: u32,
        }
        let json = to_json(&Some(Reading { value: 0.1, age_us: 7 }));
        assert_eq!(json.to_string(), r#"{"age_us":7,"value":0.1}"#);
        assert_eq!(number(f32::NAN), Value::Null);
    }
}
