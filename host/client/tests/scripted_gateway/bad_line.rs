//! What a bad line must not swallow: stops, setpoints, an arming that takes long, a restart.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use crate::line::{Heard, Said, Scripted, healthy};
use host_protocol::messages::request_name;
use host_protocol::{Request, Setpoint, StateField, StateFields, StopTarget};
use mgw_client::{Client, ClientError, Transport};

const TTL: Duration = Duration::from_millis(100);

/// What came to the gateway: gateway time, µs, and the request's name.
type Notes = Rc<RefCell<Vec<(u64, &'static str)>>>;

/// A healthy gateway, but for what `script` does in its place.
fn with(
    mut script: impl FnMut(&Heard) -> Option<Vec<Said>> + 'static,
) -> (Scripted, Client<Scripted>, Notes) {
    let notes = Notes::default();
    let noted = notes.clone();
    let line = Scripted::new(move |heard| {
        let name = request_name(heard.request.number()).unwrap();
        noted.borrow_mut().push((heard.time_us, name));
        script(heard).unwrap_or_else(|| healthy(heard))
    });
    let client = Client::connect_as(line.clone(), 1, 0).unwrap();
    notes.borrow_mut().clear();
    (line, client, notes)
}

/// A healthy one that restarts behind its open line: its clock goes back by so many µs.
fn that_restarts() -> (Rc<Cell<u64>>, Client<Scripted>, Notes) {
    let restarted = Rc::new(Cell::new(0));
    let back_us = restarted.clone();
    let (_, client, notes) = with(move |heard| {
        let Heard { sequence, times, .. } = *heard;
        let time_us = heard.time_us - back_us.get();
        Some(healthy(&Heard { sequence, request: heard.request.clone(), time_us, times }))
    });
    (restarted, client, notes)
}

fn times(notes: &Notes, name: &str) -> Vec<u64> {
    notes.borrow().iter().filter(|(_, of)| *of == name).map(|(at, _)| *at).collect()
}

fn widest(times: &[u64]) -> u64 {
    times.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
}

#[test]
fn a_stop_that_nothing_has_answered_is_still_owed() {
    let is_cut = Rc::new(Cell::new(false));
    let cut = is_cut.clone();
    let (_, mut client, notes) = with(move |_| is_cut.get().then(Vec::new));
    client.arm(3).unwrap();
    cut.set(true);
    assert!(matches!(client.stop_armed(), Err(ClientError::StopUnanswered { .. })));
    cut.set(false);
    notes.borrow_mut().clear();
    client.stop_armed().unwrap();
    assert_eq!(times(&notes, "Stop").len(), 1);
    client.stop_armed().unwrap();
    assert_eq!(times(&notes, "Stop").len(), 1);
}

#[test]
fn a_stop_is_repeated_for_three_seconds() {
    let is_over = Rc::new(Cell::new(false));
    let over = is_over.clone();
    let mut first = None;
    let (_, mut client, notes) = with(move |heard| {
        let stops = matches!(heard.request, Request::Stop(_) | Request::EStop(_));
        let silent = heard.time_us < *first.get_or_insert(heard.time_us) + 2_500_000;
        (stops && (silent || over.get())).then(Vec::new)
    });
    client.stop(StopTarget::All).unwrap();
    let stops = times(&notes, "Stop");
    assert!(stops.len() >= 90 && widest(&stops) <= 30_000, "{stops:?}");
    is_over.set(true);
    assert!(matches!(client.estop(), Err(ClientError::StopUnanswered { .. })));
}

/// So that one lost frame trips no axis whose setpoints come one by one.
#[test]
fn a_setpoint_that_is_lost_comes_again_well_within_its_life() {
    let mut lost = false;
    let (_, mut client, notes) = with(move |heard| {
        let is_lost =
            matches!(heard.request, Request::Setpoint(_)) && !std::mem::replace(&mut lost, true);
        is_lost.then(Vec::new)
    });
    client.set(0, 1, Setpoint::Velocity { velocity_rad_s: 1.0 }, TTL).unwrap();
    let setpoints = times(&notes, "Setpoint");
    assert_eq!(setpoints.len(), 2);
    assert!(widest(&setpoints) <= 25_000, "{setpoints:?}");
}

/// Its own repetitions are what keeps authority alive.
#[test]
fn an_arming_that_takes_long_is_asked_for_until_it_is_answered() {
    let mut first = None;
    let (_, mut client, notes) = with(move |heard| {
        let Request::Arm(_) = heard.request else { return None };
        let since = *first.get_or_insert(heard.time_us);
        (heard.time_us < since + 3_000_000).then(Vec::new)
    });
    client.arm(0).unwrap();
    let armings = times(&notes, "Arm");
    assert!(armings.len() > 30 && widest(&armings) <= 100_000, "{armings:?}");
}

#[test]
fn a_gateway_that_restarts_behind_an_open_line_is_subscribed_to_again() {
    let (restarted, mut client, notes) = that_restarts();
    let fields = StateFields::of(&[StateField::Position]);
    client.subscribe(&[0], fields, Duration::from_millis(100)).unwrap();
    let rounds = |client: &mut Client<Scripted>| {
        notes.borrow_mut().clear();
        for _ in 0..40 {
            client.pause(Duration::from_millis(100)).unwrap();
            client.keep_subscription().unwrap();
        }
        (times(&notes, "Hello").len(), times(&notes, "Subscribe").len())
    };
    assert_eq!(rounds(&mut client), (0, 0));
    restarted.set(4_000_000);
    assert_eq!(rounds(&mut client), (1, 1));
    assert_eq!(rounds(&mut client), (0, 0));
}

/// The stop is done, whatever becomes of the session on the new connection; a subscription is made
/// again when the gateway is heard.
#[test]
fn a_stop_on_a_new_connection_needs_no_hello() {
    let is_deaf = Rc::new(Cell::new(false));
    let deaf = is_deaf.clone();
    let (line, mut client, notes) = with(move |heard| {
        let is_heard = !is_deaf.get() || matches!(heard.request, Request::Stop(_));
        (!is_heard).then(Vec::new)
    });
    let fields = StateFields::of(&[StateField::Position]);
    client.subscribe(&[0], fields, Duration::from_millis(100)).unwrap();
    client.arm(3).unwrap();
    line.0.borrow_mut().closed = true;
    deaf.set(true);
    client.stop_armed().unwrap();
    assert!(client.keep_subscription().is_err());
    deaf.set(false);
    notes.borrow_mut().clear();
    client.keep_subscription().unwrap();
    client.keep_subscription().unwrap();
    assert_eq!((times(&notes, "Hello").len(), times(&notes, "Subscribe").len()), (1, 1));
    // It was stopped, so there is nothing to stop any more.
    client.stop_armed().unwrap();
    assert_eq!(times(&notes, "Stop").len(), 0);
}

/// Whatever asks for its time first: without a session it would tell no events.
#[test]
fn a_gateway_that_restarts_behind_an_open_line_is_greeted_again() {
    const SETPOINT: Setpoint = Setpoint::Signal { fraction: 0.1 };
    let ways: [fn(&mut Client<Scripted>); 3] = [
        |client| client.keep_alive().unwrap(),
        |client| client.set(0, 1, SETPOINT, TTL).unwrap(),
        |client| {
            client.ping().unwrap();
            client.keep_subscription().unwrap();
        },
    ];
    for way in ways {
        let (restarted, mut client, notes) = that_restarts();
        let greeted = |client: &mut Client<Scripted>| {
            notes.borrow_mut().clear();
            for _ in 0..10 {
                client.pause(Duration::from_millis(100)).unwrap();
                way(client);
            }
            times(&notes, "Hello").len()
        };
        assert_eq!(greeted(&mut client), 0);
        restarted.set(4_000_000);
        assert_eq!(greeted(&mut client), 1);
        assert_eq!(greeted(&mut client), 0);
    }
}

/// Whatever a caller makes of an error in its round: what was kept up has ended.
#[test]
fn a_hold_whose_line_fails_in_a_round_is_over() {
    let (line, mut client, _) = with(|_| None);
    let mut rounds = 0;
    let held = client.hold(Duration::from_secs(3_600), |client| {
        rounds += 1;
        // A ping is due when the line is closed.
        client.transport_mut().sleep(Duration::from_millis(200));
        line.0.borrow_mut().closed = true;
        assert!(client.pause(Duration::from_millis(200)).is_err());
        line.0.borrow_mut().closed = false;
        Ok(ControlFlow::Continue(()))
    });
    assert!(matches!(held, Err(ClientError::Transport(_))), "{held:?}");
    assert_eq!(rounds, 1);
}
