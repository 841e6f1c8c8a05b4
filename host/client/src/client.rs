//! [`Client`]: one session with one gateway.

use std::io::ErrorKind;
use std::time::Duration;

use host_protocol::messages::request_name;
use host_protocol::replies::HelloReply;
use host_protocol::requests::{Hello, Ping, Subscribe};
use host_protocol::{Call, Error, EventMessage, Kind, MAX_FRAME, PROTOCOL_MAJOR, PROTOCOL_MINOR};

use crate::clock::Clock;
use crate::error::ClientError;
use crate::inbox::{Answer, Awaited, Inbox, Losses};
use crate::interrupt::Interrupt;
use crate::transport::Transport;

/// How long an answer is awaited, repetitions included, unless the caller says otherwise.
pub const DEADLINE: Duration = Duration::from_secs(1);
/// How long `Hello` is awaited: the gateway may be starting.
pub const HELLO_DEADLINE: Duration = Duration::from_secs(2);
/// An unanswered request is sent again after this time. Repetitions keep authority alive, so it is well below the
/// gateway's default link silence of 250 ms.
pub const REPEAT_AFTER: Duration = Duration::from_millis(80);
/// [`Client::keep_alive`] pings when nothing was sent for this long: three of them fit into the default link silence.
pub const KEEP_ALIVE_AFTER: Duration = Duration::from_millis(80);

/// A setpoint's expiry is never derived from a measure of the clock older than this: a ping comes first.
pub const CLOCK_VALID_FOR: Duration = Duration::from_millis(500);

/// [`Client::keep_subscription`] pings when nothing was sent for this long: four pings may get lost.
pub const KEEP_SUBSCRIPTION_AFTER: Duration = Duration::from_secs(1);
/// After this silence a subscription may have ended, which the gateway does after 5 s: it is made again.
const SUBSCRIPTION_MAY_HAVE_ENDED_AFTER: Duration = Duration::from_secs(4);

/// Exchanges that measure the clock when a session starts.
const FIRST_PINGS: usize = 3;
/// Bytes taken from the transport at once.
const READ_BUFFER: usize = 512;

/// One session with one gateway.
///
/// Every call takes its time from the transport. One request is on its way at a time; events that arrive meanwhile
/// wait in a queue for [`poll_event`](Self::poll_event).
pub struct Client<T: Transport> {
    transport: T,
    inbox: Inbox,
    clock: Clock,
    hello: HelloReply,
    sequence: u16,
    last_sent: Duration,
    /// What was subscribed to last in this session.
    subscription: Option<Subscribe>,
    interrupt: Interrupt,
}

impl<T: Transport> Client<T> {
    /// Opens a session: says hello, checks the version and measures the gateway's clock.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`] when nothing answers, [`ClientError::LinksTaken`] when the gateway has no host link left,
    /// [`ClientError::Incompatible`] when it speaks another major version, or the failure of the transport.
    pub fn connect(transport: T) -> Result<Self, ClientError> {
        // Random, so that no answer and no memory of an earlier session fits to this one.
        Self::connect_as(transport, fastrand::u32(..), fastrand::u16(..))
    }

    /// As [`connect`](Self::connect), with a given session number and first sequence number: for runs that must be
    /// the same each time.
    ///
    /// # Errors
    /// As [`connect`](Self::connect).
    pub fn connect_as(mut transport: T, session: u32, first_sequence: u16) -> Result<Self, ClientError> {
        let mut inbox = Inbox::new();
        let request = hello_request(session);
        let answer = exchange(&mut transport, &mut inbox, first_sequence, &request, HELLO_DEADLINE);
        let hello = refuse_other_major(answer).map_err(name_refusal)?;
        let sequence = first_sequence.wrapping_add(1);
        let last_sent = transport.now();
        let clock = Clock::default();
        let mut client = Self {
            transport,
            inbox,
            clock,
            hello,
            sequence,
            last_sent,
            subscription: None,
            interrupt: Interrupt::default(),
        };
        client.measure_clock()?;
        Ok(client)
    }

    /// Opens the transport again and starts a new session. Events received before stay in the queue. Axes that were
    /// armed have to be armed again, and a subscription has ended.
    ///
    /// # Errors
    /// As [`connect`](Self::connect). It may be tried again.
    pub fn reconnect(&mut self) -> Result<(), ClientError> {
        self.transport.reconnect()?;
        self.inbox.restart();
        self.clock.reset();
        self.say_hello()?;
        self.measure_clock()
    }

    pub(crate) fn say_hello(&mut self) -> Result<HelloReply, ClientError> {
        let request = hello_request(fastrand::u32(..));
        self.subscription = None;
        self.hello = refuse_other_major(self.request_within(&request, HELLO_DEADLINE))?;
        Ok(self.hello.clone())
    }

    fn measure_clock(&mut self) -> Result<(), ClientError> {
        for _ in 0..FIRST_PINGS {
            self.ping()?;
        }
        Ok(())
    }

    /// Has `interrupt` end what this client does.
    pub fn heed(&mut self, interrupt: Interrupt) {
        self.interrupt = interrupt;
    }

    /// What ends what this client does.
    pub fn interrupt(&self) -> Interrupt {
        self.interrupt.clone()
    }

    /// What the gateway said of itself when the session was opened.
    pub fn hello(&self) -> &HelloReply {
        &self.hello
    }

    /// Asks for something and waits for the reply, at most [`DEADLINE`].
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn request<C: Call>(&mut self, request: &C) -> Result<C::Reply, ClientError> {
        self.request_within(request, DEADLINE)
    }

    /// Asks for something and waits for the reply, at most `deadline`. While none comes, the same bytes are sent again
    /// every [`REPEAT_AFTER`]: the gateway executes them at most once and repeats its answer.
    ///
    /// # Errors
    /// [`ClientError::Gateway`] with the gateway's error, [`ClientError::NoAnswer`] after the deadline, or the failure
    /// of the transport.
    pub fn request_within<C: Call>(
        &mut self,
        request: &C,
        deadline: Duration,
    ) -> Result<C::Reply, ClientError> {
        let (reply, _) = self.timed_request(request, deadline)?;
        Ok(reply)
    }

    /// The reply, and when the request was sent for the first time.
    fn timed_request<C: Call>(
        &mut self,
        request: &C,
        deadline: Duration,
    ) -> Result<(C::Reply, Duration), ClientError> {
        let sequence = self.sequence;
        self.sequence = self.sequence.wrapping_add(1);
        let sent = self.transport.now();
        let answer = exchange(&mut self.transport, &mut self.inbox, sequence, request, deadline);
        self.last_sent = sent.max(self.last_sent);
        Ok((answer?, sent))
    }

    /// Asks for the gateway's time, which also keeps authority alive and renews the measure of its clock.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn ping(&mut self) -> Result<(), ClientError> {
        let (pong, sent) = self.timed_request(&Ping {}, DEADLINE)?;
        self.clock.measure(sent, self.transport.now(), pong.time_us);
        Ok(())
    }

    /// Forgets what was known of the gateway's clock, and pings.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub(crate) fn measure_clock_anew(&mut self) -> Result<(), ClientError> {
        self.clock.reset();
        self.ping()
    }

    /// Pings if the last measure of the gateway's clock is older than [`CLOCK_VALID_FOR`].
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub(crate) fn refresh_clock(&mut self) -> Result<(), ClientError> {
        if self.clock.age(self.transport.now()) < CLOCK_VALID_FOR {
            return Ok(());
        }
        self.ping()
    }

    /// Pings if nothing was sent for [`KEEP_ALIVE_AFTER`]. Called often enough, it keeps authority alive; it feeds no
    /// setpoint.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn keep_alive(&mut self) -> Result<(), ClientError> {
        if self.transport.now().saturating_sub(self.last_sent) < KEEP_ALIVE_AFTER {
            return Ok(());
        }
        self.ping()
    }

    /// Subscribes, and remembers it for [`keep_subscription`](Self::keep_subscription).
    pub(crate) fn subscribe_as(&mut self, subscription: Subscribe) -> Result<(), ClientError> {
        self.request(&subscription)?;
        self.subscription = (subscription.axes != 0).then_some(subscription);
        Ok(())
    }

    /// Keeps a subscription alive: pings if nothing was sent for [`KEEP_SUBSCRIPTION_AFTER`]. If this process was held up for
    /// so long that the subscription may have ended, it is made again.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn keep_subscription(&mut self) -> Result<(), ClientError> {
        let quiet = self.transport.now().saturating_sub(self.last_sent);
        match self.subscription {
            _ if quiet < KEEP_SUBSCRIPTION_AFTER => Ok(()),
            Some(subscription) if quiet >= SUBSCRIPTION_MAY_HAVE_ENDED_AFTER => {
                self.request(&subscription).map(drop)
            }
            _ => self.ping(),
        }
    }

    /// The next event: one that waits, or the first that arrives within `timeout`. Sends nothing.
    ///
    /// # Errors
    /// The failure of the transport.
    pub fn poll_event(&mut self, timeout: Duration) -> Result<Option<EventMessage>, ClientError> {
        let end = self.transport.now() + timeout;
        let mut buffer = [0; READ_BUFFER];
        // Also with no time to wait: what has already arrived is read.
        while !self.inbox.has_event() {
            let left = end.saturating_sub(self.transport.now());
            let count = self.transport.receive(&mut buffer, left)?;
            self.inbox.take_in(buffer.get(..count).unwrap_or(&buffer), None);
            if count == 0 && self.transport.now() >= end {
                break;
            }
        }
        Ok(self.inbox.next_event())
    }

    /// The best guess of the gateway's time now, µs since it started.
    pub fn gateway_now_us(&self) -> u64 {
        self.clock.estimate_us(self.transport.now())
    }

    /// By how much [`gateway_now_us`](Self::gateway_now_us) may be wrong at most.
    pub fn clock_uncertainty(&self) -> Duration {
        let now = self.transport.now();
        let earliest = self.clock.earliest_us(now);
        Duration::from_micros(
            self.clock.latest_us(now).unwrap_or(earliest).saturating_sub(earliest).div_ceil(2),
        )
    }

    /// The expiry of a setpoint that is sent now and shall be valid for `ttl`, as the wire carries it.
    ///
    /// It is derived from the earliest time that the gateway's clock can show, so it is never refused for lying beyond
    /// the axis's TTL; it may lie short of it by the duration of a ping.
    pub fn expiry(&self, ttl: Duration) -> u32 {
        let ttl = u64::try_from(ttl.as_micros()).unwrap_or(u64::MAX);
        low_bits(self.clock.earliest_us(self.transport.now()).wrapping_add(ttl))
    }

    /// What was lost or ignored on the way here.
    pub fn losses(&self) -> Losses {
        self.inbox.losses()
    }

    /// The transport's time.
    pub fn now(&self) -> Duration {
        self.transport.now()
    }

    /// The transport.
    pub fn transport(&self) -> &T {
        &self.transport
    }

    /// The transport, to let time pass or to be quiet on it.
    pub fn transport_mut(&mut self) -> &mut T {
        &mut self.transport
    }
}

fn hello_request(session: u32) -> Hello {
    Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: PROTOCOL_MINOR, session }
}

/// The version may be refused by either side: by the gateway with an error, or here by what it replied.
fn refuse_other_major(result: Result<HelloReply, ClientError>) -> Result<HelloReply, ClientError> {
    match result {
        Ok(reply) if reply.protocol_major != PROTOCOL_MAJOR => {
            Err(ClientError::Incompatible { gateway: reply.protocol_major, host: PROTOCOL_MAJOR })
        }
        Err(ClientError::Gateway(Error::UnsupportedVersion { gateway_major, host_major })) => {
            Err(ClientError::Incompatible { gateway: gateway_major, host: host_major })
        }
        other => other,
    }
}

/// A server that closes the connection before it has said anything has no link to give.
fn name_refusal(error: ClientError) -> ClientError {
    match error {
        ClientError::Transport(error) if error.kind() == ErrorKind::ConnectionRefused => {
            ClientError::LinksTaken
        }
        other => other,
    }
}

/// Sends a request until it is answered or the deadline has passed.
fn exchange<T: Transport, C: Call>(
    transport: &mut T,
    inbox: &mut Inbox,
    sequence: u16,
    request: &C,
    deadline: Duration,
) -> Result<C::Reply, ClientError> {
    let name = request_name(C::NUMBER).unwrap_or("a request");
    let mut frame = [0; MAX_FRAME];
    let length = host_protocol::encode(Kind::Request, sequence, C::NUMBER, request, &mut frame)
        .map_err(|_| ClientError::TooLong { request: name })?;
    let frame = frame.get(..length).unwrap_or(&frame);
    let awaited = Some(Awaited { sequence, number: C::NUMBER });

    let end = transport.now() + deadline;
    let mut next_sending = transport.now();
    let mut buffer = [0; READ_BUFFER];
    loop {
        let now = transport.now();
        if now >= end {
            return Err(ClientError::NoAnswer { request: name, after: deadline });
        }
        if now >= next_sending {
            transport.send(frame)?;
            next_sending = now + REPEAT_AFTER;
        }
        let wait = next_sending.min(end).saturating_sub(transport.now());
        let count = transport.receive(&mut buffer, wait)?;
        match inbox.take_in(buffer.get(..count).unwrap_or(&buffer), awaited) {
            None => {}
            Some(Answer::Error(error)) => return Err(error.into()),
            Some(Answer::Reply { number, body }) => {
                return read_reply::<C>(&body).ok_or(ClientError::UnreadableReply { request: name, number });
            }
        }
    }
}

/// Reads the whole body of a reply; bytes left over belong to another type than this.
fn read_reply<C: Call>(body: &[u8]) -> Option<C::Reply> {
    match postcard::take_from_bytes(body) {
        Ok((reply, [])) => Some(reply),
        _ => None,
    }
}

/// Times on the wire are the low 32 bits of the µs, compared in half range.
#[allow(clippy::cast_possible_truncation)]
fn low_bits(time_us: u64) -> u32 {
    time_us as u32
}
