//! Latency and rate of commanding and watching gateways: over the network, or by the plain client.
//! `.ci/zenoh measure` runs it.
//!
//! ```text
//! measure plain SECONDS PORT
//! measure zenoh SECONDS NAME=ENDPOINT…
//! ```

use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::{Event, Setpoint, StateField, StateFields, StopTarget};
use mgw_client::{Client, open};
use mgw_zenoh::{Commander, Endpoints};
use serde_json::Value;
use zenoh::{Session, Wait};

const SETPOINT: Setpoint = Setpoint::Velocity { velocity_rad_s: 1.0 };
/// Between two samples of an axis.
const PERIOD: Duration = Duration::from_millis(20);
/// Exchanges that tell what the way alone takes.
const EMPTY: usize = 500;

type Failure = Box<dyn std::error::Error>;

/// What something took, each time.
#[derive(Default)]
struct Times(Vec<Duration>);

impl Times {
    fn take<R>(&mut self, act: impl FnOnce() -> R) -> R {
        let start = Instant::now();
        let result = act();
        self.0.push(start.elapsed());
        result
    }

    fn line(&mut self, what: &str, over: Duration) {
        self.0.sort_unstable();
        let count = self.0.len();
        let at = |part: usize| self.0.get((count * part / 1_000).min(count.saturating_sub(1)));
        let us = |time: Option<&Duration>| time.map_or(0, Duration::as_micros);
        let rate = f64::from(u32::try_from(count).unwrap_or(u32::MAX)) / over.as_secs_f64();
        println!(
            "| {what} | {} | {} | {} | {rate:.0} |",
            us(at(500)),
            us(at(990)),
            us(self.0.last())
        );
    }
}

/// All of one gateway.
#[derive(Default)]
struct Measured {
    setpoints: Times,
    empty: Times,
    samples: Times,
}

impl Measured {
    fn add(&mut self, other: Self) {
        self.setpoints.0.extend(other.setpoints.0);
        self.empty.0.extend(other.empty.0);
        self.samples.0.extend(other.samples.0);
    }

    fn print(mut self, of: &str, time: Duration) {
        println!("| {of} | p50 µs | p99 µs | max µs | per second |\n|---|---|---|---|---|");
        self.setpoints.line("setpoint and its answer", time);
        let alone: Duration = self.empty.0.iter().sum();
        self.empty.line("nothing and its answer", alone);
        self.samples.line("age of a sample when it comes", time);
    }
}

/// By the plain client, one request after the other.
fn plain(port: &str, time: Duration) -> Result<Measured, Failure> {
    let mut measured = Measured::default();
    let mut client = Client::connect(open(port)?)?;
    for _ in 0..EMPTY {
        measured.empty.take(|| client.ping())?;
    }
    // Who watches is another program.
    let axes: Vec<u8> = client.list_axes()?.iter().map(|axis| axis.axis).collect();
    let watched = port.to_owned();
    let watcher = thread::spawn(move || -> Result<Times, String> {
        let said = |error: mgw_client::ClientError| error.to_string();
        let mut client = Client::connect(open(&watched).map_err(|error| error.to_string())?);
        let client = client.as_mut().map_err(|error| error.to_string())?;
        client.subscribe(&axes, StateFields::of(StateField::ALL), PERIOD).map_err(said)?;
        let (mut ages, end) = (Times::default(), Instant::now() + time);
        while Instant::now() < end {
            client.keep_subscription().map_err(said)?;
            let Some(message) = client.poll_event(PERIOD).map_err(said)? else { continue };
            if matches!(message.event, Event::Sample { .. }) {
                let age = client.gateway_now_us().saturating_sub(message.time_us);
                ages.0.push(Duration::from_micros(age));
            }
        }
        Ok(ages)
    });
    // Less than is allowed: what the gateway's clock shows is a guess.
    let (epoch, ttl) = (client.arm(0)?.epoch, client.axis_ttl(0)? / 2);
    let end = Instant::now() + time;
    while Instant::now() < end {
        measured.setpoints.take(|| client.set(0, epoch, SETPOINT, ttl))?;
    }
    client.stop(StopTarget::Axis(0))?;
    measured.samples = watcher.join().map_err(|_| "the watcher has panicked")??;
    Ok(measured)
}

/// Over the network, one request after the other.
fn over_zenoh(session: &Session, name: &str, time: Duration) -> Result<Measured, Failure> {
    let mut measured = Measured::default();
    let mut commander = Commander::take(session, name, "measure")?;
    for _ in 0..EMPTY {
        measured.empty.take(|| commander.keep_alive())?;
    }
    let armed = commander.arm(0)?;
    let now = Arc::new(Mutex::new((Instant::now(), commander.gateway_now_us())));
    let ages = Arc::new(Mutex::new(Times::default()));
    let (clock, kept) = (now.clone(), ages.clone());
    let samples = format!("motor-gateway/{name}/samples/axis/*");
    let subscriber = session.declare_subscriber(samples).callback(move |sample| {
        let value: Value = serde_json::from_slice(&sample.payload().to_bytes()).unwrap_or_default();
        let (Ok(clock), Ok(mut kept)) = (clock.lock(), kept.lock()) else { return };
        let now = u128::from(clock.1) + clock.0.elapsed().as_micros();
        let age = now.saturating_sub(value["time_us"].as_u64().unwrap_or(0).into());
        kept.0.push(Duration::from_micros(u64::try_from(age).unwrap_or(u64::MAX)));
    });
    let subscriber = subscriber.wait().map_err(|error| error.to_string())?;
    let end = Instant::now() + time;
    while Instant::now() < end {
        let sent = || commander.set(0, armed.epoch, SETPOINT, armed.ttl / 2);
        measured.setpoints.take(sent)?;
    }
    drop(subscriber);
    commander.release()?;
    measured.samples = std::mem::take(&mut *ages.lock().map_err(|_| "a callback has panicked")?);
    Ok(measured)
}

fn run(arguments: &[String]) -> Result<(), Failure> {
    let usage = "usage: measure plain SECONDS PORT, measure zenoh SECONDS NAME=ENDPOINT…";
    let [kind, seconds, places @ ..] = arguments else { return Err(usage.into()) };
    let time = Duration::from_secs(seconds.parse()?);
    match (kind.as_str(), places) {
        ("plain", [port]) => plain(port, time)?.print(port, time),
        ("zenoh", [_, ..]) => {
            let gateways: Vec<(&str, &str)> =
                places.iter().filter_map(|place| place.split_once('=')).collect();
            let connect = gateways.iter().map(|(_, endpoint)| (*endpoint).to_owned()).collect();
            let session = mgw_zenoh::open(&Endpoints { connect, ..Endpoints::default() })?;
            let all = thread::scope(|scope| -> Result<Measured, Failure> {
                let one = |name: &str| over_zenoh(&session, name, time).map_err(|e| e.to_string());
                let threads: Vec<_> =
                    gateways.iter().map(|(name, _)| scope.spawn(move || one(name))).collect();
                let mut all = Measured::default();
                for thread in threads {
                    all.add(thread.join().map_err(|_| "a thread has panicked")??);
                }
                Ok(all)
            })?;
            all.print(&format!("{} gateways, together", gateways.len()), time);
        }
        _ => return Err(usage.into()),
    }
    Ok(())
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
