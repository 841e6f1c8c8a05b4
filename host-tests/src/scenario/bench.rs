//! What a scenario runs on: one host, the gateway, four motors, and a record of all that went over the buses.

use host_protocol::replies::AxisReport;
use host_protocol::{Bytes, Event, EventMessage, MAX_CAN_DATA, Setpoint};
use mgw_client::{Client, ClientError};
use mgw_sim::{SimTransport, TraceEntry, Wiring, World};
use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

/// How often a host that is alive says something.
const HOST_PERIOD: Duration = Duration::from_millis(10);

/// How long a setpoint lives: a little less than the default TTL of an axis, which it must not exceed.
pub const SETPOINT_TTL: Duration = Duration::from_millis(90);

/// A host at a simulated gateway.
pub struct Bench {
    pub world: Rc<RefCell<World>>,
    pub client: Client<SimTransport>,
    /// The epoch of each armed axis.
    pub epochs: Vec<(u8, u32)>,
    /// Setpoints that the host keeps fresh.
    pub kept: Vec<(u8, Setpoint)>,
    pub events: Vec<Event>,
    /// Samples with the gateway time at which they were taken, µs.
    pub samples: Vec<(u64, Event)>,
    /// What the motor answered to the last native command.
    pub native_reply: Bytes<MAX_CAN_DATA>,
    /// Where the last relative move goes, rad.
    pub move_target_rad: Option<f32>,
    pub trace: Vec<TraceEntry>,
    /// The time of the last `mark`, µs: frames count from there.
    pub mark_us: u64,
}

impl Bench {
    pub fn new() -> Result<Self, String> {
        let world = Rc::new(RefCell::new(World::new(Wiring::four_motors())));
        let client = Client::connect(SimTransport::new(world.clone(), 0)).map_err(|e| e.to_string())?;
        Ok(Self {
            world,
            client,
            epochs: Vec::new(),
            kept: Vec::new(),
            events: Vec::new(),
            samples: Vec::new(),
            native_reply: Bytes::new(),
            move_target_rad: None,
            trace: Vec::new(),
            mark_us: 0,
        })
    }

    pub fn now_us(&self) -> u64 {
        self.world.borrow().now().as_micros()
    }

    /// Time passes while the host is alive: it pings, and keeps its setpoints fresh until they are refused.
    pub fn run(&mut self, time: Duration) -> Result<(), String> {
        let end = self.client.now() + time;
        loop {
            self.refresh()?;
            self.client.ping().map_err(|e| e.to_string())?;
            let rest = end.saturating_sub(self.client.now());
            if rest.is_zero() {
                return Ok(());
            }
            self.silence(rest.min(HOST_PERIOD));
        }
    }

    /// Time passes and the host says nothing.
    pub fn silence(&mut self, time: Duration) {
        use mgw_client::Transport;
        self.client.transport_mut().sleep(time);
        self.collect();
    }

    fn refresh(&mut self) -> Result<(), String> {
        for (axis, setpoint) in self.kept.clone() {
            match self.set(axis, setpoint) {
                Ok(()) => {}
                Err(ClientError::Gateway(_)) => self.kept.retain(|(kept, _)| *kept != axis),
                Err(error) => return Err(error.to_string()),
            }
        }
        Ok(())
    }

    /// One setpoint that lives for [`SETPOINT_TTL`].
    pub fn set(&mut self, axis: u8, setpoint: Setpoint) -> Result<(), ClientError> {
        self.client.set(axis, self.epoch(axis), setpoint, SETPOINT_TTL)
    }

    /// The epoch of an axis; 0 before it was armed.
    pub fn epoch(&self, axis: u8) -> u32 {
        self.epochs.iter().find(|(armed, _)| *armed == axis).map_or(0, |(_, epoch)| *epoch)
    }

    pub fn state(&mut self, axis: u8) -> Result<AxisReport, String> {
        let report = self.client.read_state(axis).map_err(|e| e.to_string());
        self.collect();
        report
    }

    /// Takes over what has happened.
    pub fn collect(&mut self) {
        self.trace.extend(self.world.borrow_mut().trace());
        while let Ok(Some(EventMessage { event, time_us, .. })) = self.client.poll_event(Duration::ZERO) {
            match event {
                Event::Sample { .. } => self.samples.push((time_us, event)),
                _ => self.events.push(event),
            }
        }
    }

    /// Frames on a bus since the mark, as text with the time of their first bit.
    pub fn wire(&self, bus: u8) -> impl Iterator<Item = (u64, String)> {
        self.trace
            .iter()
            .filter(move |entry| entry.bus == bus && entry.time_us >= self.mark_us)
            .map(|entry| (entry.time_us, entry.wire.to_string()))
    }

    /// The last of what happened, for the message of a failure.
    pub fn story(&self) -> String {
        let from = self.trace.len().saturating_sub(20);
        let frames = self.trace.iter().skip(from);
        let frames: Vec<String> = frames
            .map(|e| format!("    {:>10} µs  bus {}  {:?}  {}", e.time_us, e.bus, e.from, e.wire))
            .collect();
        format!("  at {} µs; last frames:\n{}\n  events: {:?}", self.now_us(), frames.join("\n"), self.events)
    }
}
