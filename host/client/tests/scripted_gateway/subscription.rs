//! Subscribing, keeping the subscription, ending it.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use crate::line::{Scripted, event_bytes, healthy};
use host_protocol::{AxisState, Error, Event, Reading, Request, StateField, StateFields};
use mgw_client::{Client, ClientError};

const FIELDS: StateFields = StateFields::of(&[StateField::Position, StateField::Faults]);
const PERIOD: Duration = Duration::from_millis(10);

/// A client, its line, and the requests that it sends from then on.
fn connected() -> (Scripted, Client<Scripted>, Rc<RefCell<Vec<Request>>>) {
    let heard = Rc::new(RefCell::new(Vec::new()));
    let notes = heard.clone();
    let line = Scripted::new(move |heard| {
        notes.borrow_mut().push(heard.request.clone());
        healthy(heard)
    });
    let client = Client::connect_as(line.clone(), 1, 0).unwrap();
    heard.borrow_mut().clear();
    (line, client, heard)
}

#[test]
fn axes_become_bits_and_samples_come_as_events() {
    let (line, mut client, heard) = connected();
    client.subscribe(&[0, 5, 31], FIELDS, PERIOD).unwrap();
    let Request::Subscribe(request) = heard.borrow()[0].clone() else { panic!("{heard:?}") };
    assert_eq!(
        (request.axes, request.fields.bits(), request.period_us),
        (0x8000_0021, 0b100_0001, 10_000)
    );
    let sample = Event::Sample {
        axis: 5,
        state: AxisState::Idle,
        position_rad: Some(Reading { value: 1.5, age_us: 700 }),
        velocity_rad_s: None,
        current_a: None,
        voltage_v: None,
        motor_temperature_c: None,
        driver_temperature_c: None,
        faults: None,
    };
    line.say(Duration::from_millis(3), event_bytes(0, 14, &sample));
    let event = client.poll_event(PERIOD).unwrap().expect("it has come");
    assert_eq!((event.time_us, event.event), (14, sample));
}

#[test]
fn an_axis_beyond_the_last_bit_is_unknown() {
    let (_line, mut client, heard) = connected();
    let result = client.subscribe(&[0, 32], FIELDS, PERIOD);
    assert!(matches!(
        result,
        Err(ClientError::Gateway(Error::UnknownAxis { axis: 32, max_axes: 32 }))
    ));
    assert!(heard.borrow().is_empty());
}

#[test]
fn a_watching_client_pings_every_second() {
    let (line, mut client, heard) = connected();
    client.subscribe(&[0], FIELDS, PERIOD).unwrap();
    for _ in 0..1_000 {
        client.keep_subscription().unwrap();
        line.0.borrow_mut().now += PERIOD;
    }
    let pings = heard.borrow().iter().filter(|request| matches!(request, Request::Ping(_))).count();
    assert!((9..=10).contains(&pings), "{pings}");
    assert_eq!(heard.borrow().len(), pings + 1);
}

#[test]
fn a_client_that_was_held_up_subscribes_again() {
    let (line, mut client, heard) = connected();
    client.subscribe(&[0], FIELDS, PERIOD).unwrap();
    line.0.borrow_mut().now += Duration::from_secs(7);
    client.keep_subscription().unwrap();
    let requests = heard.borrow();
    assert!(requests.len() == 2 && requests[0] == requests[1], "{requests:?}");
}

#[test]
fn after_its_end_nobody_subscribes_again() {
    let (line, mut client, heard) = connected();
    client.subscribe(&[0], FIELDS, PERIOD).unwrap();
    client.unsubscribe().unwrap();
    line.0.borrow_mut().now += Duration::from_secs(7);
    client.keep_subscription().unwrap();
    let requests = heard.borrow();
    let Request::Subscribe(end) = &requests[1] else { panic!("{requests:?}") };
    assert_eq!((end.axes, end.fields.is_empty()), (0, true));
    assert!(matches!(requests[2], Request::Ping(_)), "{requests:?}");
}
