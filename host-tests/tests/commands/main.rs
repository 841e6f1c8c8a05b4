//! `docs/commands.md` says of each command of the three manuals what the project does with it. Here
//! the code is asked, cell by cell.
//!
//! A difference is told with the line of the page and what to write there. What stands behind the
//! first `:` of a cell is for people.

mod codecs;
mod lab;
mod native;
mod page;
mod simulated;
mod typed;

use host_protocol::Protocol;
use host_protocol::messages::request_name;
use page::{Cell, Page, Row};
use std::collections::BTreeSet;

/// The headings of the tables of commands, and what is listed there.
const TABLES: [(&str, Protocol); 3] = [
    ("RMD V3.6", Protocol::Rmd),
    ("Thruster manual", Protocol::Thruster),
    ("D5 manual", Protocol::D5),
];

/// What a cell may say only with a reason behind it.
fn needs_a_reason(fact: &str) -> bool {
    fact != "both" && (["no", "request", "reply"].contains(&fact) || fact.starts_with("refused"))
}

/// The differences between a column of all tables and the code.
fn differences(
    column: &str,
    cell: impl Fn(&Row) -> &Cell,
    mut ask: impl FnMut(Protocol, &Row) -> String,
) {
    let page = Page::read();
    let mut wrong = Vec::new();
    for (heading, protocol) in TABLES {
        for row in page.commands(heading) {
            let (said, is) = (cell(&row), ask(protocol, &row));
            let place = format!("docs/commands.md:{}: {}, {column}", row.line, row.command);
            if said.fact != is {
                wrong.push(format!("{place}: the page says `{}`, the code `{is}`", said.fact));
            } else if needs_a_reason(&said.fact) && said.reason.is_empty() {
                wrong.push(format!("{place}: `{is}` wants a reason behind a colon"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_command_of_the_manuals_has_a_row_and_no_other() {
    let page = Page::read();
    for (heading, protocol) in TABLES {
        let rows = page.commands(heading);
        let listed: Vec<&str> = rows.iter().map(|row| row.command.as_str()).collect();
        let commands = codecs::commands(protocol);
        let wanted: Vec<&str> = commands.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            listed, wanted,
            "the rows of `## {heading}` and the commands of its codec, in their order"
        );
        for (row, (name, section)) in rows.iter().zip(&commands) {
            assert_eq!(row.section, *section, "docs/commands.md:{}: {name}", row.line);
        }
    }
}

#[test]
fn decoded() {
    let replies = TABLES.map(|(_, protocol)| codecs::vectors(protocol));
    differences(
        "Decoded",
        |row| &row.decoded,
        |protocol, row| {
            let request = codecs::request(protocol, &row.frame).is_some_and(|m| m.is(&row.command));
            let own_reply = codecs::reply(protocol, &row.frame).is_some_and(|m| m.is(&row.command));
            let reply =
                own_reply || of(protocol, &replies).iter().any(|meaning| meaning.is(&row.command));
            which(request, reply)
        },
    );
}

#[test]
fn encoded() {
    let replies = TABLES.map(|(_, protocol)| codecs::vectors(protocol));
    differences(
        "Encoded",
        |row| &row.encoded,
        |protocol, row| {
            let to_itself = |meaning: codecs::Meaning| {
                meaning.is(&row.command) && meaning.encoded == Some(row.frame.clone())
            };
            let request = codecs::request(protocol, &row.frame).is_some_and(to_itself);
            let own_reply = codecs::reply(protocol, &row.frame).is_some_and(to_itself);
            let reply = |meaning: &codecs::Meaning| {
                meaning.is(&row.command) && meaning.is_encoded_to_itself()
            };
            which(request, own_reply || of(protocol, &replies).iter().any(reply))
        },
    );
}

#[test]
fn native() {
    differences(
        "Native",
        |row| &row.native,
        |protocol, row| native::treatment(protocol, &row.frame),
    );
}

#[test]
fn typed() {
    let uses = TABLES.map(|(_, protocol)| typed::uses(protocol));
    differences(
        "Typed",
        |row| &row.typed,
        |protocol, row| {
            let users: Vec<&str> = of(protocol, &uses)
                .iter()
                .filter(|(name, _)| *name == row.command)
                .map(|(_, user)| *user)
                .collect();
            if users.is_empty() { "no".into() } else { users.join(", ") }
        },
    );
}

#[test]
fn every_request_is_tried_on_a_motor_or_sends_none_anything() {
    let tried: BTreeSet<&str> = TABLES
        .iter()
        .flat_map(|(_, protocol)| typed::uses(*protocol))
        .filter_map(|(_, user)| user.split(' ').next())
        .collect();
    let known = |name: &str| tried.contains(name) || typed::NOT_TRIED.contains(&name);
    let names = (0..=u16::MAX).filter_map(request_name);
    assert_eq!(
        names.filter(|name| !known(name)).collect::<Vec<_>>(),
        [""; 0],
        "typed.rs does not try them"
    );
}

#[test]
fn simulated() {
    let sent: [BTreeSet<String>; 3] = TABLES.map(|(_, protocol)| simulated::sent_unasked(protocol));
    differences(
        "Simulated",
        |row| &row.simulated,
        |protocol, row| {
            let is_request =
                codecs::request(protocol, &row.frame).is_some_and(|m| m.is(&row.command));
            let played = match is_request {
                true => simulated::has_effect(protocol, &row.frame),
                false => of(protocol, &sent).contains(&row.command),
            };
            if played { "yes".into() } else { "no".into() }
        },
    );
}

#[test]
fn what_is_refused_is_refused_so() {
    let page = Page::read();
    let refused = page.refused();
    assert!(!refused.is_empty());
    let mut wrong = Vec::new();
    for row in refused {
        let protocol = codecs::protocol_named(&row.protocol);
        let (said, is) =
            (format!("refused {}", row.error), native::treatment(protocol, &row.frame));
        let place = format!("docs/commands.md:{}: {}", row.line, row.frame);
        if said != is {
            wrong.push(format!("{place}: the page says `{said}`, the code `{is}`"));
        } else if row.reason.is_empty() {
            wrong.push(format!("{place}: no reason"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

fn of<T>(protocol: Protocol, list: &[T; 3]) -> &T {
    let at = TABLES.iter().position(|(_, of)| *of == protocol).unwrap();
    &list[at]
}

/// What of a command there is.
fn which(request: bool, reply: bool) -> String {
    match (request, reply) {
        (true, true) => "both",
        (true, false) => "request",
        (false, true) => "reply",
        (false, false) => "no",
    }
    .into()
}
