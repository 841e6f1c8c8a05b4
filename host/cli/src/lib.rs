//! The commands of `mgw`, the command line of the motor gateway.
//!
//! The program calls [`main`]. Tests run a command in virtual time, on a line of their own, with
//! [`run_on`], or with [`print_on`] where they read what it prints.
#![forbid(unsafe_code)]

mod args;
mod bench;
mod commands;
mod config;
mod decode;
mod delays;
mod demo;
mod dialects;
mod encode;
mod explain;
mod failure;
mod faults;
mod find;
pub mod flight;
mod four_motors;
mod frames;
mod given;
mod image;
mod image_file;
mod interrupt;
mod json;
mod keys;
mod live;
mod manual;
mod motor;
mod names;
mod native_request;
mod output;
mod parameters;
mod plan;
mod printable;
pub mod programs;
mod record;
mod scan;
mod serve;
mod server;
mod session;
mod states;
mod stream;
mod table;
mod terminal;
mod top;
mod view;
mod words;
mod written;

use std::error::Error as _;
use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;
use host_protocol::{PROTOCOL_MAJOR, PROTOCOL_MINOR};
use mgw_client::{Interrupt, Transport};
use mgw_sim::{Injection, MotorWiring};
use serde_json::Value;

use args::{Cli, Command, SimArgs};
use failure::Failure;
use output::Output;

/// Runs the command of this process's arguments, and prints.
pub fn main() -> ExitCode {
    let mut cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return wrong_usage(&error),
    };
    // An empty variable counts as none.
    if std::env::var_os("MGW_PORT").is_some_and(|port| port.is_empty()) {
        cli.port = cli.port.filter(|port| !port.is_empty());
    }
    // Words after an encoded command are its own, and `--json` may be one of them.
    cli.json |=
        matches!(&cli.command, Some(Command::Encode(arguments)) if arguments.asks_for_json());
    let code = ended(run(&cli), cli.json);
    stream::OUT.end();
    stream::ERR.end();
    code
}

/// The exit code of a command; a failure is told.
fn ended(result: Result<(), Failure>, json: bool) -> ExitCode {
    result.map_or_else(|failure| failed(&failure, json), |()| ExitCode::SUCCESS)
}

fn failed(failure: &Failure, json: bool) -> ExitCode {
    if !failure.is_silent() {
        tell(failure, json);
    }
    ExitCode::from(failure.exit_code())
}

/// What `--version --json` prints.
fn version() -> Value {
    serde_json::json!({
        "program": "mgw", "version": env!("CARGO_PKG_VERSION"),
        "protocol_major": PROTOCOL_MAJOR, "protocol_minor": PROTOCOL_MINOR,
    })
}

/// How a command ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// The exit code of the program.
    pub exit_code: u8,
    /// The name of the failure and its text, where there is one.
    pub failure: Option<(String, String)>,
}

/// Runs one command on `transport`, in the transport's time, and prints nothing. `interrupt` is its
/// Ctrl-C.
pub fn run_on(transport: Box<dyn Transport>, interrupt: Interrupt, arguments: &[&str]) -> Outcome {
    outcome(transport, interrupt, Output::none(), arguments)
}

/// As [`run_on`], and what the program would print on standard output.
pub fn print_on(
    transport: Box<dyn Transport>,
    interrupt: Interrupt,
    arguments: &[&str],
) -> (Outcome, String) {
    let outcome = outcome(transport, interrupt, Output::kept(), arguments);
    (outcome, output::take_kept())
}

/// What motors are told before anything else, by their places.
pub type Told = Vec<(usize, Injection)>;

/// The motors of the arguments of `mgw sim --motor …`, for a board that is not `mgw sim`. `None` if
/// they are not such arguments.
pub fn factory_motors(arguments: &[&str]) -> Option<(Vec<MotorWiring>, Told)> {
    match Cli::try_parse_from(["mgw"].iter().chain(arguments)).ok()?.command? {
        Command::Sim(SimArgs { motors, .. }) => {
            let (wiring, injections) = four_motors::wiring(&motors);
            Some((wiring.motors, injections))
        }
        _ => None,
    }
}

fn outcome(
    transport: Box<dyn Transport>,
    interrupt: Interrupt,
    out: Output,
    arguments: &[&str],
) -> Outcome {
    let result = match Cli::try_parse_from(["mgw"].iter().chain(arguments)) {
        Ok(Cli { command: Some(command), .. }) => {
            commands::run(transport, interrupt, out, &command)
        }
        Ok(_) => Err(Failure::Usage("which command?".to_owned())),
        Err(error) => Err(Failure::Usage(error.to_string())),
    };
    match result {
        Ok(()) => Outcome { exit_code: 0, failure: None },
        Err(failure) => Outcome {
            exit_code: failure.exit_code(),
            failure: Some((failure.name().to_owned(), failure.to_string())),
        },
    }
}

/// Help and version as they are; what was typed wrong as JSON where JSON was asked for.
fn wrong_usage(error: &clap::Error) -> ExitCode {
    let wants_json = std::env::args().any(|argument| argument == "--json");
    if wants_json && error.kind() == ErrorKind::DisplayVersion {
        return ended(Output::new(true).object(&version()), true);
    }
    // Some files are read with the arguments that name them.
    if let Some(failure) = error.source().and_then(|source| source.downcast_ref()) {
        return failed(failure, wants_json);
    }
    if !error.use_stderr() || !wants_json {
        error.exit();
    }
    let text = error.to_string();
    let (cause, _usage) = text.split_once("Usage:").unwrap_or((&text, ""));
    let words: Vec<&str> = cause.trim_start_matches("error:").split_whitespace().collect();
    ended(Err(Failure::Usage(words.join(" "))), true)
}

fn run(cli: &Cli) -> Result<(), Failure> {
    let out = Output::new(cli.json);
    match &cli.command {
        None | Some(Command::Demo) => demo::run(out),
        Some(Command::Sim(arguments)) => serve::run(arguments, out),
        Some(Command::Serve(arguments)) => server::run(arguments, cli.port.as_deref(), out),
        Some(Command::Decode(arguments)) => decode::run(arguments, cli.json),
        Some(Command::Encode(arguments)) => encode::run(arguments, cli.json),
        Some(Command::Plan(arguments)) => plan::run(arguments, out),
        Some(Command::Delays(arguments)) => delays::run(arguments, out),
        Some(Command::Image(arguments)) => image::run(arguments, out),
        Some(Command::Explain { code }) => explain::run(code.as_deref(), out),
        Some(Command::Play(arguments)) => record::play(arguments, out),
        Some(Command::Replay { file, around, image }) => {
            flight::run(file, around.around, image.as_deref(), out)
        }
        Some(Command::Plot(arguments)) => record::plot(arguments, out),
        Some(Command::Top(arguments)) => top::run(arguments, cli.port.as_deref(), out),
        Some(Command::Completion { shell }) => manual::completion(*shell),
        Some(Command::Man { command, dir }) => manual::pages(command.as_deref(), dir.as_deref()),
        Some(Command::Config { action })
            if let Some(result) = commands::config::run_alone(action, cli.port.is_some(), out) =>
        {
            result
        }
        Some(command) => {
            // Before anything connects. What is itself a stop has nothing to stop when a signal
            // ends it.
            let interrupt =
                if commands::is_stop(command) { Interrupt::default() } else { interrupt::note() };
            let opened = find::open_port(cli.port.as_deref(), out);
            if let (Err(_), Command::Config { action }) = (&opened, command) {
                // What is wrong with a file is worth more than that nobody is there.
                commands::config::refuse_without_board(action)?;
            }
            let (port, transport) = opened?;
            commands::run(transport, interrupt, out, command)
                .map_err(|failure| find::not_a_gateway(&port, failure))
        }
    }
}

fn tell(failure: &Failure, json: bool) {
    let text = if json { failure.to_json().to_string() } else { explain::with_page(failure) };
    let mut before = if json { String::new() } else { format!("{} ", terminal::failed()) };
    // Some failures take several lines.
    for line in text.lines() {
        // With nobody to hear it there is nothing more to do.
        let _ = stream::ERR.print(format!("{before}{}\n", printable::printable(line)));
        before.clear();
    }
}
