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

#[cfg(test)]
mod tests {
    use super::*;
    use host_protocol::Text;

    fn names(all: &[(Subject, &str)]) -> Names {
        let named =
            |(of, name): &(Subject, &str)| Named { of: *of, name: Text::try_from(*name).unwrap() };
        Names(all.iter().map(named).collect())
    }

    #[test]
    fn what_is_typed_is_found_among_its_kind() {
        let names = names(&[
            (Subject::Gateway, "arm"),
            (Subject::Bus(1), "left"),
            (Subject::Axis(0), "right"),
            (Subject::Axis(7), "left"),
        ]);
        let typed = |text: &str| text.parse::<Typed>().unwrap();
        assert_eq!(names.find_axis(&typed("left")).unwrap(), 7);
        assert_eq!(names.find_bus(&typed("left")).unwrap(), 1);
        assert_eq!(names.find_axis(&typed("9")).unwrap(), 9);
        assert_eq!(names.find_bus(&typed("0x0B")).unwrap(), 11);
        let said = |result: Result<u8, Failure>| result.unwrap_err().to_string();
        assert_eq!(
            said(names.find_axis(&typed("arm"))),
            "no axis is called `arm`; there are: right (0), left (7)"
        );
        assert_eq!(
            said(names.find_bus(&typed("Left"))),
            "no bus is called `Left`; there are: left (1)"
        );
        assert_eq!(
            said(Names::default().find_bus(&typed("x"))),
            "no bus is called `x`; no bus has a name; give its number"
        );
        for text in ["", "-1", "256", "2nd", "a b", "all", "gateway", "a:1"] {
            assert!(text.parse::<Typed>().is_err(), "{text}");
        }
    }
}
