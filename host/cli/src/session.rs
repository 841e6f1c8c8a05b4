//! A command's session with the gateway, and the output it prints to.

use std::ops::ControlFlow;
use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisParameter, AxisState, Error, Event, EventMessage};
use mgw_client::{Client, ClientError, Interrupt, Transport, open};
use serde_json::json;

use crate::failure::Failure;
use crate::interrupt;
use crate::json;
use crate::output::{Output, to_json};
use crate::states;
use crate::words;

/// How long a motor may take to confirm its stop before the command gives up waiting. The gateway does not.
const STOP_PATIENCE: Duration = Duration::from_secs(5);
/// Between two looks at an axis that is stopping.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// A client on any transport, and where to print.
pub struct Session {
    pub client: Client<Box<dyn Transport>>,
    pub out: Output,
    /// Whether signals raise the interrupt of the client.
    hears_signals: bool,
}

impl Session {
    /// Opens the port that the user named.
    pub fn open(port: Option<&str>, out: Output) -> Result<Self, Failure> {
        let port = port.ok_or_else(|| {
            Failure::Usage(
                "which gateway? Add --port DEVICE or --port tcp:HOST:PORT, or set MGW_PORT. `mgw sim` starts a simulated one"
                    .to_owned(),
            )
        })?;
        let session = Self::on(Box::new(open(port)?), Interrupt::default(), out)?;
        Ok(Self { hears_signals: true, ..session })
    }

    /// Connects over `transport`; `interrupt` is what ends commands early.
    pub fn on(transport: Box<dyn Transport>, interrupt: Interrupt, out: Output) -> Result<Self, Failure> {
        let mut client = Client::connect(transport)?;
        client.heed(interrupt);
        Ok(Self { client, out, hears_signals: false })
    }

    /// From here on Ctrl-C is noted instead of ending the process.
    pub fn note_interrupts(&self) {
        if self.hears_signals {
            interrupt::note(self.client.interrupt());
        }
    }

    /// The axes that were named, or all configured ones.
    pub fn axes_or_all(&mut self, named: &[u8]) -> Result<Vec<u8>, Failure> {
        if !named.is_empty() {
            return Ok(named.to_vec());
        }
        Ok(self.client.list_axes()?.iter().map(|axis| axis.axis).collect())
    }

    /// Refuses axes of which not one parameter is set, with what follows from that.
    pub fn refuse_unconfigured(&mut self, axes: &[u8], so: &str) -> Result<(), Failure> {
        let configured = self.client.list_axes()?;
        let max_axes = self.client.hello().max_axes;
        for axis in axes.iter().copied() {
            if axis >= max_axes {
                return Err(ClientError::Gateway(Error::UnknownAxis { axis, max_axes }).into());
            }
            if !configured.iter().any(|summary| summary.axis == axis) {
                return Err(Failure::Explained {
                    error: Error::NotConfigured { axis, parameter: AxisParameter::Bus.number() },
                    text: format!("axis {axis} is not configured: {so}; `mgw axes` lists those that are"),
                });
            }
        }
        Ok(())
    }

    /// Prints the events that wait, and returns the trip of one of `axes`, if there is one among them.
    pub fn print_events(&mut self, axes: &[u8]) -> Result<Option<Failure>, Failure> {
        print_events(&mut self.client, axes, self.out)
    }

    /// Prints the states of these axes. Of several one that cannot be read, half configured for example, hides no other.
    pub fn print_states(&mut self, axes: &[u8]) -> Result<(), Failure> {
        let (mut reports, mut unread) = (Vec::new(), Vec::new());
        for axis in axes {
            match self.client.read_state_when_free(*axis) {
                Ok(report) => reports.push(report),
                Err(ClientError::Gateway(error)) if axes.len() > 1 => unread.push((*axis, error)),
                Err(error) => return Err(error.into()),
            }
        }
        self.out.table(&states::table(&reports))?;
        for (axis, error) in &unread {
            self.out.text(format!("axis {axis} is not read: {error}"))?;
        }
        let unread = unread.iter().map(|(axis, error)| json!({ "axis": axis, "error": error.name() }));
        self.out.object(&json!({ "axes": reports.iter().map(to_json).chain(unread).collect::<Vec<_>>() }))
    }

    /// Waits until the stop of an axis is confirmed, or a trip's is, keeping the link alive meanwhile.
    pub fn await_stop(&mut self, axis: u8) -> Result<AxisReport, Failure> {
        let end = self.client.now() + STOP_PATIENCE;
        loop {
            let report = self.client.read_state_when_free(axis)?;
            if !is_stopping(report.state) {
                return Ok(report);
            }
            if self.client.now() >= end {
                return Err(Failure::StopNotConfirmed { axis });
            }
            self.client.transport_mut().sleep(LOOK_AGAIN);
        }
    }
}

/// Prints an event.
pub fn print_event(event: &EventMessage, out: Output) -> Result<(), Failure> {
    out.either(words::event(event), &json::event(event))
}

/// Prints the events that wait, and returns the trip of one of `axes`, if there is one among them.
pub fn print_events<T: Transport>(
    client: &mut Client<T>,
    axes: &[u8],
    out: Output,
) -> Result<Option<Failure>, Failure> {
    let mut tripped = None;
    while let Some(event) = client.poll_event(Duration::ZERO)? {
        print_event(&event, out)?;
        if let Event::Tripped { axis, trip } = &event.event
            && axes.contains(axis)
        {
            tripped.get_or_insert(Failure::Tripped { axis: *axis, reason: words::trip_reason(&trip.reason) });
        }
    }
    Ok(tripped)
}

/// Whether the gateway is still at work to stop it.
fn is_stopping(state: AxisState) -> bool {
    matches!(state, AxisState::Stopping | AxisState::Tripped { confirmed: false })
}

/// How the rounds of a hold go on: until the user or an earlier failure ends it.
pub fn go_on<T: Transport>(
    client: &Client<T>,
    failure: Option<&Failure>,
) -> Result<ControlFlow<()>, ClientError> {
    Ok(if failure.is_some() || client.interrupt().is_raised() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    })
}
