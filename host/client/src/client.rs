//! [`Client`]: one session with one gateway.

mod sending;

use std::io::ErrorKind;
use std::time::Duration;

use host_protocol::replies::HelloReply;
use host_protocol::requests::{Hello, Ping, Subscribe};
use host_protocol::{
    BootReason, Call, CycleMessage, Error, EventMessage, PROTOCOL_MAJOR, PROTOCOL_MINOR,
    StopTarget, Text,
};

use crate::baud::Baud;
use crate::clock::Clock;
use crate::error::ClientError;
use crate::inbox::{Inbox, Losses};
use crate::interrupt::Interrupt;
use crate::stopping::{StopRequest, until_answered};
use crate::stream::Stream;
use crate::transport::Transport;

/// How long an answer is awaited, repetitions included, unless the caller says otherwise.
pub const DEADLINE: Duration = Duration::from_secs(1);
/// How long `Hello` is awaited: the gateway may be starting.
pub const HELLO_DEADLINE: Duration = Duration::from_secs(2);
/// An unanswered request is sent again after this time. Repetitions keep authority alive, so it is
/// well below the gateway's default link silence of 250 ms.
pub const REPEAT_AFTER: Duration = Duration::from_millis(80);
/// What moves is sent again sooner: it must come while it is still permitted.
pub(crate) const REPEAT_MOVE_AFTER: Duration = Duration::from_millis(20);
/// [`Client::keep_alive`] pings when nothing was sent for this long: three of them fit into the
/// default link silence.
pub const KEEP_ALIVE_AFTER: Duration = Duration::from_millis(80);
/// By how much the latest expiry stays below what the gateway takes.
pub(crate) const EXPIRY_MARGIN: Duration = Duration::from_millis(1);

/// Longer than any axis takes, with room to the half range of the wire.
const LONGEST_TTL: Duration = Duration::from_secs(1_000);

/// A setpoint's expiry is never derived from a measure of the clock older than this: a ping comes
/// first.
pub const CLOCK_VALID_FOR: Duration = Duration::from_millis(500);

/// [`Client::keep_subscription`] pings when the last ping is this long ago: four of them may get
/// lost.
pub const KEEP_SUBSCRIPTION_AFTER: Duration = Duration::from_secs(1);
/// After this silence a subscription may have ended, which the gateway does after 5 s: it is made
/// again.
const SUBSCRIPTION_MAY_HAVE_ENDED_AFTER: Duration = Duration::from_secs(4);

/// Exchanges that measure the clock when a session starts.
const FIRST_PINGS: usize = 3;
/// So often bytes that have already arrived are read when there is no time to wait for an event.
const READS_WITHOUT_WAITING: usize = 16;

/// One session with one gateway.
///
/// Every call takes its time from the transport, and whatever it waits for, it waits in one place,
/// where it looks in this order: an interrupt, which is followed by the stops of the axes that were
/// armed here; setpoints that are due; the request under way. Events that arrive meanwhile wait in
/// a queue for [`poll_event`](Self::poll_event).
pub struct Client<T: Transport> {
    pub(crate) transport: T,
    pub(crate) baud: Baud,
    inbox: Inbox,
    clock: Clock,
    hello: HelloReply,
    sequence: u16,
    /// How many requests have been written.
    written: u64,
    last_sent: Duration,
    /// What was subscribed to last in this session.
    subscription: Option<Subscribe>,
    interrupt: Interrupt,
    /// The interrupt has been followed: nothing that moves is sent any more.
    interrupted: bool,
    /// Axes whose arming was asked for here.
    armed: Vec<u8>,
    /// An axis that was armed here has been stopped.
    has_stopped: bool,
    pub(crate) stream: Option<Stream>,
    /// What answers knows no request of a server.
    pub(crate) has_no_server: bool,
}

impl<T: Transport> Client<T> {
    /// Opens a session: says hello, checks the version and measures the gateway's clock.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`] when nothing answers, [`ClientError::LinksTaken`] when the gateway
    /// has no host link left, [`ClientError::Incompatible`] when it speaks another major
    /// version, or the failure of the transport.
    pub fn connect(transport: T) -> Result<Self, ClientError> {
        // Random, so that no answer and no memory of an earlier session fits to this one.
        Self::connect_as(transport, fastrand::u32(..), fastrand::u16(..))
    }

    /// As [`connect`](Self::connect), and has `interrupt` end what this client does, from its first
    /// frame on: the next frames written are stops of the axes that were armed here, and
    /// nothing that moves is sent any more.
    ///
    /// # Errors
    /// As [`connect`](Self::connect), and [`ClientError::Interrupted`].
    pub fn connect_heeding(transport: T, interrupt: Interrupt) -> Result<Self, ClientError> {
        Self::start(transport, interrupt, fastrand::u32(..), fastrand::u16(..))
    }

    /// As [`connect`](Self::connect), with a given session number and first sequence number, for
    /// runs that must be the same each time. The transport's time is mixed into both, so that a
    /// session with numbers that were used before takes no old answer for its own.
    ///
    /// # Errors
    /// As [`connect`](Self::connect).
    pub fn connect_as(
        transport: T,
        session: u32,
        first_sequence: u16,
    ) -> Result<Self, ClientError> {
        Self::start(transport, Interrupt::default(), session, first_sequence)
    }

    fn start(
        transport: T,
        interrupt: Interrupt,
        session: u32,
        first_sequence: u16,
    ) -> Result<Self, ClientError> {
        let (high, low) = spread(transport.now());
        let mut client = Self {
            inbox: Inbox::new(),
            baud: Baud::default(),
            clock: Clock::default(),
            hello: no_hello(),
            sequence: first_sequence.wrapping_add(low),
            written: 0,
            last_sent: transport.now(),
            subscription: None,
            interrupt,
            interrupted: false,
            armed: Vec::new(),
            has_stopped: false,
            stream: None,
            has_no_server: false,
            transport,
        };
        client.say_hello_as(session.wrapping_add(high)).map_err(name_refusal)?;
        client.negotiate()?;
        client.measure_clock()?;
        Ok(client)
    }

    /// Opens the transport again and starts a new session. Events received before stay in the
    /// queue. Axes that were armed have to be armed again, and a subscription has ended.
    ///
    /// # Errors
    /// As [`connect`](Self::connect). It may be tried again.
    pub fn reconnect(&mut self) -> Result<(), ClientError> {
        self.transport.reconnect()?;
        self.inbox.restart();
        self.baud.restart();
        self.clock.reset();
        self.say_hello()?;
        self.negotiate()?;
        self.measure_clock()
    }

    /// A new session, in which nothing is subscribed to.
    pub(crate) fn say_hello(&mut self) -> Result<HelloReply, ClientError> {
        (self.subscription, self.has_no_server) = (None, false);
        self.say_hello_as(fastrand::u32(..))?;
        Ok(self.hello.clone())
    }

    fn say_hello_as(&mut self, session: u32) -> Result<(), ClientError> {
        let request =
            Hello { protocol_major: PROTOCOL_MAJOR, protocol_minor: PROTOCOL_MINOR, session };
        self.hello = refuse_other_major(self.request_within(&request, HELLO_DEADLINE))?;
        self.clock.greeted();
        Ok(())
    }

    fn measure_clock(&mut self) -> Result<(), ClientError> {
        for _ in 0..FIRST_PINGS {
            self.ping()?;
        }
        Ok(())
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

    /// Asks for something and waits for the reply, at most `deadline`. While none comes, the same
    /// bytes are sent again every [`REPEAT_AFTER`]: the gateway executes them at most once and
    /// repeats its answer.
    ///
    /// # Errors
    /// [`ClientError::Gateway`] with the gateway's error, [`ClientError::NoAnswer`] after the
    /// deadline, or the failure of the transport.
    pub fn request_within<C: Call>(
        &mut self,
        request: &C,
        deadline: Duration,
    ) -> Result<C::Reply, ClientError> {
        self.exchange(request, deadline, REPEAT_AFTER).map(|(reply, _)| reply)
    }

    /// What the motor answered to the native command that is held; `None` before.
    pub fn native_reply(&self) -> Option<&[u8]> {
        self.stream.as_ref().and_then(|stream| stream.reply.as_deref())
    }

    /// Stops every axis whose arming was asked for here, and ends their setpoints: the next frames
    /// written are these stops, repeated until they are answered. A connection that fails is
    /// opened again for them. Each axis is stopped once; one whose stop was not answered again.
    ///
    /// # Errors
    /// [`ClientError::StopUnanswered`] if nothing answers, [`ClientError::Gateway`] with the first
    /// refusal.
    pub fn stop_armed(&mut self) -> Result<(), ClientError> {
        self.stream = None;
        let stop = |axis: u8| StopRequest::Stop(StopTarget::Axis(axis));
        let requests: Vec<StopRequest> = self.armed.iter().copied().map(stop).collect();
        if requests.is_empty() {
            return Ok(());
        }
        let stopped = self.until_stopped(&requests);
        // A refusal is an answer.
        if matches!(stopped, Ok(()) | Err(ClientError::Gateway(_))) {
            self.armed.clear();
            self.has_stopped = true;
        }
        stopped
    }

    /// The next frames written are these stops, again and again until each is answered.
    pub(crate) fn until_stopped(&mut self, requests: &[StopRequest]) -> Result<(), ClientError> {
        let Self { transport, inbox, baud, sequence, .. } = self;
        let mut reopened = false;
        let stopped = until_answered(transport, inbox, baud, sequence, requests, &mut reopened);
        if reopened {
            // To the gateway this may be another link: what it says by itself comes after a hello.
            self.clock.reset();
            self.clock.expect_another();
        }
        stopped?;
        match self.greet_anew() {
            Err(error @ (ClientError::Interrupted { .. } | ClientError::StopUnanswered { .. })) => {
                Err(error)
            }
            // The stop was taken, whatever becomes of the hello.
            _ => Ok(()),
        }
    }

    /// Arming an axis is about to be asked for: it is stopped with the others. Whether it was not
    /// to be stopped before: who is refused must not forget what an earlier request has armed.
    pub(crate) fn note_arming(&mut self, axis: u8) -> bool {
        let is_new = !self.armed.contains(&axis);
        if is_new {
            self.armed.push(axis);
        }
        is_new
    }

    /// It was refused, and nothing before has armed it.
    pub(crate) fn forget_arming(&mut self, axis: u8) {
        self.armed.retain(|armed| *armed != axis);
    }

    /// Its stop was taken.
    pub(crate) fn note_stopped(&mut self, axis: u8) {
        self.has_stopped |= self.armed.contains(&axis);
        self.forget_arming(axis);
    }

    /// Asks for the gateway's time, which also keeps authority alive and renews the measure of its
    /// clock.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn ping(&mut self) -> Result<(), ClientError> {
        self.ping_within(DEADLINE)
    }

    pub(crate) fn ping_within(&mut self, deadline: Duration) -> Result<(), ClientError> {
        self.measure_by_ping(deadline, REPEAT_AFTER)
    }

    fn measure_by_ping(
        &mut self,
        deadline: Duration,
        repeat_after: Duration,
    ) -> Result<(), ClientError> {
        let (pong, sent) = self.exchange(&Ping {}, deadline, repeat_after)?;
        self.clock.measure(sent, self.transport.now(), pong.time_us);
        Ok(())
    }

    /// Begins a session, and what was subscribed to in it, with a gateway that a ping has shown to
    /// have restarted behind an open connection, or whose connection was opened again: without one
    /// it tells no events. Where that fails the next call tries again.
    pub(crate) fn greet_anew(&mut self) -> Result<(), ClientError> {
        if !self.clock.has_restarted() {
            return Ok(());
        }
        self.say_hello_as(fastrand::u32(..))?;
        let Some(subscription) = self.subscription else { return Ok(()) };
        let made = self.subscribe_as(subscription);
        match &made {
            Ok(()) => {}
            Err(ClientError::Gateway(error)) if !is_passing(error) => self.subscription = None,
            Err(_) => self.clock.expect_another(),
        }
        made
    }

    /// Pings if the last measure of the gateway's clock is older than [`CLOCK_VALID_FOR`]: again
    /// soon, where a setpoint waits for it. With a gateway that has restarted a new session begins.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn refresh_clock(&mut self) -> Result<(), ClientError> {
        if self.clock.age(self.transport.now()) >= CLOCK_VALID_FOR {
            self.measure_by_ping(DEADLINE, REPEAT_MOVE_AFTER)?;
        }
        self.greet_anew()
    }

    /// Pings if nothing was sent for [`KEEP_ALIVE_AFTER`]. Called often enough, it keeps authority
    /// alive; it feeds no setpoint. With a gateway that has restarted a new session begins.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn keep_alive(&mut self) -> Result<(), ClientError> {
        if self.transport.now().saturating_sub(self.last_sent) >= KEEP_ALIVE_AFTER {
            self.ping()?;
        }
        self.greet_anew()
    }

    /// Subscribes, and remembers it for [`keep_subscription`](Self::keep_subscription).
    pub(crate) fn subscribe_as(&mut self, subscription: Subscribe) -> Result<(), ClientError> {
        self.request(&subscription)?;
        self.subscription = (subscription.axes != 0).then_some(subscription);
        Ok(())
    }

    /// Keeps a subscription alive: pings if none was answered for [`KEEP_SUBSCRIPTION_AFTER`]. If
    /// this process was held up for so long that the subscription may have ended, it is made
    /// again; so it is, in a new session, if the gateway has restarted behind an open connection.
    ///
    /// # Errors
    /// As [`request_within`](Self::request_within).
    pub fn keep_subscription(&mut self) -> Result<(), ClientError> {
        let now = self.transport.now();
        let quiet = now.saturating_sub(self.last_sent);
        match self.subscription {
            Some(subscription)
                if quiet >= SUBSCRIPTION_MAY_HAVE_ENDED_AFTER && !self.clock.has_restarted() =>
            {
                self.request(&subscription).map(drop)
            }
            _ => {
                // Only a ping tells of a restart.
                if self.clock.age(now) >= KEEP_SUBSCRIPTION_AFTER {
                    self.ping()?;
                }
                self.greet_anew()
            }
        }
    }

    /// The next event: one that waits, or the first that arrives within `timeout`. It ends then,
    /// whatever else arrives. Sends nothing but setpoints that are held.
    ///
    /// # Errors
    /// [`ClientError::Interrupted`], or the failure of the transport.
    pub fn poll_event(&mut self, timeout: Duration) -> Result<Option<EventMessage>, ClientError> {
        self.listen_until(timeout, Inbox::has_event)?;
        Ok(self.inbox.next_event())
    }

    /// What is told of the next period of the cycle that this host [runs](Self::run_cycle), as
    /// [`poll_event`](Self::poll_event).
    ///
    /// # Errors
    /// As [`poll_event`](Self::poll_event).
    pub fn poll_cycle(&mut self, timeout: Duration) -> Result<Option<CycleMessage>, ClientError> {
        self.listen_until(timeout, Inbox::has_cycle)?;
        Ok(self.inbox.next_cycle())
    }

    fn listen_until(
        &mut self,
        timeout: Duration,
        has: impl Fn(&Inbox) -> bool,
    ) -> Result<(), ClientError> {
        let end = self.transport.now().saturating_add(timeout);
        // Also with no time to wait: what has already arrived is read.
        let mut reads = 0;
        while !has(&self.inbox) && reads < READS_WITHOUT_WAITING {
            self.heed_interrupt(Ping::NUMBER)?;
            self.send_due()?;
            let before = self.inbox.bytes();
            self.listen(end, None)?;
            if self.transport.now() >= end {
                if self.inbox.bytes() == before {
                    break;
                }
                reads += 1;
            }
        }
        Ok(())
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

    /// The expiry of a setpoint that is sent now and shall be valid for `ttl`, as the wire carries
    /// it.
    ///
    /// It is derived from the best guess of the gateway's time, which is wrong by half a round trip
    /// at most: on a line that takes as long in one direction as in the other, a setpoint is
    /// valid for `ttl` from when it is sent. However wrong the guess, the gateway takes
    /// none that is valid for longer than the axis's TTL from when it arrives.
    pub fn expiry(&self, ttl: Duration) -> u32 {
        expiry_after(self.gateway_now_us(), ttl)
    }

    /// The latest expiry that the gateway may take: valid for `ttl` from when it arrives, if it
    /// takes as long as the quickest ping. For what moves and is not sent again: its answer has
    /// to come back, and the next request to arrive, before it expires.
    pub(crate) fn latest_expiry(&self, ttl: Duration) -> u32 {
        let latest = self.clock.latest_us(self.transport.now()).unwrap_or(0);
        expiry_after(latest, ttl.saturating_sub(EXPIRY_MARGIN))
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

/// What is known of a gateway before it has answered.
fn no_hello() -> HelloReply {
    HelloReply {
        protocol_major: PROTOCOL_MAJOR,
        protocol_minor: PROTOCOL_MINOR,
        firmware: Text::new(),
        build_id: Text::new(),
        board: Text::new(),
        boot: BootReason::PowerOn,
        has_crash_report: false,
        trips_recorded: 0,
        max_axes: 0,
        max_message: 0,
        buses: host_protocol::Vec::new(),
        time_us: 0,
    }
}

/// Numbers that differ from one time to another; both 0 at time 0.
#[allow(clippy::cast_possible_truncation)]
fn spread(now: Duration) -> (u32, u16) {
    let mixed = (now.as_nanos() as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((mixed >> 32) as u32, (mixed >> 16) as u16)
}

/// The version may be refused by either side: by the gateway with an error, or here by what it
/// replied.
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

/// Times on the wire are the low 32 bits of the µs, compared in half range: a `ttl` beyond that
/// would expire at once, or soon. It is cut to what is still too long for the gateway, which then
/// names the limit.
#[allow(clippy::cast_possible_truncation)]
fn expiry_after(now_us: u64, ttl: Duration) -> u32 {
    let ttl_us = u64::try_from(ttl.min(LONGEST_TTL).as_micros()).unwrap_or(u64::MAX);
    now_us.wrapping_add(ttl_us) as u32
}

/// Whether the gateway refuses what it may take a moment later.
fn is_passing(error: &Error) -> bool {
    matches!(error, Error::GatewayAway {} | Error::NoSession {} | Error::Busy { .. })
}
