//! An axis of a live view.

use std::time::Duration;

use host_protocol::{
    AxisState, AxisSummary, Event, FaultReading, Incident, Protocol, Reading, StateField,
    TripReason,
};

/// An axis, its state, and what it told last.
#[derive(Debug, Clone)]
pub struct Axis {
    /// Its number.
    pub number: u8,
    /// Its name.
    pub name: Option<String>,
    /// What its motor speaks.
    pub protocol: Option<Protocol>,
    /// Its state.
    pub state: AxisState,
    /// Why it tripped, while it is tripped and that is known.
    pub trip: Option<TripReason>,
    sample: Option<(Duration, Event)>,
}

impl Axis {
    /// As it is listed.
    pub fn new(summary: &AxisSummary) -> Self {
        Self {
            number: summary.axis,
            name: None,
            protocol: summary.protocol,
            state: summary.state,
            trip: None,
            sample: None,
        }
    }

    /// As it is listed now.
    pub fn list(&mut self, summary: &AxisSummary) {
        self.protocol = summary.protocol;
        self.set_state(summary.state);
    }

    /// Nothing that it told before counts.
    pub fn restart(&mut self) {
        (self.sample, self.trip) = (None, None);
    }

    /// Takes an event that is about it.
    pub fn take(&mut self, event: &Event, now: Duration) {
        match event {
            Event::Sample { state, .. } => {
                self.set_state(*state);
                self.sample = Some((now, *event));
            }
            Event::Tripped { trip, .. } => {
                self.state = AxisState::Tripped { confirmed: false };
                self.trip = Some(trip.reason);
            }
            Event::StateChanged { state, .. } => self.set_state(*state),
            Event::StopConfirmed { .. } if self.is_tripped() => {
                self.state = AxisState::Tripped { confirmed: true };
            }
            _ => {}
        }
    }

    /// Takes the reason of its trip from what the gateway remembers, the latest first, where nobody
    /// has told it.
    pub fn explain(&mut self, incidents: &[Incident]) {
        if !self.is_tripped() || self.trip.is_some() {
            return;
        }
        self.trip = incidents.iter().find_map(|incident| match incident {
            Incident::Tripped { axis, trip, .. } if *axis == self.number => Some(trip.reason),
            _ => None,
        });
    }

    /// Whether it is tripped.
    pub fn is_tripped(&self) -> bool {
        matches!(self.state, AxisState::Tripped { .. })
    }

    /// Whether its trip is still to be explained.
    pub fn is_unexplained(&self) -> bool {
        self.is_tripped() && self.trip.is_none()
    }

    /// The number of a field, with its age now.
    pub fn reading(&self, field: StateField, now: Duration) -> Option<Reading> {
        let (at, sample) = self.sample.as_ref()?;
        let reading = sample.reading(field)?;
        Some(Reading { value: reading.value, age_us: aged(reading.age_us, *at, now) })
    }

    /// The fault word, with its age now.
    pub fn faults(&self, now: Duration) -> Option<FaultReading> {
        let (at, Event::Sample { faults, .. }) = self.sample.as_ref()? else { return None };
        let faults = (*faults)?;
        Some(FaultReading { age_us: aged(faults.age_us, *at, now), ..faults })
    }

    /// The age of the youngest thing that the motor has told, µs.
    pub fn age_us(&self, now: Duration) -> Option<u32> {
        let (at, sample) = self.sample.as_ref()?;
        crate::states::youngest_us(sample).map(|age_us| aged(age_us, *at, now))
    }

    fn set_state(&mut self, state: AxisState) {
        self.state = state;
        if !self.is_tripped() {
            self.trip = None;
        }
    }
}

/// How old something is that was so old when it came.
fn aged(age_us: u32, came: Duration, now: Duration) -> u32 {
    let since = u32::try_from(now.saturating_sub(came).as_micros()).unwrap_or(u32::MAX);
    age_us.saturating_add(since)
}
