//! Prints all that is published: of every gateway in the network, or under a key of its.
//!
//! ```text
//! cargo run -p mgw-zenoh --example watch -- tcp/192.168.1.2:7447 'motor-gateway/*/events'
//! ```

use std::process::ExitCode;

use mgw_zenoh::{Endpoints, ROOT, open};
use zenoh::Wait;

fn watch(endpoint: &str, key: &str) -> Result<(), String> {
    let endpoints = Endpoints { connect: vec![endpoint.to_owned()], ..Endpoints::default() };
    let session = open(&endpoints)?;
    let subscriber = session.declare_subscriber(key).wait().map_err(|error| error.to_string())?;
    while let Ok(sample) = subscriber.recv() {
        let payload = sample.payload().to_bytes();
        println!("{} {}", sample.key_expr(), String::from_utf8_lossy(&payload));
    }
    Ok(())
}

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let Some(endpoint) = arguments.next() else {
        eprintln!("usage: watch ENDPOINT [KEY]");
        return ExitCode::from(2);
    };
    let key = arguments.next().unwrap_or_else(|| format!("{ROOT}/**"));
    match watch(&endpoint, &key) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
