//! One session with one gateway.
//!
//! Nothing here sends by itself: what a program does not say again expires in the gateway, whatever
//! becomes of the program. Every call waits without the interpreter's lock. Here is whose turn it is
//! and what ends it; what a program may ask is in `session/methods.rs`.

mod methods;

use std::process;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use host_protocol::StopTarget;
use mgw_cli::programs::Motors;
use mgw_client::{Client, ClientError, Transport};
use parking_lot::{Mutex, MutexGuard};
use pyo3::prelude::*;
use serde_json::Value;

use crate::carrier::{Carrier, LOOK_EVERY, Signals};
use crate::json::to_python;
use crate::problem::{Failed, found, of_stop, usage};

/// How long a wait for an event keeps the calls of other threads waiting.
const TURN: Duration = Duration::from_millis(1);
/// No thread.
const NOBODY: u64 = 0;
/// No turn.
const NO_TURN: u64 = 0;
/// What a signal handler may ask for in the middle of a call; the greater goes before the less.
const ASKED_NOTHING: u8 = 0;
const ASKED_STOP: u8 = 1;
const ASKED_E_STOP: u8 = 2;

type Inner = Client<Carrier>;

/// A session. Any thread may call; one call is under way at a time.
#[pyclass(frozen, module = "motor_gateway._native")]
pub struct Session {
    client: Mutex<Option<Inner>>,
    signals: Arc<Signals>,
    motors: Mutex<Motors>,
    /// The process that opened it: no other may use its connection.
    process: u32,
    /// The thread whose call is under way.
    owner: AtomicU64,
    /// That call may last: a stop does not wait for it.
    lasts: AtomicBool,
    /// It is a hold.
    holds: AtomicBool,
    /// The number that a program has given what it does now, and that of what is to hold no more.
    turn: AtomicU64,
    ended_turn: AtomicU64,
    closed: AtomicBool,
    /// What a signal handler has asked for in the call under way.
    asked: AtomicU8,
    /// The stops of one axis that wait for a call; a hold sends them.
    stops: Mutex<Vec<Arc<AxisStop>>>,
}

/// The stop of one axis, and what came of it once it has been sent.
struct AxisStop {
    axis: u8,
    outcome: Mutex<Option<Result<(), ClientError>>>,
}

impl Session {
    /// Says hello on a transport.
    pub fn open(py: Python<'_>, transport: Box<dyn Transport + Send>) -> PyResult<Self> {
        let signals = Arc::new(Signals::default());
        let heeded = signals.interrupt.clone();
        let mut carrier = Carrier::new(transport, signals.clone());
        carrier.begin(is_main_thread(py)?);
        let opened = py.detach(|| -> Result<_, ClientError> {
            let mut client = Client::connect_heeding(carrier, heeded)?;
            let motors = Motors::new(&client.list_axes()?);
            Ok((client, motors))
        });
        if let Some(error) = signals.take() {
            return Err(error);
        }
        let (client, motors) = opened.map_err(Failed::from)?;
        Ok(Self {
            client: Mutex::new(Some(client)),
            signals,
            motors: Mutex::new(motors),
            process: process::id(),
            owner: AtomicU64::new(NOBODY),
            lasts: AtomicBool::new(false),
            holds: AtomicBool::new(false),
            turn: AtomicU64::new(NO_TURN),
            ended_turn: AtomicU64::new(NO_TURN),
            closed: AtomicBool::new(false),
            asked: AtomicU8::new(ASKED_NOTHING),
            stops: Mutex::default(),
        })
    }

    /// Does something with the client, when no other call does.
    fn run<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut Inner) -> Result<R, Failed> + Send,
    ) -> PyResult<R> {
        self.run_when(py, false, act)
    }

    /// The same; what `is_urgent` ends a call that may last.
    fn run_when<R: Send>(
        &self,
        py: Python<'_>,
        is_urgent: bool,
        act: impl FnOnce(&mut Inner) -> Result<R, Failed> + Send,
    ) -> PyResult<R> {
        self.check_process()?;
        let looks = is_main_thread(py)?;
        let done = py.detach(|| {
            let mut client = self.lock(looks, is_urgent)?;
            self.done(&mut client, looks, true, act)
        });
        Ok(done?)
    }

    /// As `run`, again and again in short turns, so that other threads have theirs, until there is
    /// something or the time is over.
    fn await_one<R: Send>(
        &self,
        py: Python<'_>,
        timeout_s: f64,
        mut act: impl FnMut(&mut Inner, Duration) -> Result<Option<R>, ClientError> + Send,
    ) -> PyResult<Option<R>> {
        self.check_process()?;
        let (looks, timeout) = (is_main_thread(py)?, seconds(timeout_s)?);
        let mut looked = Instant::now();
        let found = py.detach(move || {
            let mut end = None;
            loop {
                let mut client = self.lock(looks, false)?;
                let turn = self.done(&mut client, looks, false, |client| {
                    let end = *end.get_or_insert(client.now().saturating_add(timeout));
                    let left = end.saturating_sub(client.now());
                    let one = act(client, left.min(TURN))?;
                    let is_over = one.is_some() || client.now() >= end;
                    Ok(is_over.then_some(one))
                });
                let turn = match turn {
                    // Of a stop, which has been followed: who only listens goes on.
                    Err(Failed::Interrupted) if !self.closed.load(Ordering::Acquire) => None,
                    turn => turn?,
                };
                MutexGuard::unlock_fair(client);
                if let Some(one) = turn {
                    return Ok::<_, Failed>(one);
                }
                if looks && looked.elapsed() >= LOOK_EVERY {
                    looked = Instant::now();
                    if let Err(error) = Python::attach(|py| py.check_signals()) {
                        // As within any call: what is armed is stopped before it is told.
                        self.signals.interrupt.raise();
                        let mut client = self.lock(false, false)?;
                        self.done(&mut client, false, false, |client| Ok(client.resume()?))?;
                        return Err(error.into());
                    }
                }
            }
        });
        Ok(found?)
    }

    /// Carries a call out, and what ends it.
    fn done<R>(
        &self,
        client: &mut Option<Inner>,
        looks: bool,
        lasts: bool,
        act: impl FnOnce(&mut Inner) -> Result<R, Failed>,
    ) -> Result<R, Failed> {
        let Some(inner) = client.as_mut().filter(|_| !self.closed.load(Ordering::Acquire)) else {
            return Err(closed());
        };
        self.lasts.store(lasts, Ordering::Release);
        self.owner.store(this_thread(), Ordering::Release);
        inner.transport_mut().begin(looks);
        let result = act(inner);
        let raised = self.signals.take();
        let is_ended = raised.is_some() || matches!(result, Err(Failed::Interrupted));
        let stopped = self.stop_what_was_asked(inner, is_ended);
        // Until here: a signal handler that comes meanwhile must not wait for this call.
        self.owner.store(NOBODY, Ordering::Release);
        self.lasts.store(false, Ordering::Release);
        stopped.map_err(of_stop)?;
        raised.map_or(result, |error| Err(Failed::Raised(error)))
    }

    /// Stops what a call that has ended early had armed, and whatever signal handlers asked for
    /// meanwhile.
    fn stop_what_was_asked(&self, inner: &mut Inner, is_ended: bool) -> Result<(), ClientError> {
        if self.closed.load(Ordering::Acquire) {
            // A signal handler has closed it in the middle of this call, or another thread is about
            // to, which waits.
            let _ = inner.stop_armed();
        } else if is_ended {
            inner.resume()?;
        }
        stop_all(inner, self.asked.swap(ASKED_NOTHING, Ordering::AcqRel))
    }

    /// The client, when no other call uses it; one that may last is ended if it `is_urgent`.
    fn lock(&self, looks: bool, is_urgent: bool) -> Result<MutexGuard<'_, Option<Inner>>, Failed> {
        if let Some(guard) = self.client.try_lock() {
            return Ok(guard);
        }
        self.refuse_reentry()?;
        loop {
            if is_urgent && self.lasts.load(Ordering::Acquire) {
                self.signals.interrupt.raise();
            }
            // Much longer than a turn of who listens, at whose end it is handed over.
            if let Some(guard) = self.client.try_lock_for(LOOK_EVERY) {
                return Ok(guard);
            }
            if looks {
                Python::attach(|py| py.check_signals())?;
            }
        }
    }

    fn refuse_reentry(&self) -> Result<(), Failed> {
        if self.owner.load(Ordering::Acquire) != this_thread() {
            return Ok(());
        }
        let text = "a signal handler cannot use the session whose call it interrupts; only \
            stop(), estop() and close() work there";
        Err(found("Reentered", text))
    }

    /// Sends a stop, unless a hold of another thread does.
    fn send(&self, stop: &AxisStop, looks: bool) -> Result<(), Failed> {
        self.refuse_reentry()?;
        loop {
            let client = self.client.try_lock_for(LOOK_EVERY);
            if let Some(outcome) = stop.outcome.lock().take() {
                return outcome.map_err(of_stop);
            }
            if let Some(mut client) = client {
                let target = StopTarget::Axis(stop.axis);
                return self
                    .done(&mut client, looks, true, |client| client.stop(target).map_err(of_stop));
            }
            if looks {
                Python::attach(|py| py.check_signals())?;
            }
        }
    }

    /// Sends the stops that wait.
    fn send_waiting(&self, client: &mut Inner) {
        let waiting = std::mem::take(&mut *self.stops.lock());
        for stop in waiting {
            let outcome = client.stop(StopTarget::Axis(stop.axis));
            // An interrupt ends the hold, and who waits sends it.
            if !matches!(outcome, Err(ClientError::Interrupted { .. })) {
                *stop.outcome.lock() = Some(outcome);
            }
        }
    }

    /// A stop of everything: it waits for no other call, but ends the one under way, unless that
    /// only listens.
    fn stop_now(&self, py: Python<'_>, asked: u8) -> PyResult<()> {
        self.check_process()?;
        if self.owner.load(Ordering::Acquire) == this_thread() {
            // In a signal handler: the call under way stops what is armed when this returns, and
            // then does what was asked for.
            self.asked.fetch_max(asked, Ordering::AcqRel);
            self.signals.interrupt.raise();
            return Ok(());
        }
        self.run_when(py, true, |client| stop_all(client, asked).map_err(of_stop))
    }

    fn check_process(&self) -> PyResult<()> {
        if self.process == process::id() {
            return Ok(());
        }
        let text = "this session belongs to the process that opened it; open one of your own after \
            a fork";
        Err(found("Forked", text).into())
    }

    fn json<'py>(
        &self,
        py: Python<'py>,
        act: impl FnOnce(&mut Inner, &Motors) -> Result<Value, Failed> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let motors = *self.motors.lock();
        let value = self.run(py, |client| act(client, &motors))?;
        to_python(py, &value)
    }
}

/// Stops everything, as it was asked for, behind what the session has armed itself.
fn stop_all(client: &mut Inner, asked: u8) -> Result<(), ClientError> {
    if asked == ASKED_NOTHING {
        return Ok(());
    }
    client.resume()?;
    if asked == ASKED_E_STOP { client.estop() } else { client.stop(StopTarget::All) }
}

impl Drop for Session {
    fn drop(&mut self) {
        let Some(mut client) = self.client.get_mut().take() else { return };
        if self.process != process::id() {
            // The connection is that of the process before the fork: not a byte, not even its end.
            std::mem::forget(client);
            return;
        }
        self.signals.interrupt.raise();
        client.transport_mut().begin(false);
        // The last reference is gone, so there is nobody to tell.
        Python::attach(|py| py.detach(|| drop(client.stop_armed())));
    }
}

fn closed() -> Failed {
    found("Closed", "this session is closed; connect again")
}

/// A time from a program, s.
pub fn seconds(value: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(value)
        .map_err(|_| usage(&format!("a time is a number of seconds from 0 on, not {value}")))
}

fn this_thread() -> u64 {
    thread_local!(static NUMBER: u64 = {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        NEXT.fetch_add(1, Ordering::Relaxed)
    });
    NUMBER.with(|number| *number)
}

/// Only the main thread of Python runs signal handlers.
fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    thread_local!(static IS_MAIN: std::cell::Cell<Option<bool>> = const { std::cell::Cell::new(None) });
    if let Some(is_main) = IS_MAIN.get() {
        return Ok(is_main);
    }
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    let is_main = main.eq(threading.call_method0("get_ident")?)?;
    IS_MAIN.set(Some(is_main));
    Ok(is_main)
}
