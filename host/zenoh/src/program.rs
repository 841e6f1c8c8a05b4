//! `mgw-zenoh`: its parts, put together.

use std::io::Write;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::mpsc::sync_channel;
use std::time::Duration;

use clap::Parser;
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

use crate::args::Args;
use crate::brake::Brake;
use crate::clock::GatewayTime;
use crate::door::{Door, WAITING};
use crate::eye::Sight;
use crate::hand::Grip;
use crate::keys::Keys;
use crate::leash::Court;
use crate::network::{self, Endpoints};
use crate::reach::Reach;

/// Runs the program with the arguments of this process.
pub fn main() -> ExitCode {
    let args = Args::parse();
    match run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            log(&why);
            ExitCode::FAILURE
        }
    }
}

/// Nobody may read it: that is no reason to end.
fn tell(mut to: impl Write, line: std::fmt::Arguments<'_>) {
    let _ = writeln!(to, "{line}");
}

fn log(line: &str) {
    tell(std::io::stderr(), format_args!("mgw-zenoh: {line}"));
}

/// Serves until the process is ended. What is armed then stops, as that of every host that ends.
fn run(args: Args) -> Result<(), String> {
    let Args { name, serve, port, connect, listen, scout, route, config, period } = args;
    if connect.is_empty() && listen.is_empty() && !scout && config.is_none() {
        return Err("nobody can reach this: give --connect, --listen or --scout, such as \
                    --listen tcp/127.0.0.1:7447"
            .to_owned());
    }
    let reach = Reach::new(serve.as_deref(), port.as_deref(), log)?;
    let endpoints = Endpoints { connect, listen, scout, route, config };
    let session = network::open(&endpoints)?;
    let keys = Keys::new(&name);

    // Looked for before it is told of this one, so that one that is there is not disturbed; and
    // again after, so that of two that start at the same time at least one sees the other.
    network::refuse_twin(&session, &keys)?;
    let alive = session.liveliness().declare_token(keys.alive(&session.zid().to_string()));
    let _alive = alive.wait().map_err(said)?;
    network::refuse_twin(&session, &keys)?;

    let court = Court::default();
    attend(&session, &keys, &court)?;
    let (states, queries) = sync_channel(WAITING);
    let time = GatewayTime::default();
    let grip = Grip { reach: reach.clone(), court, keys: keys.clone() };
    let hand = Mutex::new(None);
    let door = Door { grip, time: time.clone(), states, brake: Brake::default(), hand };
    let declared = session.declare_queryable(keys.all()).callback(move |query| door.let_in(query));
    declared.background().wait().map_err(said)?;

    let sight =
        Sight { reach, session, keys, period: Duration::from_millis(period), time, queries };
    sight.watch(|found| match found {
        Ok(board) => tell(std::io::stdout(), format_args!("{name} is in the network: {board}")),
        Err(why) => log(&format!("the gateway is away: {why}")),
    });
    Ok(())
}

/// Sees peers and gateways of the same name come and go.
fn attend(session: &Session, keys: &Keys, court: &Court) -> Result<(), String> {
    let last = |key: &str| key.rsplit('/').next().unwrap_or_default().to_owned();
    let (own, watching) = (session.zid().to_string(), court.clone());
    let twins = session.liveliness().declare_subscriber(keys.alive("*")).history(true);
    let twins = twins.callback(move |sample| {
        let id = last(sample.key_expr().as_str());
        let is_there = sample.kind() == SampleKind::Put;
        if id != own {
            let what = if is_there { "is there, nothing moves" } else { "has gone" };
            log(&format!("another gateway of this name {what}: {id}"));
            watching.authority().twin(&id, is_there);
        }
    });
    twins.background().wait().map_err(said)?;
    let watching = court.clone();
    let peers = session.liveliness().declare_subscriber(keys.peer("*")).history(true);
    let peers = peers.callback(move |sample| {
        let peer = last(sample.key_expr().as_str());
        match sample.kind() {
            SampleKind::Put => watching.authority().arrived(&peer),
            SampleKind::Delete => watching.authority().left(&peer),
        }
    });
    peers.background().wait().map_err(said)
}

fn said(error: zenoh::Error) -> String {
    error.to_string()
}
