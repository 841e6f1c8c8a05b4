//! What the programs do that are killed: each is a process.

use std::error::Error;
use std::io::{Read, Write};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{
    AxisParameter, AxisState, AxisSummary, Call, ClearTarget, Kind as FrameKind, MAX_FRAME,
    Setpoint, StateField, StateFields, Value, encode, requests,
};
use mgw_client::{Client, ClientError, Transport, open, open_halves};

/// The axis that is moved.
pub const AXIS: u8 = 0;
/// The axis that stays at rest; numbers are written into its configuration.
pub const COUNTED_AXIS: u8 = 3;
/// The first of them.
pub const FIRST: u32 = 100_000;
/// Setpoints live longer than the silence of their host.
pub const TTL: Duration = Duration::from_secs(2);
/// Between two setpoints.
const SETPOINT_EVERY: Duration = Duration::from_millis(20);
/// A number is written with one of so many setpoints.
const NUMBER_EVERY: u32 = 5;
/// An arming lasts for so many setpoints.
const SETPOINTS: u32 = 250;
/// What is planted where a number counts as acknowledged that was never written.
const PLANTED: u32 = 10;

/// What a program does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Commands,
    Watches,
    DoesNotRead,
    Floods,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Commands, Self::Watches, Self::DoesNotRead, Self::Floods];

    pub fn name(self) -> &'static str {
        match self {
            Self::Commands => "commands",
            Self::Watches => "watches",
            Self::DoesNotRead => "does-not-read",
            Self::Floods => "floods",
        }
    }
}

type Session = Client<Box<dyn Transport + Send>>;

/// Goes on until it is killed. `number`: the first one to write; a plus behind it plants a lie.
pub fn run(kind: &str, port: &str, number: &str) -> Result<(), Box<dyn Error>> {
    let kind = Kind::ALL.into_iter().find(|known| known.name() == kind).ok_or("no such program")?;
    let lie = if number.ends_with('+') { PLANTED } else { 0 };
    let mut number: u32 = number.trim_end_matches('+').parse()?;
    loop {
        // It ends with the cable; then it begins anew.
        let _ = match kind {
            Kind::Commands => command(port, &mut number, lie),
            Kind::Watches => watch(port),
            Kind::DoesNotRead => read_nothing(port),
            Kind::Floods => flood(port),
        };
        thread::sleep(Duration::from_millis(50));
    }
}

/// Says something to who has started it.
fn say(text: &str) {
    // Who has started it may have gone.
    if writeln!(std::io::stdout(), "{text}").is_err() {
        std::process::exit(0);
    }
}

fn connect(port: &str) -> Result<Session, Box<dyn Error>> {
    Ok(Client::connect(open(port)?)?)
}

/// Nothing where the gateway refuses.
fn unless_refused<T>(result: Result<T, ClientError>) -> Result<Option<T>, ClientError> {
    match result {
        Err(ClientError::Gateway(_)) => Ok(None),
        other => other.map(Some),
    }
}

fn command(port: &str, number: &mut u32, lie: u32) -> Result<(), Box<dyn Error>> {
    let mut client = connect(port)?;
    loop {
        let axes = client.list_axes()?;
        let is_tripped = |axis: &AxisSummary| {
            axis.axis == AXIS && matches!(axis.state, AxisState::Tripped { .. })
        };
        if axes.iter().any(is_tripped) {
            unless_refused(client.clear(ClearTarget::Axis(AXIS)))?;
        }
        let Some(armed) = unless_refused(client.arm(AXIS))? else {
            thread::sleep(SETPOINT_EVERY);
            continue;
        };
        for count in 0..SETPOINTS {
            let turning = Setpoint::Velocity { velocity_rad_s: 2.0 };
            if unless_refused(client.set(AXIS, armed.epoch, turning, TTL - SETPOINT_EVERY))?
                .is_none()
            {
                break;
            }
            if count % NUMBER_EVERY == 0 {
                let value = Value::Unsigned(*number);
                client.configure_axis(COUNTED_AXIS, AxisParameter::TtlUs, value)?;
                say(&format!("set {}", *number + lie));
                *number += 1;
            }
            say("served");
            while client.poll_event(Duration::ZERO)?.is_some() {}
            thread::sleep(SETPOINT_EVERY);
        }
        unless_refused(client.disarm(AXIS))?;
    }
}

fn watch(port: &str) -> Result<(), Box<dyn Error>> {
    let mut client = connect(port)?;
    let fields = StateFields::of(&[StateField::Position, StateField::Velocity]);
    client.subscribe(&[AXIS], fields, Duration::from_millis(50))?;
    let mut looked = Instant::now();
    loop {
        client.poll_event(Duration::from_millis(100))?;
        client.keep_subscription()?;
        if looked.elapsed() >= Duration::from_millis(500) {
            client.list_axes()?;
            say("served");
            looked = Instant::now();
        }
        if client.losses().events_lost > 0 {
            say(&format!("lost {} events without a word", client.losses().events_lost));
        }
    }
}

/// It wants to know everything, keeps the wish alive, and does not listen.
fn read_nothing(port: &str) -> Result<(), Box<dyn Error>> {
    let mut client = connect(port)?;
    client.subscribe(&[AXIS], StateFields::of(StateField::ALL), Duration::from_millis(1))?;
    let mut sequence = 40_000_u16;
    loop {
        thread::sleep(Duration::from_secs(1));
        client.transport_mut().send(&frame(sequence, &requests::Ping {}))?;
        sequence = sequence.wrapping_add(1);
    }
}

/// It asks as fast as it can.
fn flood(port: &str) -> Result<(), Box<dyn Error>> {
    drop(connect(port)?);
    let halves = open_halves(port)?;
    let (mut reader, mut writer) = (halves.reader, halves.writer);
    thread::spawn(move || while matches!(reader.read(&mut [0; 65_536]), Ok(1..)) {});
    let mut sequence = 0_u16;
    loop {
        let mut asks = Vec::new();
        for _ in 0..20 {
            asks.extend(frame(sequence, &requests::ReadState { axis: AXIS }));
            sequence = sequence.wrapping_add(1);
        }
        writer.write_all(&asks)?;
    }
}

fn frame<C: Call>(sequence: u16, request: &C) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = encode(FrameKind::Request, sequence, C::NUMBER, request, &mut out).unwrap_or(0);
    out.get(..length).unwrap_or_default().to_vec()
}
