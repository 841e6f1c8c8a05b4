//! The session behind the screen: it follows samples and events, asks how things are once a second,
//! connects again, and does what a key asks for.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;

use host_protocol::StopTarget;
use mgw_client::{ClientError, Interrupt, StopRequest, stop_before_hello};

use super::display::Display;
use super::keys::Wish;
use super::screen;
use super::suspension::Suspension;
use super::view::{Message, View};
use crate::commands;
use crate::explain;
use crate::failure::Failure;
use crate::live::{Link, Live};
use crate::names::Names;
use crate::session::Session;
use crate::states;
use crate::terminal;

/// The keys and the time are looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The screen is drawn at most this often.
const DRAW_EVERY: Duration = Duration::from_millis(100);
/// How things are is asked this often.
const ASK_EVERY: Duration = Duration::from_secs(1);
/// The names are asked for as often as this.
const ASK_NAMES_EVERY: Duration = Duration::from_secs(5);
/// Between two attempts to connect again.
const CONNECT_EVERY: Duration = Duration::from_millis(500);
/// Events that are taken in one go, so that keys have their turn.
const EVENTS_AT_ONCE: usize = 256;

/// What is said of a stop that has not been answered.
const SENT_AGAIN: &str = "the stop is sent again until it is answered";
/// And of one whose axes could not be asked.
const ASKED_AGAIN: &str = "what the stop came to is asked again until that is answered";

/// Whether it goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Next {
    GoOn,
    End,
}

/// A gateway that is watched.
pub struct Watching {
    session: Session,
    live: Live,
    view: View,
    display: Display,
    suspension: Suspension,
    period: Duration,
    /// The axes that are subscribed to.
    subscribed: Vec<u8>,
    ask_at: Duration,
    ask_names_at: Duration,
    draw_at: Duration,
    /// What was lost on the way so far.
    lost_on_the_way: u64,
    /// The memory of the gateway has not been read since it was connected to.
    wants_incidents: bool,
    /// A stop was asked for and has not gone out.
    wants_stop: bool,
    /// A stop has gone out, and what it came to has still to be asked.
    wants_report: bool,
    /// What the last stop lacks.
    unconfirmed: Option<Failure>,
}

impl Watching {
    /// Of a session that is open.
    pub fn new(session: Session, port: &str, period: Duration, display: Display) -> Self {
        let now = session.client.now();
        let view = View { colour: terminal::has_colour(), ..View::default() };
        let mut watching = Self {
            session,
            live: Live::of(port),
            view,
            display,
            suspension: Suspension::note(),
            period,
            subscribed: Vec::new(),
            ask_at: now,
            ask_names_at: now,
            draw_at: now,
            lost_on_the_way: 0,
            wants_incidents: true,
            wants_stop: false,
            wants_report: false,
            unconfirmed: None,
        };
        watching.connected();
        watching
    }

    /// Until a key or a signal ends it. A stop that was not confirmed is a failure.
    pub fn run(mut self, keys: &Receiver<Wish>, ended: &Interrupt) -> Result<(), Failure> {
        loop {
            // What interrupted has been noted elsewhere: it is in `keys`, or `ended`.
            let _ = self.session.client.resume();
            if self.suspension.heed(&mut self.display)? {
                self.draw_at = Duration::ZERO;
            }
            if ended.is_raised() || self.heed(keys)? == Next::End {
                break;
            }
            match self.live.link {
                Link::Up if self.wants_report => self.report_stop()?,
                Link::Up => self.follow(),
                Link::Lost { .. } => self.connect(),
            }
            self.draw_if_due()?;
        }
        self.unconfirmed.map_or(Ok(()), Err)
    }

    /// Does what the keys ask for.
    fn heed(&mut self, keys: &Receiver<Wish>) -> Result<Next, Failure> {
        loop {
            let wish = match keys.try_recv() {
                Ok(wish) => wish,
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(Next::End),
            };
            self.draw_at = Duration::ZERO;
            let asked = self.view.confirm.take();
            if wish != Wish::Resized {
                self.view.message = Message::default();
            }
            match (wish, asked) {
                (Wish::Quit, _) => return Ok(Next::End),
                (Wish::Stop, _) => self.wants_stop = true,
                (Wish::Yes, Some(axis)) => self.clear(axis)?,
                (Wish::Up, _) => self.view.choose(&self.live, -1),
                (Wish::Down, _) => self.view.choose(&self.live, 1),
                (Wish::Clear, None) => self.view.ask_to_clear(&self.live),
                (Wish::Clear | Wish::Yes | Wish::Other | Wish::Resized, _) => {}
            }
        }
        if self.wants_stop && self.live.link == Link::Up {
            self.stop()?;
        }
        Ok(Next::GoOn)
    }

    /// Takes what has come, and asks how things are when it is time.
    fn follow(&mut self) {
        let followed = self.ask_if_due().and_then(|()| self.take_events());
        self.heed_failure(followed);
    }

    /// What the gateway refuses, as it is busy, is asked again; what interrupts has been noted.
    fn heed_failure(&mut self, result: Result<(), ClientError>) {
        match result {
            Ok(()) | Err(ClientError::Interrupted { .. } | ClientError::Gateway(_)) => {}
            Err(error) => {
                self.live.lost(&error.to_string());
                self.draw_at = Duration::ZERO;
            }
        }
    }

    fn take_events(&mut self) -> Result<(), ClientError> {
        let client = &mut self.session.client;
        client.keep_subscription()?;
        let mut wait = LOOK_EVERY;
        for _ in 0..EVENTS_AT_ONCE {
            let Some(message) = client.poll_event(wait)? else { break };
            self.live.event(&message, client.now());
            wait = Duration::ZERO;
        }
        self.live.tick(client.now());
        let on_the_way = client.losses().events();
        self.live.lost += on_the_way.saturating_sub(self.lost_on_the_way);
        self.lost_on_the_way = on_the_way;
        Ok(())
    }

    fn ask_if_due(&mut self) -> Result<(), ClientError> {
        let client = &mut self.session.client;
        let now = client.now();
        if now < self.ask_at {
            return Ok(());
        }
        self.ask_at = now + ASK_EVERY;
        let axes = client.list_axes()?;
        self.live.list(&axes);
        if self.view.chosen.is_none_or(|chosen| axes.iter().all(|axis| axis.axis != chosen)) {
            self.view.chosen = axes.first().map(|axis| axis.axis);
        }
        let numbers: Vec<u8> = axes.iter().map(|axis| axis.axis).collect();
        if self.subscribed != numbers {
            client.subscribe(&numbers, states::ALL, self.period)?;
            self.subscribed = numbers;
        }
        let status = client.gateway_status()?;
        self.live.commander = status.holder.map_or(Ok(None), |_| client.commander())?;
        self.live.status = Some(status);
        for bus in (0..).take(self.live.buses.len()) {
            let report = client.bus_status(bus)?;
            self.live.bus(bus, report, client.now());
        }
        if now >= self.ask_names_at {
            self.ask_names_at = now + ASK_NAMES_EVERY;
            self.live.named(&Names::from(client.names()?));
        }
        if self.wants_incidents || self.live.axes.iter().any(|axis| axis.is_unexplained()) {
            self.live.incidents(&client.incidents()?);
            self.wants_incidents = false;
        }
        Ok(())
    }

    /// A session has been opened: everything is asked for at once.
    fn connected(&mut self) {
        let client = &self.session.client;
        let now = client.now();
        self.live.connected(client.hello().clone(), now);
        self.lost_on_the_way = client.losses().events();
        self.subscribed.clear();
        (self.ask_at, self.ask_names_at, self.draw_at) = (now, now, now);
        self.wants_incidents = true;
    }

    fn connect(&mut self) {
        if self.wants_stop {
            self.send_stop_anew();
            return;
        }
        match self.session.client.reconnect() {
            Ok(()) => self.connected(),
            Err(ClientError::Interrupted { .. }) => {}
            Err(error) => {
                self.live.lost(&error.to_string());
                self.session.client.pause_unconnected(CONNECT_EVERY);
            }
        }
    }

    /// Stops every axis, and says what each stop came to.
    fn stop(&mut self) -> Result<(), Failure> {
        self.view.say("stopping all axes");
        self.draw()?;
        match self.session.client.stop(StopTarget::All) {
            Ok(()) => {
                (self.wants_stop, self.wants_report) = (false, true);
                Ok(())
            }
            Err(error @ ClientError::Gateway(_)) => {
                self.wants_stop = false;
                self.fail_stop(error.into());
                Ok(())
            }
            Err(error) => {
                self.live.lost(&error.to_string());
                self.send_stop_anew();
                Ok(())
            }
        }
    }

    /// Writes the stop over a connection that is opened again; until that succeeds it is wanted.
    fn send_stop_anew(&mut self) {
        let all = StopRequest::Stop(StopTarget::All);
        let sent = stop_before_hello(self.session.client.transport_mut(), all);
        let sent = sent.and_then(|()| {
            (self.wants_stop, self.wants_report) = (false, true);
            self.session.client.reconnect()
        });
        match sent {
            Ok(()) => self.connected(),
            Err(error) if self.wants_stop => self.fail_stop(error.into()),
            Err(error) => self.fail_stop(Failure::StopTaken { cause: error.to_string() }),
        }
    }

    fn fail_stop(&mut self, failure: Failure) {
        self.view.complain(&explain::with_page(&failure));
        let goes_on = [(self.wants_stop, SENT_AGAIN), (self.wants_report, ASKED_AGAIN)];
        let goes_on = goes_on.into_iter().filter(|(wanted, _)| *wanted);
        self.view.message.lines.extend(goes_on.map(|(_, text)| text.to_owned()));
        self.unconfirmed = Some(failure);
        self.draw_at = Duration::ZERO;
    }

    /// Waits for each axis's confirmation, and says so as they come; those that are missing first.
    fn report_stop(&mut self) -> Result<(), Failure> {
        let axes = match self.session.axes_or_all(&[]) {
            Ok(axes) => axes,
            Err(failure) => {
                // A gateway that is slow, or gone, is asked when it answers again.
                self.wants_report = !matches!(
                    failure,
                    Failure::Client(ClientError::Interrupted { .. } | ClientError::Gateway(_))
                );
                if self.wants_report {
                    self.live.lost(&failure.to_string());
                }
                self.fail_stop(Failure::StopTaken { cause: failure.to_string() });
                return Ok(());
            }
        };
        self.wants_report = false;
        let (mut missing, mut confirmed) = (Vec::new(), Vec::new());
        self.unconfirmed = None;
        if axes.is_empty() {
            self.view.say("no axis is configured: there is nothing to stop");
        }
        for axis in axes {
            match commands::outcome_line(&mut self.session, axis) {
                Ok(line) => confirmed.push(line),
                // A key has ended the waiting; what it asks for follows.
                Err(Failure::Client(error @ ClientError::Interrupted { .. })) => {
                    self.fail_stop(Failure::StopTaken { cause: error.to_string() });
                    return Ok(());
                }
                Err(failure) => {
                    missing.push(failure.to_string());
                    self.unconfirmed.get_or_insert(failure);
                }
            }
            self.view.message.is_bad = !missing.is_empty();
            self.view.message.lines = missing.iter().chain(&confirmed).cloned().collect();
            self.draw()?;
        }
        self.ask_at = Duration::ZERO;
        Ok(())
    }

    /// Clears the trip of an axis, and gives authority back.
    fn clear(&mut self, axis: u8) -> Result<(), Failure> {
        self.view.say(&format!("clearing axis {axis}"));
        self.draw()?;
        match commands::clear_axis(&mut self.session, axis) {
            Ok(line) => self.view.say(&line),
            Err(failure) => self.view.complain(&explain::with_page(&failure)),
        }
        // Refused where another host is in command, and that is well.
        let _ = self.session.client.release_authority();
        self.ask_at = Duration::ZERO;
        Ok(())
    }

    fn draw_if_due(&mut self) -> Result<(), Failure> {
        let now = self.session.client.now();
        if now < self.draw_at {
            return Ok(());
        }
        self.draw_at = now + DRAW_EVERY;
        self.draw()
    }

    fn draw(&mut self) -> Result<(), Failure> {
        let (live, view, now) = (&self.live, &self.view, self.session.client.now());
        self.display.show(|width, height| screen::lines(live, view, now, width, height))
    }
}
