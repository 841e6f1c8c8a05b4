//! One that looks on at the gateway itself, over a link of its own, and notes when it hears what.

use std::error::Error;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use mgw_client::host_protocol::{AxisState, Event};
use mgw_client::{Client, Losses, open};

use crate::programs::AXIS;

#[derive(Default)]
struct Heard {
    events: Vec<(Instant, Event)>,
    state: Option<AxisState>,
    losses: Losses,
    failure: Option<String>,
}

/// The one that looks on.
pub struct Witness(Arc<Mutex<Heard>>);

impl Witness {
    pub fn new(gateway: &str) -> Result<Self, Box<dyn Error>> {
        let mut client = Client::connect(open(gateway)?)?;
        let state = Some(client.read_state(AXIS)?.state);
        let heard = Arc::new(Mutex::new(Heard { state, ..Heard::default() }));
        let notes = heard.clone();
        thread::spawn(move || {
            loop {
                let told = client.poll_event(Duration::from_millis(20));
                let told = told.and_then(|told| client.keep_alive().map(|()| told));
                let Ok(mut heard) = notes.lock() else { return };
                heard.losses = client.losses();
                match told {
                    Ok(Some(message)) => {
                        if let Event::StateChanged { axis: AXIS, state } = message.event {
                            heard.state = Some(state);
                        }
                        heard.events.push((Instant::now(), message.event));
                    }
                    Ok(None) => {}
                    Err(error) => {
                        heard.failure = Some(error.to_string());
                        return;
                    }
                }
            }
        });
        Ok(Self(heard))
    }

    /// The state of the axis.
    pub fn state(&self) -> Option<AxisState> {
        self.0.lock().ok()?.state
    }

    /// The first event since then that it is.
    pub fn since<T>(
        &self,
        then: Instant,
        is_it: impl Fn(&Event) -> Option<T>,
    ) -> Option<(Instant, T)> {
        let heard = self.0.lock().ok()?;
        let later = heard.events.iter().rev().take_while(|(at, _)| *at >= then);
        later.filter_map(|(at, event)| Some((*at, is_it(event)?))).last()
    }

    /// It has heard everything.
    pub fn check(&self) -> Result<(), Box<dyn Error>> {
        let heard = self.0.lock().map_err(|_| "the witness has failed")?;
        match (&heard.failure, heard.losses.events_lost) {
            (None, 0) => Ok(()),
            (failure, lost) => Err(format!("the witness lost {lost} events, {failure:?}").into()),
        }
    }
}
