//! `mgw serve`: one cable to a gateway for many programs.

use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use mgw_client::Interrupt;
use mgw_client::{check_shared_name, open_halves, server_socket};
use mgw_serve::{Listener, Tap};
use serde_json::json;

use crate::args::FileArgs;
use crate::explain::with_page;
use crate::failure::Failure;
use crate::find;
use crate::interrupt;
use crate::output::Output;
use crate::record::{Recording, What};
use crate::view::{Reach, View, ViewArgs, check_token};

/// Between two looks at whether a signal has come.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The end of a recording is awaited for so long.
const END_WITHIN: Duration = Duration::from_secs(2);

/// What `mgw serve` is told.
#[derive(Debug, clap::Args)]
pub struct ServeArgs {
    /// TCP address for programs; port 0 takes a free one
    #[arg(long, default_value = "127.0.0.1:7402", value_name = "HOST:PORT")]
    pub listen: SocketAddr,
    /// Unix socket for programs, by which every `mgw` finds the server by itself
    #[arg(long, value_name = "PATH")]
    pub socket: Option<PathBuf>,
    /// What programs on TCP must show, in their MGW_TOKEN; needed to listen beyond this computer
    #[arg(long, env = "MGW_TOKEN", hide_env_values = true, value_name = "TEXT")]
    pub token: Option<String>,
    /// Record every frame of the cable into this MCAP file: what each program asks, what it is
    /// answered, and what the gateway tells
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    #[command(flatten)]
    pub written: FileArgs,
    #[command(flatten)]
    pub view: ViewArgs,
}

/// Serves until the process is ended.
pub fn run(arguments: &ServeArgs, port: Option<&str>, out: Output) -> Result<(), Failure> {
    let ServeArgs { listen, socket, token, record, written, view } = arguments;
    let token = token.clone().filter(|token| !token.is_empty());
    check_token("--listen", *listen, token.as_deref())?;
    // What cannot be is told before anything is served.
    if let Some(port) = port {
        check_shared_name(port)?;
    }
    let failed = |source| Failure::no_port(listen.to_string(), source);
    let listener = TcpListener::bind(listen).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let reach = Reach::new(address, token.clone());
    let page_token = token.clone();
    let mut listeners = vec![Listener::Tcp(listener, token)];
    let mut ports = vec![format!("tcp:{address}")];
    let usual = server_socket();
    let mut found = String::new();
    if let Some(path) = socket.clone().or_else(|| usual.clone()) {
        listeners.push(unix(&path)?);
        ports.push(format!("unix:{}", path.display()));
        let variable = if usual.as_ref() == Some(&path) {
            ""
        } else {
            &format!("MGW_SOCKET={} ", path.display())
        };
        found = format!("Every `{variable}mgw` without --port uses it. ");
    }
    let tap = match record {
        Some(path) => {
            let place = written.place(path.clone());
            Recording::refuse_existing(&place)?;
            Some(tap(Recording::start(place, out.motors)?, out))
        }
        None => None,
    };
    ports.iter().try_for_each(|port| tell_listening(out, port))?;
    if let Some(view) = View::open(view, page_token.as_deref(), out)? {
        view.start(reach);
    }
    out.text(format!("{found}Ctrl-C ends it; what is armed then stops."))?;

    let named = port.map(str::to_owned);
    let open = move || {
        let port = find::cable_port(named.as_deref()).map_err(|failure| with_page(&failure))?;
        open_halves(&port).map_err(|error| with_page(&find::explain(error)))
    };
    let log = move |line: &str| out.progress("log", line, json!({ "message": line }));
    mgw_serve::serve(listeners, open, log, tap);
    Ok(())
}

/// Says by which port it is reached.
pub fn tell_listening(out: Output, port: &str) -> Result<(), Failure> {
    out.event("listening", format!("listening on {port}"), json!({ "port": port }))
}

/// The way into a recording, which ends with the process: a signal ends both, the recording first.
fn tap(recording: Recording, out: Output) -> Tap {
    let tap = recording.tap();
    let interrupt = interrupt::note();
    thread::spawn(move || await_end(recording, &interrupt, out));
    Box::new(move |seen| tap.put(What::Seen(seen)))
}

fn await_end(recording: Recording, interrupt: &Interrupt, out: Output) {
    while !interrupt.is_raised() && !recording.has_failed() {
        thread::sleep(LOOK_EVERY);
    }
    // A disk that hangs holds up no end.
    let (sender, ended) = channel();
    thread::spawn(move || sender.send(recording.finish()));
    let ended =
        if interrupt.is_raised() { ended.recv_timeout(END_WITHIN).ok() } else { ended.recv().ok() };
    let told = match ended {
        Some(Ok(summary)) => out.event("recording_ended", summary.text(), summary.fields()),
        Some(Err(failure)) => tell(out, &format!("the recording has ended: {failure}")),
        None => tell(out, "the recording is cut off: the disk did not take its end in time"),
    };
    // A log that nobody reads is no reason to stop serving.
    drop(told);
    while !interrupt.is_raised() {
        thread::sleep(LOOK_EVERY);
    }
    std::process::exit(0);
}

fn tell(out: Output, line: &str) -> Result<(), Failure> {
    out.event("log", line, json!({ "message": line }))
}

#[cfg(unix)]
fn unix(path: &std::path::Path) -> Result<Listener, Failure> {
    use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
    use std::os::unix::net::UnixListener;
    let failed = |source| Failure::Server {
        address: path.display().to_string(),
        source,
        another: "another --socket",
    };
    let told = match mgw_client::open(&format!("unix:{}", path.display())) {
        Ok(_) => Some("answers"),
        Err(error) if find::hangs(&error) => Some("hangs"),
        Err(_) => None,
    };
    if let Some(does) = told {
        return Err(Failure::Usage(format!(
            "a server runs already: {} {does}. Give another --socket and --listen for a second \
                gateway",
            path.display()
        )));
    }
    // One that has ended leaves its socket behind.
    let is_left = std::fs::symlink_metadata(path)
        .is_ok_and(|file| std::os::unix::fs::FileTypeExt::is_socket(&file.file_type()));
    if is_left {
        std::fs::remove_file(path).map_err(failed)?;
    }
    if let Some(directory) = path.parent().filter(|directory| !directory.exists()) {
        std::fs::DirBuilder::new().mode(0o700).create(directory).map_err(failed)?;
    }
    let listener = UnixListener::bind(path).map_err(failed)?;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600)).map_err(failed)?;
    Ok(Listener::Unix(listener))
}

#[cfg(not(unix))]
fn unix(path: &std::path::Path) -> Result<Listener, Failure> {
    Err(Failure::Usage(format!("{}: this system has no Unix sockets", path.display())))
}
