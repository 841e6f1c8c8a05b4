//! Command, for the one peer that has taken it: a program of the server of its own. It sends what
//! the peer asks and nothing else: each of its setpoints ends when the peer said, and the gateway
//! hears of it no more often than the peer is heard.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::Duration;

use host_protocol::{Error, GatewayParameter, Value as Parameter, requests as ask};
use mgw_cli::programs;
use mgw_client::{Client, ClientError, Transport};
use serde_json::{Value, json};
use zenoh::query::Query;

use crate::command::{Deed, Lease, Word};
use crate::door::{refuse, reply};
use crate::keys::Keys;
use crate::leash::{Court, Leashed};
use crate::reach::Reach;
use crate::refusal::Refusal;

/// Orders that wait, at most.
const WAITING: usize = 64;
/// Between two looks at whether the peer is still there.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// An answer to a setpoint is awaited as long as it is valid, within these.
const SHORTEST: Duration = Duration::from_millis(50);
const LONGEST: Duration = Duration::from_secs(1);
/// Expiries beyond are no expiries: the wire carries the low 32 bits of the µs.
const FAR_US: u64 = 1 << 30;
/// Events taken in one round: nobody reads them here.
const EVENTS_AT_ONCE: usize = 64;

/// What the peer wants done, and where the answer goes.
type Order = (Deed, Query);

/// The way to what the peer commands with.
pub struct Hand {
    lease: Lease,
    orders: SyncSender<Order>,
    /// The peer has said that it is there: once or often, it is told to the gateway once.
    is_alive: Arc<AtomicBool>,
}

/// What is needed to command.
#[derive(Clone)]
pub struct Grip {
    /// The way to the gateway.
    pub reach: Reach,
    /// Who commands.
    pub court: Court,
    /// What the answers stand under.
    pub keys: Keys,
}

impl Hand {
    /// Commands for the peer that has just got this lease, in a thread of its own, until that is
    /// over. `query` is the one that asked for command.
    pub fn take(grip: Grip, lease: Lease, query: Query) -> Self {
        let (sender, orders) = sync_channel(WAITING);
        let is_alive = Arc::new(AtomicBool::new(false));
        let heard = is_alive.clone();
        thread::spawn(move || {
            command(&grip, lease, query, &orders, &heard);
            grip.court.authority().end(lease);
        });
        Self { lease, orders: sender, is_alive }
    }

    /// The peer of this lease is there.
    pub fn keep_alive(&self, lease: Lease) {
        if self.lease == lease {
            self.is_alive.store(true, Ordering::Relaxed);
        }
    }

    /// Passes on what the peer of this lease wants.
    ///
    /// # Errors
    /// Too much waits already, or the lease is over.
    pub fn order(&self, lease: Lease, deed: Deed, query: &Query) -> Result<(), Refusal> {
        if self.lease != lease {
            return Err(Refusal::LeaseOver);
        }
        self.orders.try_send((deed, query.clone())).map_err(|error| match error {
            TrySendError::Full(_) => Refusal::Busy { waiting: WAITING },
            TrySendError::Disconnected(_) => Refusal::LeaseOver,
        })
    }
}

type Connection = Client<Leashed<Box<dyn Transport + Send>>>;

/// Takes command and does what is ordered, until the lease is over.
fn command(
    grip: &Grip,
    lease: Lease,
    query: Query,
    orders: &Receiver<Order>,
    is_alive: &AtomicBool,
) {
    let connect = || {
        let leashed = Leashed::new(grip.reach.open()?, grip.court.clone(), lease);
        let mut client = Client::connect(leashed)?;
        client.take_authority()?;
        let silence = silence(&mut client)?;
        Ok((client, silence))
    };
    let (mut client, silence) = match connect() {
        Ok(connected) => connected,
        Err(error) => return refuse(&query, &programs::error(error)),
    };
    let now = grip.court.now();
    if !grip.court.authority().begin(now, lease, silence) {
        return refuse(&query, &Refusal::LeaseOver.to_json());
    }
    let taken = json!({
        "lease": lease.text(), "link_silence_us": silence.as_micros(),
        "time_us": client.gateway_now_us(),
    });
    reply(&query, &grip.keys.command(Word::Take), &taken);
    // Who asked waits until it is gone.
    drop(query);
    serve(grip, lease, &mut client, orders, is_alive);
}

/// How long the gateway listens for a host in command before it stops what that has armed.
fn silence(client: &mut Connection) -> Result<Duration, ClientError> {
    let parameter = GatewayParameter::LinkSilenceUs;
    let value = client.read_gateway_parameter(parameter)?.or(parameter.info().default);
    match value {
        Some(Parameter::Unsigned(us)) => Ok(Duration::from_micros(us.into())),
        _ => Err(Error::WrongType { parameter: parameter.number() }.into()),
    }
}

/// Until the lease is over, or the gateway cannot be reached.
fn serve(
    grip: &Grip,
    lease: Lease,
    client: &mut Connection,
    orders: &Receiver<Order>,
    is_alive: &AtomicBool,
) {
    while grip.court.may_send(lease) {
        let done = match orders.recv_timeout(LOOK_EVERY) {
            Ok((deed, query)) => obey(grip, lease, client, deed, &query),
            // Only now: what is asked waits for nothing, and reads as much by itself.
            Err(RecvTimeoutError::Timeout) => pass_events(client),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        // No oftener than the peer has said it.
        let kept = done.and_then(|()| match is_alive.swap(false, Ordering::Relaxed) {
            true => client.keep_alive(),
            false => Ok(()),
        });
        if kept.is_err() {
            return;
        }
    }
}

fn pass_events(client: &mut Connection) -> Result<(), ClientError> {
    for _ in 0..EVENTS_AT_ONCE {
        if client.poll_event(Duration::ZERO)?.is_none() {
            break;
        }
    }
    Ok(())
}

/// Does one thing and answers; an error ends the lease.
fn obey(
    grip: &Grip,
    lease: Lease,
    client: &mut Connection,
    deed: Deed,
    query: &Query,
) -> Result<(), ClientError> {
    if !grip.court.may_send(lease) {
        refuse(query, &Refusal::LeaseOver.to_json());
        return Ok(());
    }
    let (word, done) = match deed {
        Deed::Arm { axis } => (Word::Arm, arm(client, axis)),
        Deed::Set { axis, epoch, expires_at_us, setpoint } => {
            // What is said of the gateway's time is held against no older measure.
            client.refresh_clock()?;
            let now_us = client.gateway_now_us();
            if now_us.abs_diff(expires_at_us) > FAR_US {
                let why = format!(
                    "`setpoint`: `expires_at_us` is the gateway's time, which is {now_us}, and the \
                     axis's TTL at most, not {expires_at_us}"
                );
                refuse(query, &Refusal::Unreadable(why).to_json());
                return Ok(());
            }
            let left = Duration::from_micros(expires_at_us.saturating_sub(now_us));
            let (now_us, expires_at_us) = (low_bits(now_us), low_bits(expires_at_us));
            if left.is_zero() {
                // The gateway would say no other.
                let stale = Error::Stale { now_us, expires_at_us };
                refuse(query, &programs::error(stale.into()));
                return Ok(());
            }
            let request = ask::Setpoint { axis, epoch, expires_at_us, setpoint };
            let sent = client.request_within(&request, left.clamp(SHORTEST, LONGEST));
            (Word::Setpoint, sent.map(|_| done()))
        }
        Deed::Clear(target) => (Word::Clear, client.clear(target).map(|()| done())),
        Deed::Release => {
            let released = client.stop_armed().and_then(|()| client.release_authority());
            grip.court.authority().end(lease);
            (Word::Release, released.map(|()| done()))
        }
    };
    match done {
        Ok(value) => reply(query, &grip.keys.command(word), &value),
        Err(ClientError::Gateway(error)) => {
            refuse(query, &programs::error(error.into()));
            if has_lost_command(&error) {
                return Err(error.into());
            }
        }
        // Nothing left for a peer that is silent: that is the reason, not the line.
        Err(_) if !grip.court.may_send(lease) => refuse(query, &Refusal::LeaseOver.to_json()),
        // A setpoint without an answer in its time: the next may have one.
        Err(error @ ClientError::NoAnswer { .. }) => refuse(query, &programs::error(error)),
        Err(error) => {
            let broken = std::io::Error::from(std::io::ErrorKind::BrokenPipe);
            refuse(query, &programs::error(error));
            return Err(broken.into());
        }
    }
    Ok(())
}

/// Times on the wire are the low 32 bits of the µs.
#[allow(clippy::cast_possible_truncation)]
fn low_bits(time_us: u64) -> u32 {
    time_us as u32
}

fn done() -> Value {
    json!({ "done": true })
}

fn arm(client: &mut Connection, axis: u8) -> Result<Value, ClientError> {
    let ttl = client.axis_ttl(axis)?;
    let epoch = client.arm(axis)?.epoch;
    Ok(json!({ "axis": axis, "epoch": epoch, "ttl_us": ttl.as_micros() }))
}

/// Somebody else commands, or nobody: what this peer had armed has stopped.
fn has_lost_command(error: &Error) -> bool {
    use Error::{GatewayAway, NoSession, NobodyInCommand, NotInCommand};
    matches!(error, NotInCommand { .. } | NobodyInCommand {} | GatewayAway {} | NoSession {})
}
