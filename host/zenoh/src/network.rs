//! The network: a zenoh session, and whether a name is free in it.

use std::path::PathBuf;
use std::time::Duration;

use serde_json::{Value, json};
use zenoh::{Config, Session, Wait};

use crate::keys::Keys;

/// A peer that cannot be heard for so long is gone, ms: what is cut off is missed by then.
const GONE_AFTER_MS: u64 = 3_000;
/// Batches that may wait on their way to each other program, of each priority: what finds no room
/// is dropped, so that nobody who reads slowly holds up others.
const BATCHES: u8 = 16;
/// How long others of a name are asked for.
const ASK_WITHIN: Duration = Duration::from_secs(1);

/// Where the network is.
#[derive(Debug, Clone, Default)]
pub struct Endpoints {
    /// Of others, such as `tcp/192.168.1.2:7447`.
    pub connect: Vec<String>,
    /// Of this program.
    pub listen: Vec<String>,
    /// Whether others are looked for by multicast.
    pub scout: bool,
    /// Whether it passes on what others say to each other.
    pub route: bool,
    /// A configuration of zenoh, for what has no option here.
    pub config: Option<PathBuf>,
}

/// Opens a session. What cannot be reached yet is tried again until it can.
///
/// # Errors
/// The configuration is wrong, or an endpoint cannot be listened on.
pub fn open(endpoints: &Endpoints) -> Result<Session, String> {
    let said = |error: zenoh::Error| error.to_string();
    let mut config = match &endpoints.config {
        Some(path) => Config::from_file(path).map_err(said)?,
        None => Config::default(),
    };
    let mut settings: Vec<(&str, Value)> = Vec::new();
    if endpoints.config.is_none() {
        settings.extend([
            ("mode", json!(if endpoints.route { "router" } else { "peer" })),
            ("scouting/multicast/enabled", json!(endpoints.scout)),
            ("transport/link/tx/lease", json!(GONE_AFTER_MS)),
            ("transport/link/tx/queue/size/interactive_high", json!(BATCHES)),
            ("transport/link/tx/queue/size/data", json!(BATCHES)),
            ("connect/retry", json!({ "period_init_ms": 100, "period_max_ms": 1_000 })),
            ("connect/endpoints", json!(endpoints.connect)),
            ("listen/endpoints", json!(endpoints.listen)),
        ]);
    } else {
        if !endpoints.connect.is_empty() {
            settings.push(("connect/endpoints", json!(endpoints.connect)));
        }
        if !endpoints.listen.is_empty() {
            settings.push(("listen/endpoints", json!(endpoints.listen)));
        }
    }
    for (key, value) in settings {
        let set = config.insert_json5(key, &value.to_string());
        set.map_err(|error| format!("{key} cannot be {value}: {error}"))?;
    }
    zenoh::open(config).wait().map_err(|error| format!("no network: {error}"))
}

/// Refuses a name that another gateway has.
///
/// # Errors
/// It has.
pub fn refuse_twin(session: &Session, keys: &Keys) -> Result<(), String> {
    let own = keys.alive(&session.zid().to_string());
    let asked = session.liveliness().get(keys.alive("*")).timeout(ASK_WITHIN).wait();
    let answers = asked.map_err(|error| format!("the network cannot be asked: {error}"))?;
    while let Ok(reply) = answers.recv() {
        if let Ok(sample) = reply.result()
            && sample.key_expr().as_str() != own
        {
            let (name, key) = (keys.name(), sample.key_expr());
            return Err(format!(
                "another gateway of this network is called {name} ({key}): give this one another \
                 name"
            ));
        }
    }
    Ok(())
}
