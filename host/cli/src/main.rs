//! `mgw`: the command line of the motor gateway.
#![forbid(unsafe_code)]

mod args;
mod commands;
mod decode;
mod demo;
mod encode;
mod failure;
mod four_motors;
mod frames;
mod interrupt;
mod json;
mod native_request;
mod output;
mod parameters;
mod plan;
mod serve;
mod session;
mod states;
mod table;
mod words;

use std::process::ExitCode;

use clap::Parser;

use args::{Cli, Command};
use failure::Failure;
use output::Output;
use session::Session;

fn main() -> ExitCode {
    let mut cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return wrong_usage(&error),
    };
    // Words after an encoded command are its own, and `--json` may be one of them.
    cli.json |= matches!(&cli.command, Some(Command::Encode(arguments)) if arguments.asks_for_json());
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.is_silent() {
                tell(&failure, cli.json);
            }
            ExitCode::from(failure.exit_code())
        }
    }
}

/// Help and version as they are; what was typed wrong as JSON where JSON was asked for.
fn wrong_usage(error: &clap::Error) -> ExitCode {
    let wants_json = std::env::args().any(|argument| argument == "--json");
    if !error.use_stderr() || !wants_json {
        error.exit();
    }
    let text = error.to_string();
    let (cause, _usage) = text.split_once("Usage:").unwrap_or((&text, ""));
    let words: Vec<&str> = cause.trim_start_matches("error:").split_whitespace().collect();
    let failure = Failure::Usage(words.join(" "));
    tell(&failure, true);
    ExitCode::from(failure.exit_code())
}

fn run(cli: &Cli) -> Result<(), Failure> {
    let out = Output::new(cli.json);
    match &cli.command {
        None | Some(Command::Demo) => demo::run(out),
        Some(Command::Sim { listen, unconfigured }) => serve::run(*listen, *unconfigured, out),
        Some(Command::Decode(arguments)) => decode::run(arguments, cli.json),
        Some(Command::Encode(arguments)) => encode::run(arguments, cli.json),
        Some(command) => commands::run(&mut Session::open(cli.port.as_deref(), out)?, command),
    }
}

fn tell(failure: &Failure, json: bool) {
    use std::io::Write;
    let text = if json { failure.to_json().to_string() } else { format!("mgw: {failure}.") };
    // With nobody to hear it there is nothing more to do.
    let _ = writeln!(std::io::stderr(), "{text}");
}
