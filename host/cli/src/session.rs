//! A command's session with the gateway, and the output it prints to.

use std::time::Duration;

use host_protocol::replies::AxisReport;
use host_protocol::{AxisParameter, AxisState, Error, Event, EventMessage, Value};
use mgw_client::{Client, ClientError, Interrupt, Transport};
use rmd::Dialect;
use serde_json::json;

use crate::args::{MotorTarget, ScanTarget, Typed};
use crate::config;
use crate::failure::Failure;
use crate::faults::{self, Protocols};
use crate::json;
use crate::motor::{Unfinished, unfinished_text};
use crate::names::Names;
use crate::output::Output;
use crate::states;
use crate::words;

/// How long a motor may take to confirm its stop before the command gives up waiting. The gateway
/// does not.
const STOP_PATIENCE: Duration = Duration::from_secs(5);
/// How long an axis is looked at whose time others have taken.
const LAST_LOOKS: Duration = Duration::from_millis(200);
/// Events that are taken before what else is to be done has its turn.
pub const EVENTS_AT_ONCE: usize = 64;
/// Between two looks at an axis that is stopping.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// A client on any transport, and where to print.
pub struct Session {
    pub client: Client<Box<dyn Transport>>,
    pub out: Output,
    /// Once they have been asked for.
    names: Option<Names>,
}

impl Session {
    /// Connects over `transport`; `interrupt` is what ends commands early.
    pub fn on(
        transport: Box<dyn Transport>,
        interrupt: Interrupt,
        out: Output,
    ) -> Result<Self, Failure> {
        let mut session =
            Self { client: Client::connect_heeding(transport, interrupt)?, out, names: None };
        if out.is_heard() {
            session.learn_motors();
            // Without an answer what is shown has numbers only.
            session.names = session.client.names().ok().map(Names::from);
        }
        Ok(session)
    }

    /// Asks what the motors speak. Without an answer faults have numbers only, and what is asked
    /// next tells why.
    pub fn learn_motors(&mut self) {
        if let Ok(axes) = self.client.list_axes() {
            self.out.motors = Protocols::new(&axes);
        }
    }

    /// The names that the gateway has given.
    pub fn names(&mut self) -> Result<&Names, Failure> {
        let names = match self.names.take() {
            Some(names) => names,
            None => self.client.names()?.into(),
        };
        Ok(self.names.insert(names))
    }

    /// The names as far as they are known, without asking for them.
    pub fn known_names(&self) -> Names {
        self.names.clone().unwrap_or_default()
    }

    /// The number of an axis that was typed. The gateway is asked for names only.
    pub fn axis(&mut self, typed: &Typed) -> Result<u8, Failure> {
        match typed {
            Typed::Number(number) => Ok(*number),
            Typed::Name(_) => self.names()?.find_axis(typed),
        }
    }

    /// The same of several.
    pub fn axes(&mut self, typed: &[Typed]) -> Result<Vec<u8>, Failure> {
        typed.iter().map(|typed| self.axis(typed)).collect()
    }

    /// The number of a bus that was typed.
    pub fn bus(&mut self, typed: &Typed) -> Result<u8, Failure> {
        match typed {
            Typed::Number(number) => Ok(*number),
            Typed::Name(_) => self.names()?.find_bus(typed),
        }
    }

    /// The motor that was typed. Where its name is gone, a `mgw motor` that was ended halfway may
    /// have taken it away.
    pub fn motor(&mut self, typed: &MotorTarget<Typed>) -> Result<MotorTarget, Failure> {
        let found = self.named_motor(typed);
        let Err(Failure::Usage(text)) = &found else { return found };
        let running = config::read(&mut self.client)?;
        match Unfinished::new().before(&running) {
            Some(file) => Err(Failure::Usage(format!("{text}. {}", unfinished_text(&file)))),
            None => found,
        }
    }

    fn named_motor(&mut self, typed: &MotorTarget<Typed>) -> Result<MotorTarget, Failure> {
        Ok(match typed {
            MotorTarget::Axis(axis) => MotorTarget::Axis(self.axis(axis)?),
            MotorTarget::Place { bus, protocol, node, bitrate } => MotorTarget::Place {
                bus: self.bus(bus)?,
                protocol: *protocol,
                node: *node,
                bitrate: *bitrate,
            },
        })
    }

    /// The buses that were typed to be scanned.
    pub fn scan_targets(
        &mut self,
        typed: &[ScanTarget<Typed>],
    ) -> Result<Vec<ScanTarget>, Failure> {
        let target = |ScanTarget { bus, bitrates }: &ScanTarget<Typed>| {
            Ok(ScanTarget { bus: self.bus(bus)?, bitrates: bitrates.clone() })
        };
        typed.iter().map(target).collect()
    }

    /// The axes that were typed, or all configured ones.
    pub fn axes_or_all(&mut self, typed: &[Typed]) -> Result<Vec<u8>, Failure> {
        if !typed.is_empty() {
            return self.axes(typed);
        }
        Ok(self.client.list_axes()?.iter().map(|axis| axis.axis).collect())
    }

    /// The dialect that an axis states, also by its default.
    pub fn stated_dialect(&mut self, axis: u8) -> Result<Option<Dialect>, ClientError> {
        let stated = self.client.read_axis_parameter(axis, AxisParameter::RmdDialect)?;
        Ok(stated.and_then(Value::as_unsigned).and_then(Dialect::from_number))
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
                    text: format!(
                        "axis {axis} is not configured: {so}; `mgw axes` lists those that are"
                    ),
                });
            }
        }
        Ok(())
    }

    /// Prints the states of these axes. Of several one that cannot be read, half configured for
    /// example, hides no other.
    pub fn print_states(&mut self, axes: &[u8]) -> Result<(), Failure> {
        let (mut reports, mut unread) = (Vec::new(), Vec::new());
        for axis in axes {
            match self.client.read_state_when_free(*axis) {
                Ok(report) => reports.push(report),
                Err(ClientError::Gateway(error)) if axes.len() > 1 => unread.push((*axis, error)),
                Err(error) => return Err(error.into()),
            }
        }
        let motors = self.out.motors;
        let names = self.known_names();
        if axes.is_empty() {
            self.out.text("no axis is configured")?;
            return self.out.object(&json!({ "axes": [] }));
        }
        self.out.table(&states::table(&reports, &motors, &names))?;
        self.explain_faults(&reports)?;
        for (axis, error) in &unread {
            let why = Failure::from(ClientError::Gateway(*error));
            self.out.text(format!("axis {axis} is not read: {why}"))?;
        }
        let unread = unread
            .iter()
            .map(|(axis, error)| json!({ "axis": axis, "error": json::snake(error.name()) }));
        let read = reports.iter().map(|report| {
            let object = json::axis::report(report, motors.of(report.axis));
            json::with_name(object, names.axis(report.axis))
        });
        self.out.object(&json!({ "axes": read.chain(unread).collect::<Vec<_>>() }))
    }

    /// Says in words what the fault words mean.
    fn explain_faults(&self, reports: &[AxisReport]) -> Result<(), Failure> {
        for report in reports {
            let word = report.faults.map_or(0, |faults| faults.word);
            let protocol = self.out.motors.of(report.axis);
            for line in protocol.into_iter().flat_map(|p| faults::explain(report.axis, p, word)) {
                self.out.text(line)?;
            }
        }
        Ok(())
    }

    /// When a stop that was just taken has had its time to be confirmed.
    pub fn stops_until(&self) -> Duration {
        self.client.now() + STOP_PATIENCE
    }

    /// Waits until the stop of an axis is confirmed, or a trip's is, keeping the link alive
    /// meanwhile; until `end`, and a few looks where others have taken the time until then.
    pub fn await_stop(&mut self, axis: u8, end: Duration) -> Result<AxisReport, Failure> {
        let end = end.max(self.client.now() + LAST_LOOKS);
        loop {
            match self.client.read_state(axis) {
                Ok(report) if !is_stopping(report.state) => return Ok(report),
                // Another host is asking it, or the line loses what is asked.
                Ok(_)
                | Err(ClientError::Gateway(Error::Busy { .. }) | ClientError::NoAnswer { .. }) => {}
                // The stop was taken, and nothing will be heard of it, or nobody waits for it any more.
                Err(
                    ClientError::Transport(_)
                    | ClientError::Interrupted { .. }
                    | ClientError::Gateway(Error::GatewayAway {} | Error::NoSession {}),
                ) => {
                    return Err(Failure::StopNotConfirmed { axis });
                }
                Err(error) => return Err(error.into()),
            }
            if self.client.now() >= end {
                return Err(Failure::StopNotConfirmed { axis });
            }
            match self.client.pause(LOOK_AGAIN) {
                Err(ClientError::Interrupted { .. }) => {
                    return Err(Failure::StopNotConfirmed { axis });
                }
                paused => paused?,
            }
        }
    }
}

/// Prints an event.
pub fn print_event(event: &EventMessage, out: Output) -> Result<(), Failure> {
    out.either(words::event(event, &out.motors), &json::event(event, &out.motors))
}

/// Prints the events that wait, and returns the trip of one of `axes`, if there is one among them.
pub fn print_events<T: Transport>(
    client: &mut Client<T>,
    axes: &[u8],
    out: Output,
) -> Result<Option<Failure>, Failure> {
    let mut tripped = None;
    // If they come without end, what else is to be done has its turn all the same.
    for _ in 0..EVENTS_AT_ONCE {
        let Some(event) = client.poll_event(Duration::ZERO)? else { break };
        print_event(&event, out)?;
        tripped = tripped.or(trip_of(&event.event, axes, out.motors));
    }
    Ok(tripped)
}

/// The trip of one of `axes`, if this is one.
pub fn trip_of(event: &Event, axes: &[u8], motors: Protocols) -> Option<Failure> {
    match event {
        Event::Tripped { axis, trip } if axes.contains(axis) => {
            Some(Failure::tripped(*axis, trip, motors))
        }
        _ => None,
    }
}

/// Whether the gateway is still at work to stop it.
fn is_stopping(state: AxisState) -> bool {
    matches!(state, AxisState::Stopping | AxisState::Tripped { confirmed: false })
}
