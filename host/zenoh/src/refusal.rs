//! Why this program refuses something itself, before the gateway is asked. Pure.

use std::fmt;

use serde_json::{Value, json};

use crate::command::Word;

/// Why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// What was said cannot be read.
    Unreadable(String),
    /// There is no such key.
    UnknownKey { key: String, known: String },
    /// A command that is not a stop was asked of many gateways at once.
    ManyGateways { word: Word, key: String },
    /// Another peer commands.
    NotInCommand { by: String },
    /// The lease is none, or over.
    LeaseOver,
    /// The peer shows no sign of life.
    NoSignOfLife { key: String },
    /// Another gateway has this name.
    NameTwice { name: String },
    /// Too much is asked at a time.
    Busy { waiting: usize },
    /// The gateway cannot be reached now.
    GatewayAway,
}

impl Refusal {
    /// A name that programs can rely on.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Unreadable(_) => "usage",
            Self::UnknownKey { .. } => "unknown_key",
            Self::ManyGateways { .. } => "many_gateways",
            Self::NotInCommand { .. } => "not_in_command",
            Self::LeaseOver => "lease_over",
            Self::NoSignOfLife { .. } => "no_sign_of_life",
            Self::NameTwice { .. } => "name_twice",
            Self::Busy { .. } => "busy",
            Self::GatewayAway => "gateway_away",
        }
    }

    /// The object of an error, as `mgw --json` prints it.
    pub fn to_json(&self) -> Value {
        json!({ "error": { "name": self.name(), "message": self.to_string() } })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unreadable(why) => f.write_str(why),
            Self::UnknownKey { key, known } => {
                write!(f, "nothing can be asked of {key}; there are: {known}")
            }
            Self::ManyGateways { word, key } => write!(
                f,
                "`{}` is asked of one gateway at a time: {key}. Only `stop` and `estop` may be asked \
                 of many",
                word.text()
            ),
            Self::NotInCommand { by } => write!(
                f,
                "peer {by} commands this gateway. It ends when that peer releases it, or falls silent"
            ),
            Self::LeaseOver => f.write_str(
                "this lease is over: it was released, or its peer left or was silent for too long. \
                 Take command again",
            ),
            Self::NoSignOfLife { key } => write!(
                f,
                "there is no liveliness token {key}: declare it before you take command, and keep it"
            ),
            Self::NameTwice { name } => write!(
                f,
                "two gateways of this network are called {name}: nothing moves until one of them \
                 has gone or has another name"
            ),
            Self::Busy { waiting } => {
                write!(f, "{waiting} requests wait already: send one after the reply of another")
            }
            Self::GatewayAway => f.write_str(
                "the gateway cannot be reached now; it is connected again by itself. What was \
                 armed there stops",
            ),
        }
    }
}
