//! What a scenario runs on: hosts, the gateway, motors, and a record of all that went over the
//! buses.

use host_protocol::replies::AxisReport;
use host_protocol::{
    Bytes, Call, CycleEvent, CycleState, Error, Event, EventMessage, MAX_CAN_DATA, Setpoint,
};
use mgw_client::{Client, ClientError, MOTOR_DEADLINE, Transport};
use mgw_sim::{Injection, SimTransport, TraceEntry, Wiring, World};
use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;
use std::time::Duration;

/// How often a host that is alive says something, µs: each time another pause.
const HOST_PERIOD_US: Range<u64> = 4_000..10_000;
/// How long a host hesitates before a step, µs.
const HESITATION_US: Range<u64> = 0..1_000;
/// How much later than at its best a motor may answer, µs. Well within the reply window of 5 ms.
const REPLY_JITTER_US: Range<u64> = 0..1_500;

/// How long a setpoint lives: a little less than the default TTL of an axis, which it must not
/// exceed.
pub const SETPOINT_TTL: Duration = Duration::from_millis(90);

/// Something that a gateway said without being asked.
#[derive(Debug, Clone, Copy)]
pub struct Told {
    /// The host link it said it on.
    pub link: u8,
    /// When, µs since the world began.
    pub time_us: u64,
    /// What.
    pub event: Event,
}

/// Hosts at a simulated gateway.
pub struct Bench {
    pub world: Rc<RefCell<World>>,
    /// The host that the steps speak of, and its link.
    pub client: Client<SimTransport>,
    pub link: u8,
    /// The hosts on other links.
    pub others: Vec<(u8, Client<SimTransport>)>,
    /// The epoch of each armed axis.
    pub epochs: Vec<(u8, u32)>,
    /// Setpoints that the host keeps fresh.
    pub kept: Vec<(u8, Setpoint)>,
    pub events: Vec<Told>,
    pub samples: Vec<Told>,
    /// What the motor answered to the last native command.
    pub native_reply: Bytes<MAX_CAN_DATA>,
    /// The states at the end of the last cycle.
    pub cycled: Vec<CycleState>,
    /// The periods of the free-running cycle that this host was told of, and when, µs.
    pub periods: Vec<(u64, CycleEvent)>,
    /// The last error that a step was refused with.
    pub refusal: Option<Error>,
    /// Where the last relative move goes, rad.
    pub move_target_rad: Option<f32>,
    /// How long an answer is awaited; `None`: as long as it may take.
    pub patience: Option<Duration>,
    /// Frames that a host which hangs has not got rid of yet.
    pub backlog: Vec<u8>,
    pub trace: Vec<TraceEntry>,
    /// The time of the last `mark`, µs: frames count from there.
    pub mark_us: u64,
    /// Where each shaft was then, rad.
    pub mark_rad: Vec<f64>,
    /// About when something was missed, µs.
    pub focus_us: Option<u64>,
    pub random: fastrand::Rng,
    just_marked: bool,
}

impl Bench {
    pub fn new(wiring: Wiring, seed: u64) -> Result<Self, String> {
        let motors = wiring.motors.len();
        let mut random = fastrand::Rng::with_seed(seed);
        // The client library draws the numbers of its further sessions.
        fastrand::seed(seed);
        let world = Rc::new(RefCell::new(World::try_new(wiring).map_err(|e| e.to_string())?));
        for motor in 0..motors {
            let jitter = Duration::from_micros(random.u64(REPLY_JITTER_US));
            world.borrow_mut().inject(motor, Injection::ReplyJitter(jitter));
        }
        let client = connect(&world, 0, &mut random)?;
        Ok(Self {
            world,
            client,
            link: 0,
            others: Vec::new(),
            epochs: Vec::new(),
            kept: Vec::new(),
            events: Vec::new(),
            samples: Vec::new(),
            native_reply: Bytes::new(),
            cycled: Vec::new(),
            periods: Vec::new(),
            refusal: None,
            move_target_rad: None,
            patience: None,
            backlog: Vec::new(),
            trace: Vec::new(),
            mark_us: 0,
            mark_rad: vec![0.0; motors],
            focus_us: None,
            random,
            just_marked: false,
        })
    }

    /// The client of a link, which is connected the first time it is asked for.
    pub fn take_other(&mut self, link: u8) -> Result<Client<SimTransport>, String> {
        match self.others.iter().position(|(other, _)| *other == link) {
            Some(at) => Ok(self.others.swap_remove(at).1),
            None => connect(&self.world, link, &mut self.random),
        }
    }

    pub fn now_us(&self) -> u64 {
        self.world.borrow().now().as_micros()
    }

    /// The host hesitates a little before a step, but not between a mark and what is measured from
    /// it.
    pub fn think(&mut self, words: &[&str]) {
        let does_something = !matches!(words.first(), Some(&"expect" | &"mark" | &"await"));
        if does_something && !std::mem::take(&mut self.just_marked) {
            let pause = self.random.u64(HESITATION_US);
            self.silence(Duration::from_micros(pause));
        }
    }

    pub fn mark(&mut self) {
        self.just_marked = true;
        self.mark_us = self.now_us();
        self.mark_rad =
            self.world.borrow().motors().iter().map(mgw_sim::Motor::position_rad).collect();
    }

    /// Asks the gateway for something.
    pub fn ask<C: Call>(&mut self, request: &C) -> Result<C::Reply, ClientError> {
        self.client.request_within(request, self.patience.unwrap_or(MOTOR_DEADLINE))
    }

    /// Time passes while the host is alive: it pings, and keeps its setpoints fresh until they are
    /// refused.
    pub fn run(&mut self, time: Duration) -> Result<(), String> {
        let end = self.client.now() + time;
        loop {
            self.refresh()?;
            self.client.ping().map_err(|e| e.to_string())?;
            let rest = end.saturating_sub(self.client.now());
            if rest.is_zero() {
                return Ok(());
            }
            let pause = self.random.u64(HOST_PERIOD_US);
            self.silence(rest.min(Duration::from_micros(pause)));
        }
    }

    /// Time passes and the host says nothing.
    pub fn silence(&mut self, time: Duration) {
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
        let (link, started_us) = (self.link, self.world.borrow().gateway_started().as_micros());
        while let Ok(Some(EventMessage { event, time_us, .. })) =
            self.client.poll_event(Duration::ZERO)
        {
            let told = Told { link, time_us: started_us + time_us, event };
            match event {
                Event::Sample { .. } => self.samples.push(told),
                _ => self.events.push(told),
            }
        }
        while let Ok(Some(message)) = self.client.poll_cycle(Duration::ZERO) {
            self.periods.push((started_us + message.time_us, message.event));
        }
    }
}

fn connect(
    world: &Rc<RefCell<World>>,
    link: u8,
    random: &mut fastrand::Rng,
) -> Result<Client<SimTransport>, String> {
    let transport = SimTransport::new(world.clone(), link);
    Client::connect_as(transport, random.u32(..), random.u16(..)).map_err(|e| e.to_string())
}
