//! Command, for the one page that has taken it: a program of the server of its own. When the page
//! falls silent this program goes, and its axes stop as those of every program that goes.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use host_protocol::{AxisState, ClearTarget, Error, Event, Setpoint, StopTarget};
use mgw_client::{Client, ClientError, Hold, Round, Transport};
use mgw_view::Outbox;
use serde_json::{Value, json};

use super::ask::Ask;
use super::reach::Reach;
use crate::commands::ArmedAxis;
use crate::explain::with_page;
use crate::failure::Failure;
use crate::session::EVENTS_AT_ONCE;

/// A page in command that has said nothing for so long is taken for gone. It says something every
/// 100 ms.
pub const SILENT_AFTER: Duration = Duration::from_millis(500);
/// A jog that has not been repeated for so long has ended: its axis is stopped. The page repeats it
/// every 100 ms.
pub const JOG_FOR: Duration = Duration::from_millis(300);

/// When a page was heard last.
#[derive(Debug, Clone)]
pub struct Heard(Arc<Mutex<Instant>>);

impl Heard {
    /// Now.
    pub fn now() -> Self {
        Self(Arc::new(Mutex::new(Instant::now())))
    }

    /// Again.
    pub fn again(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    fn since(&self) -> Duration {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }
}

/// The way to a page's command, which ends when this is dropped.
pub struct Hand(Sender<(Instant, Ask)>);

impl Hand {
    /// Takes command for a page.
    pub fn take(reach: &Reach, outbox: &Outbox, heard: &Heard) -> Self {
        let (sender, orders) = channel();
        let (reach, outbox, heard) = (reach.clone(), outbox.clone(), heard.clone());
        thread::spawn(move || {
            let told = match command(&reach, &outbox, &heard, orders) {
                Ok(why) => told("free", why),
                Err(failure) => told("lost", &with_page(&failure)),
            };
            outbox.put_json(&told);
        });
        Self(sender)
    }

    /// Passes on what the page asks; whether there is still somebody.
    pub fn order(&self, ask: Ask) -> bool {
        self.0.send((Instant::now(), ask)).is_ok()
    }
}

fn told(state: &str, message: &str) -> Value {
    json!({ "event": "command", "state": state, "message": message })
}

/// What an armed axis does.
#[derive(Debug, Clone, Copy)]
struct Held {
    setpoint: Setpoint,
    /// A jog ends then.
    until: Option<Instant>,
}

/// Why the page no longer commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Gone,
    Silent,
}

struct Command<'a> {
    client: Client<Box<dyn Transport>>,
    outbox: &'a Outbox,
    armed: BTreeMap<u8, ArmedAxis>,
    held: BTreeMap<u8, Held>,
}

/// Commands until the page gives it back, is gone, or the gateway is. Says why it ended.
fn command(
    reach: &Reach,
    outbox: &Outbox,
    heard: &Heard,
    orders: Receiver<(Instant, Ask)>,
) -> Result<&'static str, Failure> {
    let mut client = Client::connect(reach.open()?)?;
    client.take_authority()?;
    outbox.put_json(&told("taken", "this page commands: arm an axis to move it"));
    let mut command = Command { client, outbox, armed: BTreeMap::new(), held: BTreeMap::new() };
    loop {
        match command.hold(heard, &orders)? {
            ControlFlow::Break(End::Gone) => return Ok("the page has gone"),
            ControlFlow::Break(End::Silent) => {
                return Ok("the page was silent for 0.5 s: what it had armed stops");
            }
            ControlFlow::Continue(asked) => {
                for (at, ask) in asked {
                    if ask == Ask::Release {
                        command.client.stop_armed()?;
                        command.client.release_authority()?;
                        return Ok("command is given back, what was armed is stopped");
                    }
                    command.obey(at, ask)?;
                }
            }
        }
    }
}

impl Command<'_> {
    /// Keeps what is in force until something is asked, a jog ends, or the page does.
    fn hold(
        &mut self,
        heard: &Heard,
        orders: &Receiver<(Instant, Ask)>,
    ) -> Result<ControlFlow<End, Vec<(Instant, Ask)>>, Failure> {
        let Self { client, outbox, armed, held } = self;
        let hold = |(axis, held): (&u8, &Held)| Some(armed.get(axis)?.hold(held.setpoint));
        let holds: Vec<Hold> = held.iter().filter_map(hold).collect();
        let (mut asked, mut end) = (Vec::new(), None);
        let kept = client.hold_setpoints(&holds, Duration::MAX, |client| -> Round {
            let lost = lost(client, armed, held)?;
            lost.iter().for_each(|axis| outbox.put_json(&disarmed(*axis)));
            loop {
                match orders.try_recv() {
                    Ok((at, ask)) if is_repeated(held, at, &ask) => {}
                    Ok(order) => asked.push(order),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        end = Some(End::Gone);
                        break;
                    }
                }
            }
            if end.is_none() && heard.since() > SILENT_AFTER {
                end = Some(End::Silent);
            }
            let now = Instant::now();
            let over = held.iter().filter(|(_, held)| held.until.is_some_and(|end| end < now));
            asked.extend(over.map(|(axis, _)| (now, Ask::Rest { axis: *axis })));
            let goes_on = end.is_none() && asked.is_empty() && lost.is_empty();
            Ok(if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) })
        });
        match (kept, end) {
            (_, Some(end)) => Ok(ControlFlow::Break(end)),
            (Ok(()), None) => Ok(ControlFlow::Continue(asked)),
            // A setpoint was refused: whatever it was of, all that was armed here stops.
            (Err(ClientError::Gateway(error)), None) if !has_lost_command(&error) => {
                self.tell_refused(&Failure::would_be_refused(error));
                self.stop_armed()?;
                Ok(ControlFlow::Continue(asked))
            }
            (Err(error), None) => Err(error.into()),
        }
    }

    /// Does what is asked; a refusal is told and ends nothing.
    fn obey(&mut self, at: Instant, ask: Ask) -> Result<(), Failure> {
        match self.try_to(at, ask) {
            Err(Failure::Client(ClientError::Gateway(error))) if !has_lost_command(&error) => {
                self.tell_refused(&Failure::would_be_refused(error));
                Ok(())
            }
            Err(failure @ Failure::Usage(_)) => {
                self.tell_refused(&failure);
                Ok(())
            }
            done => done,
        }
    }

    fn try_to(&mut self, at: Instant, ask: Ask) -> Result<(), Failure> {
        match ask {
            Ask::Arm { axis } => self.arm(axis),
            Ask::Clear { axis } => Ok(self.client.clear(ClearTarget::Axis(axis))?),
            Ask::Rest { axis } => self.rest(axis),
            Ask::Unreadable => self.stop_armed(),
            Ask::Jog { axis, .. } | Ask::Set { axis, .. } => {
                let setpoint = match ask.setpoint() {
                    Ok(Some((_, setpoint))) if self.armed.contains_key(&axis) => setpoint,
                    refused => {
                        let why = refused.err().unwrap_or_else(|| {
                            format!("axis {axis} is not armed by this page: arm it first")
                        });
                        self.tell_refused(&Failure::Usage(why));
                        return self.stop_armed();
                    }
                };
                let until = matches!(ask, Ask::Jog { .. }).then_some(at + JOG_FOR);
                // One that waited behind something else moves nothing any more.
                if until.is_none_or(|until| until > Instant::now()) {
                    self.held.insert(axis, Held { setpoint, until });
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Arming takes its time, in which nothing else is looked after: nothing moves meanwhile.
    fn arm(&mut self, axis: u8) -> Result<(), Failure> {
        if let Some(moving) = self.held.keys().next() {
            return Err(Failure::Usage(format!(
                "axis {moving} is moved by this page: arm axis {axis} before, or stop axis \
                 {moving} first"
            )));
        }
        let ttl = self.client.axis_ttl(axis)?;
        let epoch = self.client.arm(axis)?.epoch;
        self.armed.insert(axis, ArmedAxis { axis, epoch, ttl });
        self.outbox.put_json(&json!({ "event": "armed", "axis": axis, "epoch": epoch }));
        Ok(())
    }

    fn rest(&mut self, axis: u8) -> Result<(), Failure> {
        self.held.remove(&axis);
        if self.armed.remove(&axis).is_some() {
            self.client.stop(StopTarget::Axis(axis))?;
            self.outbox.put_json(&disarmed(axis));
        }
        Ok(())
    }

    fn stop_armed(&mut self) -> Result<(), Failure> {
        self.client.stop_armed()?;
        self.armed.keys().for_each(|axis| self.outbox.put_json(&disarmed(*axis)));
        self.armed.clear();
        self.held.clear();
        Ok(())
    }

    fn tell_refused(&self, failure: &Failure) {
        self.outbox.put_json(&json!({
            "event": "refused", "name": failure.name(), "message": with_page(failure),
        }));
    }
}

/// Somebody else commands, or nobody: what this page had armed has stopped.
fn has_lost_command(error: &Error) -> bool {
    use Error::{GatewayAway, NoSession, NobodyInCommand, NotInCommand};
    matches!(error, NotInCommand { .. } | NobodyInCommand {} | GatewayAway {} | NoSession {})
}

fn disarmed(axis: u8) -> Value {
    json!({ "event": "disarmed", "axis": axis })
}

/// Whether it repeats the jog under way, which then goes on.
fn is_repeated(held: &mut BTreeMap<u8, Held>, at: Instant, ask: &Ask) -> bool {
    let Ask::Jog { axis, .. } = *ask else { return false };
    let (Some(held), Ok(Some((_, setpoint)))) = (held.get_mut(&axis), ask.setpoint()) else {
        return false;
    };
    let repeats = held.until.is_some() && held.setpoint == setpoint;
    if repeats {
        held.until = Some(at + JOG_FOR);
    }
    repeats
}

/// The axes that somebody or something else has stopped; they are no longer held.
fn lost(
    client: &mut Client<Box<dyn Transport>>,
    armed: &mut BTreeMap<u8, ArmedAxis>,
    held: &mut BTreeMap<u8, Held>,
) -> Result<Vec<u8>, ClientError> {
    let mut lost = Vec::new();
    for _ in 0..EVENTS_AT_ONCE {
        let Some(message) = client.poll_event(Duration::ZERO)? else { break };
        let axis = match message.event {
            Event::StateChanged { state: AxisState::Armed | AxisState::Active, .. } => continue,
            Event::StateChanged { state: AxisState::Arming, .. } => continue,
            Event::Tripped { axis, .. } | Event::StateChanged { axis, .. } => axis,
            _ => continue,
        };
        if armed.remove(&axis).is_some() {
            held.remove(&axis);
            lost.push(axis);
        }
    }
    Ok(lost)
}
