//! A session against a scripted gateway, in virtual time.

use std::time::Duration;

use crate::line::{
    GATEWAY_START_US, Heard, LATENCY, Said, Scripted, error_bytes, event_bytes, gateway_time_us,
    healthy, hello, reply_bytes,
};
use host_protocol::replies::Done;
use host_protocol::requests::{EStop, Stop};
use host_protocol::{Bytes, Error, Event, PROTOCOL_MAJOR, Reply, Request, Setpoint, StopTarget};
use mgw_client::{Client, ClientError, DEADLINE, HELLO_DEADLINE, KEEP_ALIVE_AFTER, REPEAT_AFTER};

/// Hello of version 1.0 with session 0x12345678, sequence 0.
const HELLO: [u8; 19] = [
    0x00, 0x02, 0x01, 0x01, 0x02, 0x01, 0x02, 0x01, 0x0A, 0xF8, 0xAC, 0xD1, 0x91, 0x01, 0xC9, 0x7C,
    0xBF, 0x3A, 0x00,
];
/// Stop of all axes, sequence 4.
const STOP_ALL_SEQUENCE_4: [u8; 13] =
    [0x00, 0x03, 0x01, 0x04, 0x02, 0x32, 0x06, 0x01, 0xB3, 0xFE, 0xBD, 0x74, 0x00];
const STOP_ALL: Stop = Stop { target: StopTarget::All };

/// A client whose hello had sequence 0, so that the first request after opening has sequence 4.
fn connected(script: impl FnMut(&Heard) -> Vec<Said> + 'static) -> (Scripted, Client<Scripted>) {
    let line = Scripted::new(script);
    let client = Client::connect_as(line.clone(), 0x1234_5678, 0).expect("the script answers");
    (line, client)
}

#[test]
fn a_session_opens_with_hello_and_pings() {
    let (line, client) = connected(healthy);
    let sent = line.0.borrow().sent.clone();
    assert_eq!(sent.len(), 4);
    assert_eq!(sent[0].1, HELLO);
    // Ping, sequence 1.
    assert_eq!(sent[1].1, [0x00, 0x03, 0x01, 0x01, 0x02, 0x02, 0x05, 0xCF, 0x83, 0x63, 0x87, 0x00]);
    assert_eq!(client.hello().board, "scripted");
}

#[test]
fn an_unanswered_request_is_repeated_with_the_same_bytes() {
    let (line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) if heard.times < 3 => vec![],
        _ => healthy(heard),
    });
    let start = client.now();
    client.request(&STOP_ALL).unwrap();
    let sent = line.sent_after_opening();
    assert_eq!(sent.len(), 3);
    for (index, (time, bytes)) in (0..).zip(&sent) {
        assert_eq!(*time - start, index * REPEAT_AFTER);
        assert_eq!(*bytes, STOP_ALL_SEQUENCE_4);
    }
}

#[test]
fn a_late_reply_after_retry_is_ignored() {
    // The first answer takes longer than the client waits, so both sendings are answered.
    let (line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) => {
            vec![(REPEAT_AFTER + 2 * LATENCY, reply_bytes(heard.sequence, &Reply::Stop(Done {})))]
        }
        Request::EStop(_) => {
            vec![(
                DEADLINE / 2,
                error_bytes(heard.sequence, &Error::UnknownRequest { number: 0x33 }),
            )]
        }
        _ => healthy(heard),
    });
    client.request(&STOP_ALL).unwrap();
    assert_eq!(line.sent_after_opening().len(), 2);
    // The second answer to the stop comes while the next request waits for its own.
    assert!(matches!(
        client.request(&EStop {}),
        Err(ClientError::Gateway(Error::UnknownRequest { number: 0x33 }))
    ));
    assert_eq!(client.losses().late, 1);
}

#[test]
fn events_that_arrive_while_waiting_are_delivered_in_order() {
    let events = [
        Event::EStopLatched {},
        Event::AxisUnreachable { axis: 3, stop_transmitted: true },
        Event::EStopCleared {},
    ];
    let (line, mut client) = connected(move |heard| match heard.request {
        Request::Stop(_) => {
            let mut bytes = event_bytes(0, 11, &events[0]);
            bytes.extend(event_bytes(1, 12, &events[1]));
            bytes.extend(reply_bytes(heard.sequence, &Reply::Stop(Done {})));
            bytes.extend(event_bytes(2, 13, &events[2]));
            vec![(2 * LATENCY, bytes)]
        }
        _ => healthy(heard),
    });
    client.request(&STOP_ALL).unwrap();
    line.say(Duration::from_millis(5), event_bytes(3, 14, &Event::RequestDropped { count: 2 }));
    let mut seen = Vec::new();
    while let Some(event) = client.poll_event(Duration::from_millis(10)).unwrap() {
        seen.push((event.time_us, event.event));
    }
    let expected = [
        (11, Event::EStopLatched {}),
        (12, Event::AxisUnreachable { axis: 3, stop_transmitted: true }),
        (13, Event::EStopCleared {}),
        (14, Event::RequestDropped { count: 2 }),
    ];
    assert_eq!(seen, expected);
}

#[test]
fn waiting_for_an_event_takes_no_longer_than_asked() {
    let (_line, mut client) = connected(healthy);
    let start = client.now();
    assert_eq!(client.poll_event(Duration::from_millis(30)).unwrap(), None);
    assert_eq!(client.now() - start, Duration::from_millis(30));
}

#[test]
fn a_gateway_of_another_major_version_is_refused_by_its_reply() {
    let line = Scripted::new(|heard| {
        vec![(LATENCY, reply_bytes(heard.sequence, &Reply::Hello(hello(PROTOCOL_MAJOR + 1))))]
    });
    let error = Client::connect(line).err().unwrap();
    assert!(matches!(error, ClientError::Incompatible { gateway, host }
        if gateway == PROTOCOL_MAJOR + 1 && host == PROTOCOL_MAJOR));
    assert!(error.to_string().contains("Update this program"), "{error}");
}

#[test]
fn a_gateway_that_refuses_our_major_version_is_reported_alike() {
    let line = Scripted::new(|heard| {
        let error = Error::UnsupportedVersion { gateway_major: 0, host_major: PROTOCOL_MAJOR };
        vec![(LATENCY, error_bytes(heard.sequence, &error))]
    });
    let error = Client::connect(line).err().unwrap();
    assert!(matches!(error, ClientError::Incompatible { gateway: 0, host: PROTOCOL_MAJOR }));
    assert!(error.to_string().contains("Update the gateway's firmware"), "{error}");
}

#[test]
fn nobody_answering_is_an_error_after_the_deadline() {
    let line = Scripted::new(|_| vec![]);
    let error = Client::connect(line.clone()).err().unwrap();
    assert!(matches!(error, ClientError::NoAnswer { request: "Hello", after: HELLO_DEADLINE }));
    assert_eq!(line.0.borrow().now, HELLO_DEADLINE);
}

#[test]
fn a_request_that_stays_unanswered_keeps_to_its_own_deadline() {
    let (line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) => vec![],
        _ => healthy(heard),
    });
    let start = client.now();
    let deadline = Duration::from_millis(200);
    let error = client.request_within(&STOP_ALL, deadline).err().unwrap();
    assert!(matches!(error, ClientError::NoAnswer { request: "Stop", after } if after == deadline));
    assert_eq!(client.now() - start, deadline);
    // At 0, 80 and 160 ms.
    assert_eq!(line.sent_after_opening().len(), 3);
}

#[test]
fn a_corrupted_reply_costs_one_repetition() {
    let (line, mut client) = connected(|heard| {
        let mut said = healthy(heard);
        if matches!(heard.request, Request::Stop(_)) && heard.times == 1 {
            let byte = said[0].1.get_mut(3).unwrap();
            *byte ^= 0x40;
        }
        said
    });
    client.request(&STOP_ALL).unwrap();
    assert_eq!(line.sent_after_opening().len(), 2);
    assert_eq!(client.losses().damaged, 1);
}

#[test]
fn garbage_before_an_answer_does_not_hide_it() {
    let (line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) => {
            let mut said = healthy(heard);
            said.insert(0, (LATENCY, (0..2_000u32).map(|n| (n * 7 % 251) as u8 + 1).collect()));
            said
        }
        _ => healthy(heard),
    });
    client.request(&STOP_ALL).unwrap();
    assert_eq!(line.sent_after_opening().len(), 1);
    assert_eq!(client.losses().damaged, 1);
}

#[test]
fn an_answer_of_another_request_is_not_taken() {
    let (line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) if heard.times == 1 => vec![
            // The right number with another sequence, and the right sequence with another number.
            (LATENCY, reply_bytes(heard.sequence.wrapping_sub(1), &Reply::Stop(Done {}))),
            (LATENCY, reply_bytes(heard.sequence, &Reply::EStop(Done {}))),
        ],
        _ => healthy(heard),
    });
    client.request(&STOP_ALL).unwrap();
    assert_eq!(line.sent_after_opening().len(), 2);
    assert_eq!(client.losses().late, 2);
}

#[test]
fn an_error_of_the_gateway_comes_with_its_data() {
    let (_line, mut client) = connected(|heard| match heard.request {
        Request::Stop(_) => {
            vec![(
                LATENCY,
                error_bytes(heard.sequence, &Error::UnknownAxis { axis: 77, max_axes: 32 }),
            )]
        }
        _ => healthy(heard),
    });
    let error = client.request(&STOP_ALL).err().unwrap();
    assert!(matches!(error, ClientError::Gateway(Error::UnknownAxis { axis: 77, max_axes: 32 })));
}

#[test]
fn the_clock_is_known_within_a_round_trip() {
    let (line, mut client) = connected(healthy);
    line.0.borrow_mut().now += Duration::from_millis(50);
    client.ping().unwrap();
    let truth = gateway_time_us(client.now());
    assert!(
        client.gateway_now_us().abs_diff(truth) <= 200,
        "{} of {truth}",
        client.gateway_now_us()
    );
    assert!(client.clock_uncertainty() <= 2 * LATENCY);
}

#[test]
fn a_setpoint_never_expires_beyond_its_time_to_live() {
    let (line, mut client) = connected(|heard| {
        if let Request::Setpoint(setpoint) = &heard.request {
            let ahead = setpoint.expires_at_us.wrapping_sub(u32::try_from(heard.time_us).unwrap());
            // 100 ms, less the way here and the way back of the ping it was measured by, less
            // 1/1000 of up to half a second for drift.
            assert!((99_000..=100_000).contains(&ahead), "{ahead} µs");
        }
        healthy(heard)
    });
    let setpoint = Setpoint::Signal { fraction: 0.1 };
    for _ in 0..20 {
        client.set(1, 7, setpoint, Duration::from_millis(100)).unwrap();
        line.0.borrow_mut().now += Duration::from_millis(30);
        client.keep_alive().unwrap();
    }
}

/// The gateway refuses it and names the limit; what wraps around would be taken for a short one.
#[test]
fn a_time_to_live_beyond_the_wire_stays_too_long() {
    let (line, mut client) = connected(|heard| {
        let expires_at_us = match &heard.request {
            Request::Setpoint(setpoint) => setpoint.expires_at_us,
            Request::Native(native) => native.expires_at_us,
            _ => return healthy(heard),
        };
        let ahead = expires_at_us.wrapping_sub(u32::try_from(heard.time_us).unwrap());
        assert!((60_000_001..1 << 31).contains(&ahead), "{ahead} µs");
        healthy(heard)
    });
    for ttl in [Duration::from_micros((1 << 32) + 100_000), Duration::MAX] {
        client.set(1, 7, Setpoint::Signal { fraction: 0.1 }, ttl).unwrap();
        client.native(1, 7, Bytes::new(), ttl).unwrap();
    }
    assert_eq!(line.sent_after_opening().len(), 4);
}

#[test]
fn a_process_that_was_held_up_sends_what_is_stale_already() {
    let (line, client) = connected(healthy);
    let expiry = client.expiry(Duration::from_millis(100));
    line.0.borrow_mut().now += Duration::from_millis(300);
    let now = u32::try_from(gateway_time_us(line.0.borrow().now)).unwrap();
    assert!(expiry < now, "{expiry} and {now}");
}

#[test]
fn keep_alive_pings_only_when_the_line_was_quiet() {
    let (line, mut client) = connected(healthy);
    client.keep_alive().unwrap();
    assert_eq!(line.sent_after_opening().len(), 0);
    line.0.borrow_mut().now += KEEP_ALIVE_AFTER;
    client.keep_alive().unwrap();
    client.keep_alive().unwrap();
    assert_eq!(line.sent_after_opening().len(), 1);
}

#[test]
fn a_closed_connection_is_an_error_and_can_be_opened_again() {
    let (line, mut client) = connected(healthy);
    line.0.borrow_mut().closed = true;
    assert!(matches!(client.request(&STOP_ALL), Err(ClientError::Transport(_))));
    client.reconnect().unwrap();
    client.request(&STOP_ALL).unwrap();
    let line = line.0.borrow();
    assert_eq!(line.reopened, 1);
    // The lost request, then hello with another session, pings, and the request again.
    let hellos: Vec<_> =
        line.sent.iter().filter(|(_, bytes)| bytes.get(5) == HELLO.get(5)).collect();
    assert!(hellos.len() >= 2 && hellos[0].1 != hellos[1].1);
}

#[test]
fn a_gateway_that_restarted_is_known_by_its_clock() {
    let mut restarted_at = None;
    let (line, mut client) = connected(move |heard| {
        let mut said = healthy(heard);
        if matches!(heard.request, Request::Ping(_)) && heard.time_us > GATEWAY_START_US + 1_000_000
        {
            let start = *restarted_at.get_or_insert(heard.time_us);
            let time_us = 1_000 + heard.time_us - start;
            said = vec![(
                2 * LATENCY,
                reply_bytes(heard.sequence, &Reply::Ping(host_protocol::replies::Pong { time_us })),
            )];
        }
        said
    });
    line.0.borrow_mut().now = Duration::from_secs(2);
    client.ping().unwrap();
    assert!((1_000..2_000).contains(&client.gateway_now_us()), "{}", client.gateway_now_us());
}

#[test]
fn a_session_with_the_numbers_of_an_earlier_one_takes_none_of_its_answers() {
    let line = Scripted::new(healthy);
    Client::connect_as(line.clone(), 7, 1).unwrap();
    let first = line.0.borrow().sent.clone();
    line.0.borrow_mut().now += Duration::from_secs(1);
    Client::connect_as(line.clone(), 7, 1).unwrap();
    let second = line.0.borrow_mut().sent.split_off(first.len());
    assert_eq!(first.len(), second.len());
    for (_, bytes) in &second {
        assert!(first.iter().all(|(_, earlier)| earlier != bytes), "{bytes:02X?}");
    }
}

#[test]
fn events_that_got_lost_are_counted_by_their_numbers() {
    let (line, mut client) = connected(healthy);
    let event = Event::EStopCleared {};
    // 0, 1, twice 4, 5; the gateway counts anew; 7 of that.
    for (sequence, delay) in [(0, 1), (1, 2), (4, 3), (4, 4), (5, 5), (0, 6), (7, 7)] {
        line.say(Duration::from_millis(delay), event_bytes(sequence, 14, &event));
    }
    let mut seen = 0;
    while client.poll_event(Duration::from_millis(10)).unwrap().is_some() {
        seen += 1;
    }
    assert_eq!((seen, client.losses().events_lost, client.losses().late), (6, 2 + 6, 1));
}

#[test]
fn waiting_for_an_event_ends_although_bytes_keep_coming() {
    let (line, mut client) = connected(healthy);
    for ms in 0..1_000 {
        line.say(Duration::from_millis(ms), vec![0x55; 600]);
    }
    let start = client.now();
    assert_eq!(client.poll_event(Duration::from_millis(30)).unwrap(), None);
    assert!(client.now() - start <= Duration::from_millis(31));
    assert_eq!(client.poll_event(Duration::ZERO).unwrap(), None);
}

#[test]
fn a_client_of_any_transport_can_go_to_another_thread() {
    fn is_send<T: Send>() {}
    is_send::<Client<Box<dyn mgw_client::Transport + Send>>>();
}
