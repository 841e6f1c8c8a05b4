//! `mgw completion` and `mgw man`, both made from the command line's own definition.

use std::io::{self, Write};
use std::path::Path;

use clap::CommandFactory;
use clap_complete::Shell;
use clap_mangen::Man;

use crate::args::Cli;
use crate::failure::Failure;

/// Prints the script that completes command lines in a shell.
pub fn completion(shell: Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "mgw", &mut script);
    print(&script)
}

/// Prints the page of the program or of one command, or writes all of them into a directory.
pub fn pages(command: Option<&str>, dir: Option<&Path>) -> Result<(), Failure> {
    let mut program = Cli::command();
    program.build();
    if let Some(dir) = dir {
        let failed =
            |error| Failure::Usage(format!("cannot write into {} ({error})", dir.display()));
        return clap_mangen::generate_to(Cli::command(), dir).map_err(failed);
    }
    let page = match command {
        None => program,
        Some(name) => {
            let names: Vec<&str> = program.get_subcommands().map(clap::Command::get_name).collect();
            let unknown = format!("there is no command `{name}`. There are: {}", names.join(", "));
            program.find_subcommand(name).ok_or(Failure::Usage(unknown))?.clone()
        }
    };
    let mut text = Vec::new();
    Man::new(page).render(&mut text).map_err(Failure::Output)?;
    print(&text)
}

fn print(text: &[u8]) -> Result<(), Failure> {
    io::stdout().lock().write_all(text).map_err(Failure::Output)
}
