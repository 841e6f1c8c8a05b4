//! `mgw top`: the live view of a gateway in a terminal. It watches, and takes no authority; a
//! person may stop everything or clear a trip from it.

mod columns;
mod display;
mod keys;
mod screen;
mod suspension;
mod view;
mod watching;

use std::time::Duration;

use mgw_client::{ClientError, Interrupt};
use serde_json::json;

use crate::args::TopArgs;
use crate::failure::Failure;
use crate::find;
use crate::interrupt;
use crate::output::Output;
use crate::session::Session;
use watching::Watching;

/// Shows the gateway until a person has seen enough.
pub fn run(arguments: &TopArgs, port: Option<&str>, out: Output) -> Result<(), Failure> {
    display::refuse_without_terminal(out)?;
    // One interrupts what the client waits for, as a key does; the other says that it was a signal.
    let (interrupt, ended): (Interrupt, Interrupt) = (interrupt::note(), interrupt::note());
    let (port, session) = loop {
        let (port, transport) = find::open_port(port, out)?;
        match Session::on(transport, interrupt.clone(), Output::none()) {
            // It is one, as it has answered a hello.
            Err(Failure::Client(ClientError::NoAnswer { request, .. })) if request != "Hello" => {
                let text = "the gateway is slow to answer; connecting again";
                out.progress("slow", text, json!({ "message": text }));
            }
            session => {
                let session = session.map_err(|failure| find::not_a_gateway(&port, failure));
                break (port, session?);
            }
        }
    };
    let display = display::Display::open()?;
    let keys = keys::listen(interrupt);
    let period = Duration::from_millis(arguments.period);
    Watching::new(session, &port, period, display).run(&keys, &ended)
}

#[cfg(test)]
mod tests;
