//! A gateway at full load, whatever runs it: nothing is lost, nothing comes twice, no queue grows,
//! and all who count agree.
//!
//! RMDs on all buses in a free-running cycle, and a host that gives all of them new setpoints beside
//! it, as often as each hundredth of a second. The simulator runs it for hours (`long_run`), the
//! virtual board for seconds (its `full_load`).

use std::fmt;
use std::time::Duration;

use host_protocol::{
    AxisParameter, BusCounters, CycleResult, GatewayParameter, Overruns, Protocol, ProtocolSet,
    StateField, StateFields, StopAction, StopTarget, Value,
};
use mgw_client::{AxisSetpoint, Client, Transport, make_velocity};
use mgw_sim::MotorWiring;

/// What a motor takes to begin its reply.
pub const REPLY_TIME: Duration = Duration::from_micros(100);
/// How often the host gives all axes new setpoints.
const SETPOINTS_EVERY: Duration = Duration::from_millis(10);
const TTL: Duration = Duration::from_millis(150);
const TTL_US: u32 = 200_000;
const LINK_SILENCE_US: u32 = 1_000_000;
const MOTOR_TIMEOUT_MS: u32 = 1_000;
const REPLY_WINDOW: Duration = Duration::from_millis(5);
const FIELDS: StateFields =
    StateFields::of(&[StateField::Position, StateField::Velocity, StateField::Current]);
/// So many setpoints may be answered in a later period only: a poll of 236 µs between those of a
/// bus, of which there are some 40 a second, puts off what is behind it for a few periods.
const UNANSWERED_PERCENT: u64 = 15;
/// What a cycle of the host may take, its time on the line included.
const CYCLE_TAKES: Duration = Duration::from_millis(8);

/// Until all motors are at rest.
const REST: Duration = Duration::from_millis(20);

/// A bus with as many RMDs as it has time for.
#[derive(Debug, Clone, Copy)]
pub struct FullBus {
    /// Its index.
    pub bus: u8,
    /// Its rate.
    pub bitrate: u32,
    /// How many RMDs are there, of node 1 on.
    pub motors: u8,
}

impl FullBus {
    /// Its motors.
    pub fn motors(self) -> impl Iterator<Item = MotorWiring> {
        let Self { bus, bitrate, motors } = self;
        let protocol = Protocol::Rmd;
        (1..=motors).map(move |node| MotorWiring { bus, protocol, node, bitrate, can_id: None })
    }
}

/// What came of it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    /// Virtual time.
    pub lasted: Duration,
    /// Cycles that the host asked for and that were answered.
    pub cycles: u64,
    /// What the slowest of them took.
    pub slowest_cycle: Duration,
    /// Periods of the gateway's own cycle.
    pub periods: u64,
    /// Those that the host was told of.
    pub told: u64,
    /// The latest begin of one, µs.
    pub late_us: u32,
    /// Setpoints of axes that were answered in their period.
    pub answered: u64,
    /// Those that were not.
    pub unanswered: u64,
    /// As the gateway counts them.
    pub overruns: Overruns,
    /// Frames that the gateway sent.
    pub transmitted: u64,
    /// Frames that it heard.
    pub received: u64,
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Overruns { bus, motor, host, gateway } = self.overruns;
        write!(
            f,
            "{:.2} s: {} frames sent, {} heard; {} periods, {} told, {} us late at most; \
             {} setpoints answered in their period, {} later; overruns: bus {bus}, motor {motor}, \
             host {host}, gateway {gateway}; {} cycles beside, the slowest {} us",
            self.lasted.as_secs_f64(),
            self.transmitted,
            self.received,
            self.periods,
            self.told,
            self.late_us,
            self.answered,
            self.unanswered,
            self.cycles,
            self.slowest_cycle.as_micros(),
        )
    }
}

/// The host, and what it was told.
pub struct FullLoad<T: Transport> {
    client: Client<T>,
    buses: Vec<FullBus>,
    period: Duration,
    epoch: u32,
    setpoints: Vec<AxisSetpoint>,
    begun: Duration,
    next_setpoints: Duration,
    /// The period that was told of last.
    told: Option<u32>,
    /// What the gateway counted when it began.
    before: Vec<BusCounters>,
    /// What came of it until now.
    pub tally: Tally,
}

type Result<T, E = String> = std::result::Result<T, E>;

fn text(error: impl fmt::Display) -> String {
    error.to_string()
}

impl<T: Transport> FullLoad<T> {
    /// Configures and arms all motors, and gives them their first setpoints; the cycle has not
    /// begun.
    ///
    /// # Errors
    /// What was refused or lost.
    pub fn set_up(
        mut client: Client<T>,
        baud: u32,
        buses: Vec<FullBus>,
        period: Duration,
    ) -> Result<Self> {
        client.set_baud(baud).map_err(text)?;
        let silence = Value::Unsigned(LINK_SILENCE_US);
        client.configure_gateway(GatewayParameter::LinkSilenceUs, silence).map_err(text)?;
        let mut axes = Vec::new();
        for FullBus { bus, bitrate, motors } in buses.iter().copied() {
            let protocols = ProtocolSet::of(&[Protocol::Rmd]);
            client.configure_bus(bus, bitrate, protocols, false, REPLY_WINDOW).map_err(text)?;
            for node in 1..=motors {
                let axis = u8::try_from(axes.len()).map_err(text)?;
                axes.push(axis);
                for (parameter, value) in [
                    (AxisParameter::Bus, bus.into()),
                    (AxisParameter::Protocol, Protocol::Rmd.into()),
                    (AxisParameter::Node, node.into()),
                    (AxisParameter::StopAction, StopAction::Coast.into()),
                    (AxisParameter::TtlUs, TTL_US),
                ] {
                    let value = Value::Unsigned(value);
                    client.configure_axis(axis, parameter, value).map_err(text)?;
                }
                client.provision_motor_timeout(axis, MOTOR_TIMEOUT_MS).map_err(text)?;
            }
        }
        let epoch = client.arm_together(&axes).map_err(text)?;
        let setpoints = axes.iter().map(|axis| make_velocity(*axis, 1.0)).collect();
        let (begun, next_setpoints, told, before) = (client.now(), client.now(), None, Vec::new());
        let tally = Tally::default();
        let mut load = Self {
            client,
            buses,
            period,
            epoch,
            setpoints,
            begun,
            next_setpoints,
            told,
            before,
            tally,
        };
        load.cycle()?;
        load.client.pause(SETPOINTS_EVERY).map_err(text)?;
        while load.client.poll_event(Duration::ZERO).map_err(text)?.is_some() {}
        Ok(load)
    }

    /// Begins the cycle. What the wires have carried before does not count.
    ///
    /// # Errors
    /// What was refused or lost.
    pub fn begin(&mut self) -> Result<()> {
        self.before = self.counters()?;
        (self.begun, self.next_setpoints) = (self.client.now(), self.client.now());
        let axes: Vec<u8> = self.setpoints.iter().map(|setpoint| setpoint.axis).collect();
        self.client.run_cycle(&axes, FIELDS, self.period).map_err(text)
    }

    /// Lasts until so long behind the begin.
    ///
    /// # Errors
    /// What was lost, came twice or took too long.
    pub fn last_until(&mut self, duration: Duration) -> Result<()> {
        while self.client.now() < self.begun + duration {
            self.next_setpoints += SETPOINTS_EVERY;
            self.cycle()?;
            self.hear()?;
            let rest = self.next_setpoints.saturating_sub(self.client.now());
            self.client.pause(rest).map_err(text)?;
            self.hear()?;
        }
        self.tally.lasted = self.client.now().saturating_sub(self.begun);
        Ok(())
    }

    /// A cycle that the host asks for beside the gateway's own.
    fn cycle(&mut self) -> Result<()> {
        let begin = self.client.now();
        let turn = self.tally.cycles % 100;
        for of in &mut self.setpoints {
            *of = make_velocity(of.axis, 1.0 + turn as f32 / 100.0);
        }
        let states = self.client.cycle(self.epoch, &self.setpoints, FIELDS, TTL);
        for state in states.map_err(|error| format!("a cycle: {error}"))? {
            match state.result {
                CycleResult::Answered | CycleResult::Superseded => {}
                result => return Err(format!("a cycle: axis {}: {result}", state.axis)),
            }
        }
        self.tally.cycles += 1;
        let took = self.client.now().saturating_sub(begin);
        self.tally.slowest_cycle = self.tally.slowest_cycle.max(took);
        Ok(())
    }

    /// Takes what was told of periods.
    fn hear(&mut self) -> Result<()> {
        while let Some(message) = self.client.poll_cycle(Duration::ZERO).map_err(text)? {
            let event = message.event;
            if message.dropped != 0 {
                return Err(format!("{} events were lost", message.dropped));
            }
            if self.told.is_some_and(|before| event.period <= before) {
                return Err(format!("period {} behind {:?}", event.period, self.told));
            }
            for state in event.states() {
                match state.result {
                    CycleResult::Answered => self.tally.answered += 1,
                    CycleResult::Superseded => self.tally.unanswered += 1,
                    result => return Err(format!("axis {}: {result}", state.axis)),
                }
            }
            self.told = Some(event.period);
            self.tally.periods = u64::from(event.period) + 1;
            self.tally.told += 1;
            self.tally.overruns = event.overruns;
            self.tally.late_us = self.tally.late_us.max(event.late_us);
        }
        match self.client.poll_event(Duration::ZERO) {
            Ok(None) => Ok(()),
            told => Err(format!("{told:?}")),
        }
    }

    /// Whether something waits longer and longer. `backlog`: bytes of the host that have not left
    /// to the gateway.
    ///
    /// # Errors
    /// What was lost or waits.
    pub fn look(&self, backlog: usize) -> Result<()> {
        let losses = self.client.losses();
        let lost = losses.damaged + losses.late + losses.events_lost + losses.events_dropped;
        if lost + losses.unreadable != 0 {
            return Err(format!("on the way to the host: {losses:?}"));
        }
        if backlog > 0 {
            return Err(format!("{backlog} bytes have not left to the gateway"));
        }
        let Tally { periods, told, overruns, answered, unanswered, .. } = self.tally;
        let passed = u64::from(overruns.host) + u64::from(overruns.gateway);
        // The one under way may be counted already, and has not been told.
        if periods > told + passed + 1 {
            return Err(format!("{periods} periods, {told} told, {passed} counted as not"));
        }
        if unanswered * 100 > (answered + unanswered) * UNANSWERED_PERCENT {
            return Err(format!("{unanswered} of {} unanswered", answered + unanswered));
        }
        if self.tally.slowest_cycle > CYCLE_TAKES {
            return Err(format!("a cycle took {:?}", self.tally.slowest_cycle));
        }
        Ok(())
    }

    /// What the gateway counts on each bus.
    fn counters(&mut self) -> Result<Vec<BusCounters>> {
        let Self { client, buses, .. } = self;
        let of = |full: &FullBus| Ok(client.bus_status(full.bus).map_err(text)?.counters);
        buses.iter().map(of).collect()
    }

    /// Ends the cycle and stops all motors, until none of them replies.
    ///
    /// # Errors
    /// What was refused, and what a bus has lost before.
    pub fn end(&mut self) -> Result<()> {
        self.client.run_cycle(&[], FIELDS, self.period).map_err(text)?;
        // Before the stops: those leave replies behind that nobody awaits any more.
        let after = self.counters()?;
        for (full, (before, after)) in self.buses.iter().zip(self.before.iter().zip(&after)) {
            let BusCounters { transmitted, received, cancelled, .. } = *after;
            if *after != (BusCounters { transmitted, received, cancelled, ..*before }) {
                return Err(format!("bus {}: something was lost: {after:?}", full.bus));
            }
        }
        self.client.stop(StopTarget::All).map_err(text)?;
        self.client.pause(REST).map_err(text)
    }

    /// Compares what the gateway has counted with the requests and replies that were on each wire.
    ///
    /// # Errors
    /// Where they do not agree.
    pub fn compare(mut self, wires: &[(u64, u64)]) -> Result<Tally> {
        let after = self.counters()?;
        let counts = self.before.iter().zip(&after);
        for ((full, (asked, replied)), (before, after)) in self.buses.iter().zip(wires).zip(counts)
        {
            let bus = full.bus;
            let counted = |of: fn(&BusCounters) -> u32| u64::from(of(after) - of(before));
            let (sent, heard) = (counted(|of| of.transmitted), counted(|of| of.received));
            // A poll of a motor at rest may lie between.
            if sent.abs_diff(*asked) > 1 || heard.abs_diff(*replied) > 1 {
                return Err(format!(
                    "bus {bus} counts {sent} and {heard}, its wire {asked} and {replied}"
                ));
            }
            self.tally.transmitted += asked;
            self.tally.received += replied;
        }
        Ok(self.tally)
    }
}
