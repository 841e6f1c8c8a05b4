//! Axes and buses as they are typed: by number or by name.

use std::fmt;
use std::str::FromStr;

use host_protocol::is_name;

use crate::parameters;

/// An axis or a bus: its number, or its name, which the gateway knows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Typed {
    Number(u8),
    Name(String),
}

impl FromStr for Typed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if is_name(text) {
            return Ok(Self::Name(text.to_owned()));
        }
        let number = parameters::unsigned(text).and_then(|number| u8::try_from(number).ok());
        number.map(Self::Number).ok_or_else(|| {
            "takes a number from 0 to 255, or a name: letters, digits, - and _, a letter first"
                .to_owned()
        })
    }
}

impl fmt::Display for Typed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => number.fmt(f),
            Self::Name(name) => name.fmt(f),
        }
    }
}

/// What to stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TypedStop {
    All,
    Axis(Typed),
}

/// What to clear.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TypedClear {
    Gateway,
    Axis(Typed),
}
