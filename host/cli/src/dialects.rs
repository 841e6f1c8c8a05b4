//! Which dialect the motors of RMD axes speak: what the axis says, what the answers say, and which
//! answer says what.

use host_protocol::replies::Recognition;
use host_protocol::{Agreement, Protocol, VersionAnswer};
use mgw_client::ClientError;
use rmd::{Dialect, Dialects};
use serde_json::json;

use crate::failure::Failure;
use crate::json;
use crate::session::Session;
use crate::words;

/// An axis, and what its motor answered.
pub struct Asked {
    axis: u8,
    /// What it says, also by its default.
    stated: Dialect,
    /// Or why it did not answer.
    told: Result<Recognition, String>,
}

/// Asks the motors of all RMD axes; those that are armed are not asked again.
pub fn of_axes(session: &mut Session) -> Result<Vec<Asked>, Failure> {
    let axes = session.client.list_axes()?;
    let axes = axes.iter().filter(|axis| axis.protocol == Some(Protocol::Rmd));
    let mut all = Vec::new();
    for axis in axes.map(|axis| axis.axis) {
        let told = match session.client.recognise(axis) {
            Ok(told) => Ok(told),
            Err(ClientError::Gateway(error)) => Err(error.to_string()),
            Err(error) => return Err(error.into()),
        };
        let stated = session.stated_dialect(axis)?.unwrap_or_default();
        all.push(Asked { axis, stated, told });
    }
    Ok(all)
}

/// The names of dialects by their bits, without unknown.
fn names(bits: u8) -> Vec<&'static str> {
    let known = Dialects::from_bits(bits).both(Dialects::KNOWN);
    known.iter().map(Dialect::name).collect()
}

/// What the agreement of the answers to a read is called.
const fn agreement(answer: &VersionAnswer) -> &'static str {
    match answer.agreement {
        Agreement::Once => "once",
        Agreement::Twice => "twice",
        Agreement::Different => "the other time otherwise",
    }
}

impl Asked {
    /// Its lines of `mgw info`.
    pub fn lines(&self) -> Vec<String> {
        let Self { axis, stated, told } = self;
        let told = match told {
            Ok(told) => told,
            Err(error) => {
                return vec![format!("axis {axis}: rmd_dialect is {}; {error}", stated.name())];
            }
        };
        let says = match Dialect::from_number(told.dialect.into()) {
            Some(dialect) if dialect != Dialect::Unknown => {
                format!("its motor answers as {} does", dialect.name())
            }
            _ if told.possible == 0 => "its motor answers in several ways".to_owned(),
            _ if names(told.possible).len() == Dialect::ALL.len() - 1 => {
                "its motor did not tell what it speaks".to_owned()
            }
            _ => format!("its motor answers as one of {}", names(told.possible).join(", ")),
        };
        let contradicts =
            *stated != Dialect::Unknown && !Dialects::from_bits(told.possible).contains(*stated);
        let bars = if contradicts { ": it is not armed" } else { "" };
        let head = format!("axis {axis}: rmd_dialect is {}; {says}{bars}", stated.name());
        let answers = told.answers.iter().map(|answer| {
            format!(
                "  {} is answered {} {}: {}",
                words::hex(&answer.request),
                words::hex(&answer.answer),
                agreement(answer),
                names(answer.dialects).join(", ")
            )
        });
        std::iter::once(head).chain(answers).collect()
    }

    /// The same for programs.
    pub fn json(&self) -> serde_json::Value {
        let Self { axis, stated, told } = self;
        let told = told.as_ref();
        let recognised = told.ok().map(|told| {
            Dialect::from_number(told.dialect.into()).unwrap_or(Dialect::Unknown).name()
        });
        let evidence = told.ok().into_iter().flat_map(|told| &told.answers).map(|answer| {
            json!({
                "request": words::hex(&answer.request), "answer": words::hex(&answer.answer),
                "dialects": names(answer.dialects), "agreement": json::name(&answer.agreement),
            })
        });
        json!({
            "axis": axis, "rmd_dialect": stated.name(), "recognised_dialect": recognised,
            "possible_dialects": told.map_or_else(|_| Vec::new(), |told| names(told.possible)),
            "evidence": evidence.collect::<Vec<_>>(), "error": told.err(),
        })
    }
}
