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
    let mut cli = Cli::parse();
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
