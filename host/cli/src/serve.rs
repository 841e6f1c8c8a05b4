//! `mgw sim`: a simulated gateway behind a TCP port.

use std::io::ErrorKind;
use std::net::TcpListener;
use std::path::Path;
use std::rc::Rc;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use host_protocol::{AxisParameter, StoredState, Value};
use mgw_sim::{BOARD, images::ImageSlots};
use serde_json::json;

use crate::args::SimArgs;
use crate::failure::Failure;
use crate::four_motors;
use crate::output::Output;
use crate::server::tell_listening;

/// Between two attempts to read a terminal that belongs to another program.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// Serves until the process is ended.
pub fn run(arguments: &SimArgs, out: Output) -> Result<(), Failure> {
    let SimArgs { listen, d5_id, motors, flight_recorder, .. } = arguments;
    let (d5_id, storage) = (*d5_id, arguments.storage.as_deref());
    // What comes from its box is not configured.
    let unconfigured = arguments.unconfigured || !motors.is_empty();
    let failed = |source| Failure::no_port(listen.to_string(), source);
    let listener = TcpListener::bind(*listen).map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;

    let world = match motors.as_slice() {
        [] => four_motors::world(d5_id),
        motors => four_motors::of(motors)?,
    };
    let stored = mgw_sim::flash::storage(storage).map_err(|source| {
        let path = storage.unwrap_or(Path::new("")).display().to_string();
        Failure::Usage(format!("{path} cannot be the storage: {source}"))
    })?;
    let kept = flight_recorder.as_ref().map(|path| {
        mgw_sim::FlightFile::new(path).map_err(|source| {
            let path = path.display();
            Failure::Usage(format!("{path} cannot be the file of the flight recorder: {source}"))
        })
    });
    let kept = kept.transpose()?;
    world.borrow_mut().set_storage(stored);
    world.borrow_mut().set_images(ImageSlots::new(&BOARD));
    let is_stored = {
        let state = four_motors::connect(&world)?.read_stored()?.state;
        !matches!(state, StoredState::Nothing)
    };
    if !unconfigured && !is_stored {
        let mut client = four_motors::connect(&world)?;
        four_motors::configure(&mut client, &four_motors::configuration()?)?;
        if let Some(id) = d5_id {
            let id = Value::Unsigned(id.to_wire());
            client.configure_axis(four_motors::D5_AXIS, AxisParameter::D5RequestId, id)?;
        }
        client.release_authority()?;
    }
    let world = Rc::into_inner(world).expect("the session that shared it has ended").into_inner();

    tell_listening(out, &format!("tcp:{address}"))?;
    out.text(format!("try: mgw --port tcp:{address} info"))?;
    if !motors.is_empty() {
        out.text(format!("     mgw --port tcp:{address} scan"))?;
    } else if unconfigured {
        out.text(format!(
            "     mgw --port tcp:{address} config apply host/cli/examples/four-motors.toml"
        ))?;
    }
    if motors.is_empty() {
        out.text(format!("     mgw --port tcp:{address} set 0 velocity 2 --for 3"))?;
    }
    if !address.ip().is_loopback() {
        out.event(
            "warning",
            format!(
                "WARNING: {address} can be reached from other computers, and each of them may \
                    command"
            ),
            json!({ "message": "other computers can reach it, and each of them may command" }),
        )?;
    }
    out.text("A line typed here puts a fault into it: `help` lists them.")?;
    out.text("Ctrl-C ends it. What the motors and the server do, in seconds since the start:")?;

    let mut print_failure = None;
    mgw_sim::serve(listener, world, &typed(), kept, |line: &str| {
        // A log that nobody reads is no reason to stop serving.
        print_failure = out.event("log", line, json!({ "message": line })).err();
    })
    .map_err(failed)?;
    print_failure.map_or(Ok(()), Err)
}

/// The lines of standard input as they are typed.
fn typed() -> Receiver<String> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        not_stopped_in_the_background();
        loop {
            let mut line = String::new();
            match std::io::stdin().read_line(&mut line) {
                Ok(0) => return,
                Ok(_) if line.trim().is_empty() => {}
                Ok(_) => {
                    if sender.send(line.trim().to_owned()).is_err() {
                        return;
                    }
                }
                Err(error) if error.kind() == ErrorKind::InvalidData => {}
                // In the background of a shell; it may be fetched back.
                Err(_) => thread::sleep(LOOK_AGAIN),
            }
        }
    });
    receiver
}

/// A shell stops what reads its terminal in the background, and a simulation is to go on there.
fn not_stopped_in_the_background() {
    #[cfg(unix)]
    {
        use nix::sys::signal::{SigSet, Signal};
        let mut signals = SigSet::empty();
        signals.add(Signal::SIGTTIN);
        let _ = signals.thread_block();
    }
}
