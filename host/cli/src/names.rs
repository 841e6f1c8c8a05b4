//! The names that a gateway has: what is typed becomes a number, and numbers are shown with them.

use host_protocol::{Named, Subject};

use crate::args::Typed;
use crate::config::Configuration;
use crate::failure::Failure;

/// The names of a gateway, its buses and its axes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Names(Vec<Named>);

impl From<Vec<Named>> for Names {
    fn from(names: Vec<Named>) -> Self {
        Self(names)
    }
}

impl From<&Configuration> for Names {
    fn from(configuration: &Configuration) -> Self {
        let named = |(of, name): (&Subject, &_)| Named { of: *of, name: Clone::clone(name) };
        Self(configuration.names.iter().map(named).collect())
    }
}

impl Names {
    /// The name of something.
    pub fn of(&self, of: Subject) -> Option<&str> {
        self.0.iter().find(|named| named.of == of).map(|named| named.name.as_str())
    }

    /// The name of an axis.
    pub fn axis(&self, axis: u8) -> Option<&str> {
        self.of(Subject::Axis(axis))
    }

    /// Whether an axis has one.
    pub fn have_axes(&self) -> bool {
        self.0.iter().any(|named| matches!(named.of, Subject::Axis(_)))
    }

    /// The number of an axis that was typed.
    pub fn find_axis(&self, typed: &Typed) -> Result<u8, Failure> {
        self.find(typed, "axis", |of| match of {
            Subject::Axis(axis) => Some(axis),
            _ => None,
        })
    }

    /// The number of a bus that was typed.
    pub fn find_bus(&self, typed: &Typed) -> Result<u8, Failure> {
        self.find(typed, "bus", |of| match of {
            Subject::Bus(bus) => Some(bus),
            _ => None,
        })
    }

    fn find(
        &self,
        typed: &Typed,
        kind: &str,
        number: impl Fn(Subject) -> Option<u8>,
    ) -> Result<u8, Failure> {
        let name = match typed {
            Typed::Number(number) => return Ok(*number),
            Typed::Name(name) => name,
        };
        let named = |named: &Named| Some((number(named.of)?, named.name.as_str().to_owned()));
        let all: Vec<(u8, String)> = self.0.iter().filter_map(named).collect();
        if let Some((number, _)) = all.iter().find(|(_, of)| of == name) {
            return Ok(*number);
        }
        let list: Vec<String> =
            all.iter().map(|(number, name)| format!("{name} ({number})")).collect();
        let there = match list.as_slice() {
            [] => format!("no {kind} has a name; give its number"),
            list => format!("there are: {}", list.join(", ")),
        };
        Err(Failure::Usage(format!("no {kind} is called `{name}`; {there}")))
    }
}
