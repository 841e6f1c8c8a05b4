use std::time::Duration;

use host_protocol::replies::{BusReport, HelloReply};
use host_protocol::{
    AxisState, AxisSummary, BootReason, BusConfig, BusCounters, BusKind, BusState, Event,
    EventMessage, Incident, Protocol, ProtocolSet, Reading, StateField, Trip, TripReason,
};

use super::*;

const SECOND: Duration = Duration::from_secs(1);

fn summary(axis: u8, state: AxisState) -> AxisSummary {
    let protocol = Some(Protocol::Rmd);
    AxisSummary { axis, bus: Some(0), protocol, node: Some(axis + 1), state, missing: None }
}

fn trip(time_us: u64) -> Trip {
    Trip {
        reason: TripReason::SetpointExpired,
        time_us,
        velocity_rad_s: None,
        position_rad: None,
        current_a: None,
        unreachable: false,
    }
}

fn told(live: &mut Live, event: Event, now: Duration) {
    live.event(&EventMessage { dropped: 0, time_us: 2_000_000, event }, now);
}

fn sample(axis: u8, state: AxisState, position_rad: f32) -> Event {
    Event::Sample {
        axis,
        state,
        position_rad: Some(Reading { value: position_rad, age_us: 1_000 }),
        velocity_rad_s: None,
        current_a: None,
        voltage_v: None,
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: None,
    }
}

fn hello() -> HelloReply {
    let mut world = mgw_sim::World::new(mgw_sim::Wiring::four_motors());
    world.run_for(Duration::from_millis(1));
    let shared = std::rc::Rc::new(std::cell::RefCell::new(world));
    let client = mgw_client::Client::connect(mgw_sim::SimTransport::new(shared, 0));
    client.expect("it answers").hello().clone()
}

#[test]
fn a_sample_ages_and_a_trip_has_its_reason_until_it_is_cleared() {
    let mut live = Live::of("x");
    live.list(&[summary(0, AxisState::Idle), summary(3, AxisState::Armed)]);
    told(&mut live, sample(3, AxisState::Active, 1.5), SECOND);
    let position = live.axes[1].reading(StateField::Position, SECOND * 2).unwrap();
    assert_eq!((position.value, position.age_us), (1.5, 1_001_000));
    assert_eq!(live.axes[1].age_us(SECOND), Some(1_000));
    assert_eq!(live.axes[1].reading(StateField::Velocity, SECOND), None);
    told(&mut live, Event::Tripped { axis: 3, trip: trip(2_000_000) }, SECOND);
    assert_eq!(live.axes[1].state, AxisState::Tripped { confirmed: false });
    let confirmed =
        Event::StopConfirmed { axis: 3, reaction_us: 1, elapsed_us: 2, standstill: None };
    told(&mut live, confirmed, SECOND);
    assert_eq!(live.axes[1].state, AxisState::Tripped { confirmed: true });
    assert_eq!(live.axes[1].trip, Some(TripReason::SetpointExpired));
    told(&mut live, sample(3, AxisState::Idle, 1.5), SECOND);
    assert_eq!((live.axes[1].state, live.axes[1].trip), (AxisState::Idle, None));
    assert_eq!(live.axes[0].state, AxisState::Idle, "the other one is as it was");
    live.list(&[summary(0, AxisState::Idle)]);
    assert_eq!(live.axes.len(), 1, "it is not configured any more");
}

#[test]
fn what_the_gateway_remembers_explains_a_trip_and_stands_in_the_history_once() {
    let mut live = Live::of("x");
    live.list(&[summary(0, AxisState::Tripped { confirmed: true })]);
    assert!(live.axes[0].is_unexplained());
    let started =
        Incident::Started { start: 1, boot: BootReason::PowerOn, has_crash_report: false };
    let tripped = Incident::Tripped { start: 1, axis: 0, trip: trip(2_000_000) };
    live.incidents(&[tripped, started]);
    live.incidents(&[tripped, started]);
    told(&mut live, Event::Tripped { axis: 0, trip: trip(2_000_000) }, SECOND);
    assert!(!live.axes[0].is_unexplained());
    assert_eq!(
        live.log.history(9).collect::<Vec<_>>(),
        [
            "t=0.000000 s  started: power on",
            "t=2.000000 s  axis 0 tripped: the setpoint expired [E-setpoint-expired]",
        ]
    );
    assert_eq!(live.log.events(9).count(), 0);
    assert_eq!(live.log.history(1).count(), 1);
}

#[test]
fn a_lost_gateway_is_told_once_and_so_is_its_return() {
    let mut live = Live::of("x");
    live.connected(hello(), SECOND);
    live.list(&[summary(0, AxisState::Idle)]);
    told(&mut live, sample(0, AxisState::Idle, 1.0), SECOND);
    live.lost("the cable");
    live.lost("nobody there");
    assert_eq!(live.link, Link::Lost { why: "nobody there".to_owned() });
    live.connected(hello(), SECOND);
    assert_eq!(live.link, Link::Up);
    assert_eq!(live.axes[0].reading(StateField::Position, SECOND), None, "that was before");
    let notes: Vec<_> = live.log.events(9).collect();
    assert_eq!(notes, ["mgw: connection lost: the cable", "mgw: connected again"]);
}

#[test]
fn text_of_a_gateway_commands_no_terminal() {
    let mut live = Live::of("x");
    live.log.push("a\u{1b}[2Jb".to_owned());
    assert_eq!(live.log.events(1).collect::<Vec<_>>(), [r"a\u001b[2Jb"]);
}

#[test]
fn the_load_of_a_bus_counts_each_frame_as_the_longest() {
    let report = |transmitted, received| BusReport {
        config: Some(BusConfig {
            bitrate: 1_000_000,
            protocols: ProtocolSet::of(&[Protocol::Rmd]),
            exclusive: false,
            reply_window_us: 2_000,
        }),
        state: BusState::Active,
        transmit_errors: 0,
        receive_errors: 0,
        counters: BusCounters { transmitted, received, ..BusCounters::default() },
        raw_open: false,
    };
    let mut bus = Bus::new(0, BusKind::Can);
    bus.take(report(100, 100), SECOND);
    assert_eq!((bus.rates(), bus.load_at_most()), (None, None), "there is nothing to compare with");
    bus.take(report(1_100, 600), SECOND * 3);
    assert_eq!(bus.rates(), Some((500.0, 250.0)));
    // 750 frames of 135 bits in a second, of a million.
    assert!((bus.load_at_most().unwrap() - 0.10125).abs() < 1e-9, "{:?}", bus.load_at_most());
    bus.take(report(0, 0), SECOND * 4);
    assert_eq!(bus.rates(), None, "it counts anew");
}

#[test]
fn a_rate_is_that_of_the_last_second() {
    let mut live = Live::of("x");
    live.list(&[summary(0, AxisState::Idle)]);
    (0..20).for_each(|_| told(&mut live, sample(0, AxisState::Idle, 0.0), SECOND / 2));
    live.tick(SECOND / 2);
    assert_eq!(live.samples.per_second(), None);
    live.tick(SECOND * 2);
    assert_eq!(live.samples.per_second(), Some(10.0));
    live.tick(SECOND * 3);
    assert_eq!(live.samples.per_second(), Some(0.0));
}
