//! What a terminal gets and a pipe does not; what shells and `man` are given.

use std::fs::File;
use std::io::Read;
use std::net::TcpListener;
use std::path::Path;
use std::process::Stdio;

use nix::pty::openpty;

use crate::support::{command, file, mgw};

/// Runs the program to its end with a terminal as standard error, and returns what that showed.
fn on_a_terminal(arguments: &[&str], no_color: &str) -> String {
    let terminal = openpty(None, None).expect("a pseudo terminal");
    let mut program = {
        // Holds the terminal's other side until it is dropped.
        let mut command = command(arguments);
        command.env("NO_COLOR", no_color).env("TERM", "xterm").stdout(Stdio::null());
        command.stderr(Stdio::from(terminal.slave)).spawn().expect("it starts")
    };
    let mut shown = Vec::new();
    // It ends with an error once nobody has the other side.
    let _ = File::from(terminal.master).read_to_end(&mut shown);
    program.wait().expect("it ends");
    String::from_utf8(shown).expect("text")
}

#[test]
fn a_failure_is_coloured_on_a_terminal_only_and_not_against_the_users_will() {
    let arguments = ["--port", "/dev/no-such-gateway", "info"];
    assert!(on_a_terminal(&arguments, "").starts_with("\u{1b}[1;31mmgw:\u{1b}[0m cannot open"));
    assert!(on_a_terminal(&arguments, "1").starts_with("mgw: cannot open"));
    assert!(mgw(&arguments).failure(1).starts_with("mgw: cannot open"));
    // Of clap's own refusals as well.
    assert!(on_a_terminal(&["fly"], "").contains('\u{1b}'));
    assert!(!on_a_terminal(&["fly"], "1").contains('\u{1b}'));
}

#[test]
fn what_takes_longer_than_a_second_is_told_on_a_terminal_only() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", silent.local_addr().unwrap());
    let shown = on_a_terminal(&["--port", &port, "stop"], "1");
    assert!(shown.contains("waiting for the gateway: 1 s"), "{shown}");
    // It is gone when the failure is told.
    let (_, told) = shown.rsplit_once("\u{1b}[K").unwrap();
    assert!(told.starts_with("mgw: the stop was sent, not confirmed"), "{shown}");
    assert!(!mgw(&["--port", &port, "stop"]).failure(3).contains("waiting"));
}

#[test]
fn every_shell_completes_every_command() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = mgw(&["completion", shell]).success();
        for command in commands() {
            assert!(script.contains(&command), "{shell}: {command}");
        }
        assert!(script.contains("speed-limit"), "{shell}");
    }
}

/// The commands there are, as the refusal of another one lists them.
fn commands() -> Vec<String> {
    let refused = mgw(&["man", "fly"]).failure(2);
    let (_, list) = refused.split_once("There are: ").expect("a list");
    let list = list.split(['.', '[', '\n']).next().unwrap_or_default();
    let commands: Vec<String> = list.split(", ").map(|name| name.trim().to_owned()).collect();
    assert!(commands.len() > 30, "{commands:?}");
    commands
}

#[test]
fn the_manual_has_a_page_for_each_command() {
    let page = mgw(&["man"]).success();
    assert!(page.contains(".TH mgw") && page.contains("Exit codes"), "{page}");
    let page = mgw(&["man", "move"]).success();
    assert!(page.contains("Arm an axis, move it by a distance") && page.contains("tolerance"));
    assert!(mgw(&["man", "fly"]).failure(2).contains("There are: demo, sim, serve, info"));
    let dir = file("man");
    std::fs::create_dir(&dir).unwrap();
    mgw(&["man", "--dir", &dir]).success();
    let has_page = |name: &str| Path::new(&dir).join(name).is_file();
    assert!(["mgw.1", "mgw-raw-listen.1"].into_iter().all(has_page));
    for command in commands().iter().filter(|command| *command != "help") {
        assert!(has_page(&format!("mgw-{command}.1")), "{command}");
    }
}

#[test]
fn help_is_a_command_too() {
    assert_eq!(mgw(&["help"]).success(), mgw(&["--help"]).success());
    assert_eq!(mgw(&["help", "set"]).success(), mgw(&["set", "--help"]).success());
}
