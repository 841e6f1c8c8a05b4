//! Holding setpoints and the link.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::time::Duration;

use crate::line::{LATENCY, Scripted, error_bytes, healthy};
use host_protocol::{AxisState, Error, Quantity, Request, Setpoint};
use mgw_client::{Client, ClientError, Hold};

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
        .hold_setpoints(&[hold(0), hold(1)], Duration::from_secs(1), |_| Ok(ControlFlow::Continue(())))
        .unwrap();
    assert!(client.now() - start >= Duration::from_secs(1));
    for axis in [0, 1] {
        let times: Vec<u64> =
            setpoints.borrow().iter().filter(|(of, _)| *of == axis).map(|(_, time)| *time).collect();
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
    assert_eq!(setpoints.borrow().len(), 5);
}

#[test]
fn one_stale_setpoint_is_followed_by_a_fresh_one() {
    let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
    let (mut client, setpoints) = noting(move |count| (count == 3).then_some(stale));
    client.hold_setpoints(&[hold(0)], Duration::from_millis(500), |_| Ok(ControlFlow::Continue(()))).unwrap();
    assert!(setpoints.borrow().len() >= 14);
}

#[test]
fn a_gateway_whose_clock_stood_still_for_a_while_is_caught_up_with() {
    let ahead = Error::OutOfRange { quantity: Quantity::Expiry, value: 105_000.0, min: 0.0, max: 100_000.0 };
    let (mut client, setpoints) = noting(move |count| (count == 3).then_some(ahead));
    client.hold_setpoints(&[hold(0)], Duration::from_millis(500), |_| Ok(ControlFlow::Continue(()))).unwrap();
    assert!(setpoints.borrow().len() >= 14);
}

#[test]
fn setpoints_that_are_always_stale_are_an_error() {
    let stale = Error::Stale { now_us: 2, expires_at_us: 1 };
    let (mut client, setpoints) = noting(move |_| Some(stale));
    let result = client.hold_setpoints(&[hold(0)], Duration::from_secs(5), |_| Ok(ControlFlow::Continue(())));
    assert!(matches!(result, Err(ClientError::Gateway(Error::Stale { .. }))));
    assert_eq!(setpoints.borrow().len(), 4);
}

#[test]
fn a_refusal_ends_the_hold_at_once() {
    let refusal = Error::NotArmed { axis: 0, state: AxisState::Idle };
    let (mut client, setpoints) = noting(move |count| (count == 2).then_some(refusal));
    let result = client.hold_setpoints(&[hold(0)], Duration::from_secs(5), |_| Ok(ControlFlow::Continue(())));
    assert!(matches!(result, Err(ClientError::Gateway(error)) if error == refusal));
    assert_eq!(setpoints.borrow().len(), 2);
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
    assert!(pings.borrow().windows(2).all(|pair| pair[1] - pair[0] < 125_000), "{:?}", pings.borrow());
}
