//! The other side: a peer that asks a gateway, or commands it.

use std::fmt;
use std::time::{Duration, Instant};

use host_protocol::{ClearTarget, Setpoint};
use serde_json::{Value, json};
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::{Session, Wait};

use crate::command::Word;
use crate::keys::{Keys, check_name};

/// How long an answer is awaited: arming may take as long as its motor.
const PATIENCE: Duration = Duration::from_secs(6);
/// The gateway hears that this peer is there this often, while it waits for something else.
const KEEP_ALIVE_EVERY: Duration = Duration::from_millis(80);
/// Until a gateway has heard of a new peer.
const SEEN_WITHIN: Duration = Duration::from_secs(2);
/// Exchanges that measure the clock in the beginning.
const FIRST_LOOKS: usize = 3;
/// A measure of the clock that is older gives way to the next, however quick that is.
const CLOCK_VALID_FOR: Duration = Duration::from_secs(10);
/// How old the last look at the gateway's clock may be when a setpoint is sent: two clocks drift
/// apart.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Before it is asked again.
const AGAIN_AFTER: Duration = Duration::from_millis(20);

/// Why something was not done.
#[derive(Debug, Clone, PartialEq)]
pub struct Refused {
    /// A name that programs can rely on: the gateway's own for its errors, in snake_case.
    pub name: String,
    /// What was wrong, what is allowed, the next step.
    pub message: String,
    /// All that was answered.
    pub error: Value,
}

impl Refused {
    fn new(name: &str, message: String) -> Self {
        Self { name: name.to_owned(), message, error: Value::Null }
    }

    fn read(mut answer: Value) -> Self {
        let error = answer["error"].take();
        let text = |key: &str| error[key].as_str().unwrap_or("unreadable").to_owned();
        Self { name: text("name"), message: text("message"), error }
    }
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.message, self.name)
    }
}

impl std::error::Error for Refused {}

impl From<zenoh::Error> for Refused {
    fn from(error: zenoh::Error) -> Self {
        Self::new("network", error.to_string())
    }
}

/// Asks for a key, with an object or with nothing, and returns the answers with their keys: of one
/// gateway, or of all that the key means.
///
/// # Errors
/// The first refusal, or that nothing answered.
pub fn ask(
    session: &Session,
    key: &str,
    body: Option<&Value>,
) -> Result<Vec<(String, Value)>, Refused> {
    let answers = send(session, key, body)?;
    let mut all = Vec::new();
    while let Ok(reply) = answers.recv() {
        all.push(read(&reply)?);
    }
    if all.is_empty() { Err(no_answer(key)) } else { Ok(all) }
}

type Answers = zenoh::handlers::FifoChannelHandler<Reply>;

fn send(session: &Session, key: &str, body: Option<&Value>) -> Result<Answers, Refused> {
    let asked = session
        .get(key)
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(PATIENCE)
        .priority(Priority::InteractiveHigh)
        .express(true);
    Ok(match body {
        Some(body) => {
            asked.payload(body.to_string()).encoding(Encoding::APPLICATION_JSON).wait()?
        }
        None => asked.wait()?,
    })
}

fn read(reply: &Reply) -> Result<(String, Value), Refused> {
    let json = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap_or_default();
    match reply.result() {
        Ok(sample) => Ok((sample.key_expr().to_string(), json(&sample.payload().to_bytes()))),
        Err(error) => Err(Refused::read(json(&error.payload().to_bytes()))),
    }
}

fn no_answer(key: &str) -> Refused {
    Refused::new("no_answer", format!("nothing in the network answers for {key}"))
}

/// An axis that was armed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Armed {
    /// What every setpoint has to carry.
    pub epoch: u32,
    /// How long a setpoint may be valid.
    pub ttl: Duration,
}

/// A peer in command of a gateway.
///
/// Nothing is sent behind its back: call [`keep_alive`](Self::keep_alive) or
/// [`set`](Self::set) more often than every `link_silence`, or what is armed stops.
pub struct Commander {
    session: Session,
    keys: Keys,
    lease: String,
    /// What the gateway's clock is ahead of this one's, by the quickest exchange so far.
    start: Instant,
    ahead_us: u64,
    quickest: Duration,
    measured: Instant,
    /// When it was looked at last.
    looked: Instant,
    link_silence: Duration,
    /// Shows that this peer is there, until this is dropped.
    _alive: LivelinessToken,
}

impl Commander {
    /// Takes command of the gateway `name`, as `peer`.
    ///
    /// # Errors
    /// Another peer or program commands it, or there is none of this name.
    pub fn take(session: &Session, name: &str, peer: &str) -> Result<Self, Refused> {
        let keys = Keys::new(&check_name(name).map_err(|why| Refused::new("usage", why))?);
        check_name(peer).map_err(|why| Refused::new("usage", why))?;
        let alive = session.liveliness().declare_token(keys.peer(peer)).wait()?;
        let (key, body) = (keys.command(Word::Take), json!({ "peer": peer }));
        let end = Instant::now() + SEEN_WITHIN;
        let taken = loop {
            match ask(session, &key, Some(&body)) {
                // The token travels by itself.
                Err(refused) if refused.name == "no_sign_of_life" && Instant::now() < end => {
                    std::thread::sleep(AGAIN_AFTER);
                }
                taken => break one(taken?),
            }
        };
        let mut commander = Self {
            session: session.clone(),
            keys,
            lease: taken["lease"].as_str().unwrap_or_default().to_owned(),
            start: Instant::now(),
            ahead_us: 0,
            quickest: Duration::MAX,
            measured: Instant::now(),
            looked: Instant::now(),
            link_silence: Duration::from_micros(taken["link_silence_us"].as_u64().unwrap_or(0)),
            _alive: alive,
        };
        for _ in 0..FIRST_LOOKS {
            commander.keep_alive()?;
        }
        Ok(commander)
    }

    /// What this peer commands by.
    pub fn lease(&self) -> &str {
        &self.lease
    }

    /// How long this peer may be silent.
    pub fn link_silence(&self) -> Duration {
        self.link_silence
    }

    /// Tells the gateway that this peer is there, and measures its clock.
    ///
    /// # Errors
    /// The lease is over, or nothing answers.
    pub fn keep_alive(&mut self) -> Result<(), Refused> {
        let asked = Instant::now();
        let answer = self.order(Word::KeepAlive, json!({}))?;
        self.looked = asked;
        let round = asked.elapsed();
        let time_us = answer["time_us"].as_u64();
        let time_us = time_us.ok_or_else(|| no_answer("the gateway's time"))?;
        if round <= self.quickest || self.measured.elapsed() > CLOCK_VALID_FOR {
            (self.quickest, self.measured) = (round, Instant::now());
            let half = micros(asked.duration_since(self.start) + round / 2);
            self.ahead_us = time_us.wrapping_sub(half);
        }
        Ok(())
    }

    /// The best guess of the gateway's time, µs since it started.
    pub fn gateway_now_us(&self) -> u64 {
        self.ahead_us.wrapping_add(micros(self.start.elapsed()))
    }

    /// Allows an axis to move. This peer is kept alive meanwhile.
    ///
    /// # Errors
    /// The gateway's refusal.
    pub fn arm(&mut self, axis: u8) -> Result<Armed, Refused> {
        let body = json!({ "lease": self.lease, "axis": axis });
        let key = self.keys.command(Word::Arm);
        let answers = send(&self.session, &key, Some(&body))?;
        loop {
            match answers.recv_timeout(KEEP_ALIVE_EVERY) {
                Ok(None) => self.keep_alive()?,
                Err(_) => return Err(no_answer(&key)),
                Ok(Some(reply)) => {
                    let (_, armed) = read(&reply)?;
                    let number = |key: &str| armed[key].as_u64().unwrap_or(0);
                    let epoch = u32::try_from(number("epoch")).unwrap_or(0);
                    return Ok(Armed { epoch, ttl: Duration::from_micros(number("ttl_us")) });
                }
            }
        }
    }

    /// Says what an armed axis shall do from now on, for `ttl` at most: less than the axis's, as
    /// the guess of the gateway's time may be wrong by half a round trip. Twice a second that is
    /// asked for first.
    ///
    /// # Errors
    /// The gateway's refusal.
    pub fn set(
        &mut self,
        axis: u8,
        epoch: u32,
        setpoint: Setpoint,
        ttl: Duration,
    ) -> Result<(), Refused> {
        if self.looked.elapsed() >= LOOK_EVERY {
            self.keep_alive()?;
        }
        let expires_at_us = self.gateway_now_us().wrapping_add(micros(ttl));
        let mut body = json!({ "axis": axis, "epoch": epoch, "expires_at_us": expires_at_us });
        if let (Some(body), Ok(Value::Object(wire))) =
            (body.as_object_mut(), serde_json::to_value(setpoint))
        {
            for (name, fields) in wire {
                body.insert("setpoint".to_owned(), json!(name));
                body.extend(fields.as_object().cloned().unwrap_or_default());
            }
        }
        self.order(Word::Setpoint, body).map(drop)
    }

    /// Clears the trip of an axis, or the latched e-stop.
    ///
    /// # Errors
    /// The gateway's refusal.
    pub fn clear(&mut self, target: ClearTarget) -> Result<(), Refused> {
        let body = match target {
            ClearTarget::Axis(axis) => json!({ "axis": axis }),
            ClearTarget::Gateway => json!({}),
        };
        self.order(Word::Clear, body).map(drop)
    }

    /// Stops an axis, or all.
    ///
    /// # Errors
    /// The gateway's refusal, or that nothing answers.
    pub fn stop(&mut self, axis: Option<u8>) -> Result<(), Refused> {
        let body = axis.map(|axis| json!({ "axis": axis }));
        ask(&self.session, &self.keys.command(Word::Stop), body.as_ref()).map(drop)
    }

    /// Stops what is armed here and gives command back.
    ///
    /// # Errors
    /// The gateway's refusal.
    pub fn release(mut self) -> Result<(), Refused> {
        self.order(Word::Release, json!({})).map(drop)
    }

    fn order(&mut self, word: Word, mut body: Value) -> Result<Value, Refused> {
        body["lease"] = json!(self.lease);
        ask(&self.session, &self.keys.command(word), Some(&body)).map(one)
    }
}

fn one(answers: Vec<(String, Value)>) -> Value {
    answers.into_iter().next().map(|(_, answer)| answer).unwrap_or_default()
}

fn micros(duration: Duration) -> u64 {
    u64::try_from(duration.as_micros()).unwrap_or(u64::MAX)
}
