//! Holding setpoints and the link.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use crate::line::{LATENCY, Scripted, error_bytes, healthy};
use host_protocol::messages::request_name;
use host_protocol::{AxisState, Error, Quantity, Request, Setpoint, StopTarget};
use mgw_client::{Client, ClientError, Hold, Interrupt};

const TTL: Duration = Duration::from_millis(100);

fn hold(axis: u8) -> Hold {
    Hold { axis, epoch: 9, setpoint: Setpoint::Velocity { velocity_rad_s: 2.0 }, ttl: TTL }
}

/// Each setpoint's axis and gateway time of arrival, µs.
type Notes = Rc<RefCell<Vec<(u8, u64)>>>;

/// A gateway that notes when each axis' setpoints came, and refuses those that `refuse` names.
fn noting(refuse: impl Fn(usize) -> Option<Error> + 'static) -> (Client<Scripted>, Notes) {
    let setpoints = Notes::default();
    let notes = setpoints.clone();
    let line = Scripted::new(move |heard| {
        if let Request::Setpoint(setpoint) = &heard.request {
            let mut notes = notes.borrow_mut();
            notes.push((setpoint.axis, heard.time_us));
            if let Some(error) = refuse(notes.len()) {
                return vec![(2 * LATENCY, error_bytes(heard.sequence, &error))];
            }
        }
        healthy(heard)
    });
    (Client::connect_as(line, 1, 0).unwrap(), setpoints)
}

#[test]
fn setpoints_of_all_axes_are_renewed_well_within_their_time_to_live() {
    let (mut client, setpoints) = noting(|_| None);
    let start = client.now();
    client
        .hold_setpoints(&[hold(0), hold(1)], Duration::from_secs(1), |_| {
            Ok(ControlFlow::Continue(()))
        })
        .unwrap();
    assert!(client.now() - start >= Duration::from_secs(1));
    for axis in [0, 1] {
        let times: Vec<u64> = setpoints
            .borrow()
            .iter()
            .filter(|(of, _)| *of == axis)
            .map(|(_, time)| *time)
            .collect();
        assert!(times.len() >= 28, "{}", times.len());
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] < 50_000), "{times:?}");
    }
}

#[test]
fn the_caller_ends_the_hold() {
    let (mut client, setpoints) = noting(|_| None);
    let mut rounds = 0;
    client
        .hold_setpoints(&[hold(0)], Duration::MAX, |_| {
            rounds += 1;
            Ok(if rounds == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })
        .unwrap();
    // Four rounds of 25 ms, and the setpoint before the fifth.
    assert_eq!((rounds, setpoints.borrow().len()), (5, 11));
}

#[test]
fn one_stale_setpoint_is_followed_by_a_fresh_one() {
    let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
    let (mut client, setpoints) = noting(move |count| (count == 3).then_some(stale));
    client
        .hold_setpoints(&[hold(0)], Duration::from_millis(500), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    assert!(setpoints.borrow().len() >= 14);
}

#[test]
fn a_gateway_whose_clock_stood_still_for_a_while_is_caught_up_with() {
    let ahead = Error::OutOfRange {
        quantity: Quantity::Expiry,
        value: 105_000.0,
        min: 0.0,
        max: 100_000.0,
    };
    let (mut client, setpoints) = noting(move |count| (count == 3).then_some(ahead));
    client
        .hold_setpoints(&[hold(0)], Duration::from_millis(500), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    assert!(setpoints.borrow().len() >= 14);
}

#[test]
fn setpoints_that_are_always_stale_are_an_error() {
    let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
    let (mut client, setpoints) = noting(move |_| Some(stale));
    let result = client
        .hold_setpoints(&[hold(0)], Duration::from_secs(5), |_| Ok(ControlFlow::Continue(())));
    assert!(matches!(result, Err(ClientError::Gateway(Error::Stale { .. }))));
    // One every 10 ms, for the half second that nothing may be taken.
    assert!((50..=55).contains(&setpoints.borrow().len()), "{}", setpoints.borrow().len());
}

#[test]
fn an_axis_whose_setpoints_are_all_refused_is_not_hidden_by_another() {
    let line = Scripted::new(|heard| match &heard.request {
        Request::Setpoint(setpoint) if setpoint.axis == 0 => {
            let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
            vec![(2 * LATENCY, error_bytes(heard.sequence, &stale))]
        }
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    let start = client.now();
    let held = client.hold_setpoints(&[hold(0), hold(1)], Duration::from_secs(5), |_| {
        Ok(ControlFlow::Continue(()))
    });
    assert!(matches!(held, Err(ClientError::Gateway(Error::Stale { .. }))), "{held:?}");
    assert!(client.now() - start < Duration::from_secs(1));
}

#[test]
fn setpoints_wait_for_no_answer_and_each_has_an_expiry_of_its_own() {
    const ANSWER_AFTER: Duration = Duration::from_millis(80);
    let expiries = Rc::new(RefCell::new(Vec::new()));
    let notes = expiries.clone();
    let line = Scripted::new(move |heard| {
        let mut said = healthy(heard);
        if let Request::Setpoint(setpoint) = &heard.request {
            notes.borrow_mut().push((heard.sequence, setpoint.expires_at_us));
            said.iter_mut().for_each(|(delay, _)| *delay = ANSWER_AFTER);
        }
        said
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    client
        .hold_setpoints(&[hold(0)], Duration::from_secs(1), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    let expiries = expiries.borrow();
    assert!(expiries.len() >= 99, "{}", expiries.len());
    for pair in expiries.windows(2) {
        assert_ne!(pair[0].0, pair[1].0);
        let later = pair[1].1.wrapping_sub(pair[0].1);
        assert!((9_000..=11_000).contains(&later), "{later} µs");
    }
    assert_eq!(client.losses().late, 0);
}

#[test]
fn what_the_gateway_no_longer_knows_is_not_asked_for_again_if_it_acts_again() {
    let line = Scripted::new(|heard| match heard.request {
        Request::MoveRelative(_) => vec![],
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
    let mut others = 0;
    let holds = [hold(0), hold(1), hold(2)];
    let _ = client.hold_setpoints(&holds, Duration::from_secs(1), |client| {
        let _ = client.move_relative(3, 9, 1.0, 1.0, TTL);
        Ok(ControlFlow::Break(()))
    });
    let mut moves = Vec::new();
    for (_, bytes) in line.sent_after_opening() {
        let mut deframer = host_protocol::Deframer::new();
        for byte in &bytes {
            let Some(Ok(frame)) = deframer.push(*byte) else { continue };
            match Request::decode(frame.number, frame.body) {
                Ok(Request::MoveRelative(_)) => moves.push(std::mem::take(&mut others)),
                _ => others += 1,
            }
        }
    }
    let between: usize = moves.iter().skip(1).sum();
    assert!(moves.len() >= 2 && between < 8, "{moves:?}");
    assert!(others > 100, "the setpoints go on: {others}");
}

#[test]
fn a_refusal_ends_the_hold_at_once() {
    let refusal = Error::NotArmed { axis: 0, state: AxisState::Idle };
    let (mut client, setpoints) = noting(move |count| (count == 2).then_some(refusal));
    let result = client
        .hold_setpoints(&[hold(0)], Duration::from_secs(5), |_| Ok(ControlFlow::Continue(())));
    assert!(matches!(result, Err(ClientError::Gateway(error)) if error == refusal));
    // The third was on its way before the answer to the second had come.
    assert!(setpoints.borrow().len() <= 3, "{}", setpoints.borrow().len());
}

#[test]
fn holding_the_link_pings_often_enough() {
    let pings = Rc::new(RefCell::new(Vec::new()));
    let notes = pings.clone();
    let line = Scripted::new(move |heard| {
        if matches!(heard.request, Request::Ping(_)) {
            notes.borrow_mut().push(heard.time_us);
        }
        healthy(heard)
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    client.hold(Duration::from_secs(1), |_| Ok(ControlFlow::Continue(()))).unwrap();
    assert!(
        pings.borrow().windows(2).all(|pair| pair[1] - pair[0] < 125_000),
        "{:?}",
        pings.borrow()
    );
}

#[test]
fn an_expiry_too_far_ahead_for_the_gateway_is_followed_by_one_that_is_not() {
    let leads = Rc::new(RefCell::new(Vec::new()));
    let notes = leads.clone();
    // A gateway that takes less than is asked for, whatever the reason.
    let line = Scripted::new(move |heard| match &heard.request {
        Request::Setpoint(setpoint) => {
            let lead = setpoint.expires_at_us.wrapping_sub(u32::try_from(heard.time_us).unwrap());
            notes.borrow_mut().push(lead);
            if lead > 80_000 {
                let (quantity, value) = (Quantity::Expiry, lead as f32);
                let error = Error::OutOfRange { quantity, value, min: 0.0, max: 80_000.0 };
                return vec![(2 * LATENCY, error_bytes(heard.sequence, &error))];
            }
            healthy(heard)
        }
        _ => healthy(heard),
    });
    let mut client = Client::connect_as(line, 1, 0).unwrap();
    client
        .hold_setpoints(&[hold(0)], Duration::from_secs(1), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    let leads = leads.borrow();
    let refused = leads.iter().filter(|lead| **lead > 80_000).count();
    assert!(refused <= 3, "{refused} of {}: {leads:?}", leads.len());
}

#[test]
fn an_interrupt_between_two_due_setpoints_is_followed_by_the_stops() {
    let (interrupt, heard) = (Interrupt::default(), Rc::new(RefCell::new(Vec::new())));
    let (raised, names) = (interrupt.clone(), heard.clone());
    let line = Scripted::new(move |heard| {
        names.borrow_mut().push(request_name(heard.request.number()).unwrap());
        if matches!(heard.request, Request::Setpoint(_)) {
            raised.raise();
        }
        healthy(heard)
    });
    let mut client = Client::connect_heeding(line, interrupt).unwrap();
    client.arm(0).unwrap();
    client.arm(1).unwrap();
    let held = client.hold_setpoints(&[hold(0), hold(1)], Duration::from_secs(1), |_| {
        Ok(ControlFlow::Continue(()))
    });
    assert!(matches!(held, Err(ClientError::Interrupted { armed: true })), "{held:?}");
    assert!(heard.borrow().ends_with(&["Setpoint", "Stop", "Stop"]), "{:?}", heard.borrow());
    let refused = client.set(0, 9, Setpoint::Velocity { velocity_rad_s: 2.0 }, TTL);
    assert!(matches!(refused, Err(ClientError::Interrupted { armed: true })), "{refused:?}");
    assert_eq!(heard.borrow().iter().filter(|name| **name == "Setpoint").count(), 1);
}

/// A second request for what is armed is refused: the axis is to be stopped all the same.
#[test]
fn an_axis_whose_arming_is_refused_because_it_is_armed_is_still_stopped() {
    for together in [false, true] {
        let stops = Rc::new(RefCell::new(Vec::new()));
        let (asked, told) = (Rc::new(RefCell::new(0)), stops.clone());
        let line = Scripted::new(move |heard| {
            match &heard.request {
                Request::Stop(stop) => told.borrow_mut().push(stop.target),
                Request::Arm(_) | Request::ArmTogether(_) => *asked.borrow_mut() += 1,
                _ => {}
            }
            let is_arming = matches!(heard.request, Request::Arm(_) | Request::ArmTogether(_));
            if is_arming && *asked.borrow() > 1 {
                let refusal = Error::NotIdle { axis: 0, state: AxisState::Armed };
                return vec![(2 * LATENCY, error_bytes(heard.sequence, &refusal))];
            }
            healthy(heard)
        });
        let mut client = Client::connect_as(line, 1, 0).unwrap();
        client.arm(0).unwrap();
        let refused =
            if together { client.arm_together(&[0, 1]).map(drop) } else { client.arm(0).map(drop) };
        assert!(matches!(refused, Err(ClientError::Gateway(Error::NotIdle { .. }))));
        client.stop_armed().unwrap();
        assert_eq!(*stops.borrow(), [StopTarget::Axis(0)], "together: {together}");
    }
}
