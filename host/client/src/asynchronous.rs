//! [`AsyncClient`]: the client for programs that await, on any executor.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use futures_channel::oneshot;
use host_protocol::replies::{Armed, AxisReport, HelloReply};
use host_protocol::{CycleState, EventMessage, Setpoint, StateFields, StopTarget};

use crate::client::Client;
use crate::cycle::AxisSetpoint;
use crate::error::ClientError;
use crate::interrupt::Interrupt;
use crate::port::open;
use crate::transport::Transport;

/// How long a wait for an event keeps requests waiting.
const EVENT_TURN: Duration = Duration::from_millis(1);
/// Between two looks at the interrupt while nobody asks for anything.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// The client behind it.
pub type Inner = Client<Box<dyn Transport>>;

type Task = Box<dyn FnOnce(&mut Inner) + Send>;

/// A [`Client`] on a thread of its own, which takes requests in turn: each method is that of
/// [`Client`], and [`with`](Self::with) reaches all others. A future that is dropped takes nothing
/// back: what was asked for is done.
///
/// A request waits for those before it, a stop too. [`interrupt`](Self::interrupt) does not: what
/// is armed here is then stopped before anything else is written.
#[derive(Debug)]
pub struct AsyncClient {
    tasks: Sender<Task>,
    hello: HelloReply,
    interrupt: Interrupt,
}

impl AsyncClient {
    /// Opens the port of that name, as [`open`], and a session, as [`Client::connect`].
    ///
    /// # Errors
    /// As there.
    pub async fn open(port: &str) -> Result<Self, ClientError> {
        let port = port.to_owned();
        Self::connect(move || Ok(open(&port)?)).await
    }

    /// Opens a session on a transport that is made on the client's thread, and stays there.
    ///
    /// # Errors
    /// Those of `make`, else as [`Client::connect`].
    pub async fn connect(
        make: impl FnOnce() -> Result<Box<dyn Transport>, ClientError> + Send + 'static,
    ) -> Result<Self, ClientError> {
        let (tasks, to_do) = mpsc::channel();
        let (connected, hello) = oneshot::channel();
        let interrupt = Interrupt::default();
        let heeded = interrupt.clone();
        thread::Builder::new().name("mgw client".to_owned()).spawn(move || {
            let client = make().and_then(|transport| Client::connect_heeding(transport, heeded));
            serve(client, connected, &to_do);
        })?;
        let hello = hello.await.unwrap_or_else(|_| Err(ended()))?;
        Ok(Self { tasks, hello, interrupt })
    }

    /// Does what `act` does with the client, in its turn.
    ///
    /// # Errors
    /// Those of `act`, and [`ClientError::Transport`] if the client's thread has ended, as it does
    /// when such a function panics.
    pub async fn with<R: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Inner) -> Result<R, ClientError> + Send + 'static,
    ) -> Result<R, ClientError> {
        let (done, result) = oneshot::channel();
        let task: Task = Box::new(move |client| drop(done.send(act(client))));
        self.tasks.send(task).map_err(|_| ended())?;
        result.await.unwrap_or_else(|_| Err(ended()))
    }

    /// What the gateway said of itself.
    pub fn hello(&self) -> &HelloReply {
        &self.hello
    }

    /// What ends all that this client does, from any thread; see [`Client::connect_heeding`].
    pub fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// See [`Client::arm`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn arm(&self, axis: u8) -> Result<Armed, ClientError> {
        self.with(move |client| client.arm(axis)).await
    }

    /// See [`Client::arm_together`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn arm_together(&self, axes: &[u8]) -> Result<u32, ClientError> {
        let axes = axes.to_vec();
        self.with(move |client| client.arm_together(&axes)).await
    }

    /// See [`Client::set`]. The setpoint expires `ttl` after this is awaited first, however long it
    /// waits for the requests before it.
    ///
    /// # Errors
    /// As [`with`](Self::with); [`ClientError::NoAnswer`] if it was not sent in that time.
    pub async fn set(
        &self,
        axis: u8,
        epoch: u32,
        setpoint: Setpoint,
        ttl: Duration,
    ) -> Result<(), ClientError> {
        let left = left_of("Setpoint", ttl);
        self.with(move |client| client.set(axis, epoch, setpoint, left()?)).await
    }

    /// See [`Client::cycle`], and [`set`](Self::set) for `ttl`.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub async fn cycle(
        &self,
        epoch: u32,
        setpoints: &[AxisSetpoint],
        fields: StateFields,
        ttl: Duration,
    ) -> Result<Vec<CycleState>, ClientError> {
        let setpoints = setpoints.to_vec();
        let left = left_of("Cycle", ttl);
        self.with(move |client| client.cycle(epoch, &setpoints, fields, left()?)).await
    }

    /// See [`Client::read_state`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn read_state(&self, axis: u8) -> Result<AxisReport, ClientError> {
        self.with(move |client| client.read_state(axis)).await
    }

    /// See [`Client::now`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn now(&self) -> Result<Duration, ClientError> {
        self.with(|client| Ok(client.now())).await
    }

    /// See [`Client::stop`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn stop(&self, target: StopTarget) -> Result<(), ClientError> {
        self.with(move |client| client.stop(target)).await
    }

    /// See [`Client::estop`].
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn estop(&self) -> Result<(), ClientError> {
        self.with(Client::estop).await
    }

    /// The next event, whenever it comes. While it is awaited, a request waits up to 1 ms longer.
    ///
    /// # Errors
    /// As [`with`](Self::with).
    pub async fn event(&self) -> Result<EventMessage, ClientError> {
        loop {
            if let Some(event) = self.with(|client| client.poll_event(EVENT_TURN)).await? {
                return Ok(event);
            }
        }
    }
}

/// Does one task after the other, until nobody can send any more.
fn serve(
    client: Result<Inner, ClientError>,
    connected: oneshot::Sender<Result<HelloReply, ClientError>>,
    to_do: &Receiver<Task>,
) {
    let mut client = match client {
        Ok(client) => client,
        Err(error) => return drop(connected.send(Err(error))),
    };
    if connected.send(Ok(client.hello().clone())).is_err() {
        return;
    }
    loop {
        match to_do.recv_timeout(LOOK_EVERY) {
            Ok(task) => task(&mut client),
            Err(RecvTimeoutError::Timeout) => drop(client.stop_if_interrupted()),
            Err(RecvTimeoutError::Disconnected) => return drop(client.stop_if_interrupted()),
        }
    }
}

/// What is left of the life of a request that begins now.
fn left_of(
    request: &'static str,
    ttl: Duration,
) -> impl FnOnce() -> Result<Duration, ClientError> + Send {
    let asked = Instant::now();
    move || match ttl.saturating_sub(asked.elapsed()) {
        Duration::ZERO => Err(ClientError::NoAnswer { request, after: ttl }),
        left => Ok(left),
    }
}

fn ended() -> ClientError {
    io::Error::new(io::ErrorKind::BrokenPipe, "the thread of this client has ended").into()
}
