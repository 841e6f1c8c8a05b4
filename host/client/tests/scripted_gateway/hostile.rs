//! Answers with a right checksum and any content: nothing panics, and everything ends.

use std::ops::ControlFlow;
use std::time::Duration;

use crate::line::{Heard, LATENCY, Said, Scripted, healthy, reply_bytes};
use host_protocol::replies::{NativeReply, Pong};
use host_protocol::{
    AxisParameter, Bytes, Kind, MAX_FRAME, Reply, Request, Setpoint, StateFields, StopTarget, Value,
};
use mgw_client::{Client, ClientError, Hold, NativeHold, StopRequest, stop_before_hello};

/// Sessions that are played.
const RUNS: u64 = 200;
/// No run takes longer, in the line's time.
const LIMIT: Duration = Duration::from_secs(120);

/// A reply to this request, of so many random bytes.
fn random_reply(sequence: u16, number: u16, random: &mut fastrand::Rng) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let body: [u8; 64] = std::array::from_fn(|_| match random.u8(..4) {
        0 => 0,
        1 => 0xFF,
        2 => random.u8(..3),
        _ => random.u8(..),
    });
    // As many of the bytes as the next length says.
    let length = match random.usize(..4) {
        0 => host_protocol::encode(Kind::Reply, sequence, number, &(), &mut out),
        1 => host_protocol::encode(
            Kind::Reply,
            sequence,
            number,
            &<[u8; 8]>::try_from(&body[..8]).unwrap(),
            &mut out,
        ),
        2 => host_protocol::encode(
            Kind::Reply,
            sequence,
            number,
            &<[u8; 20]>::try_from(&body[..20]).unwrap(),
            &mut out,
        ),
        _ => {
            let (first, second) = (
                <[u8; 32]>::try_from(&body[..32]).unwrap(),
                <[u8; 12]>::try_from(&body[..12]).unwrap(),
            );
            host_protocol::encode(Kind::Reply, sequence, number, &(first, second), &mut out)
        }
    };
    out[..length.unwrap()].to_vec()
}

fn use_everything(client: &mut Client<Scripted>) {
    let _ = client.ping();
    let _ = client.list_axes();
    let _ = client.incidents();
    let _ = client.axis_ttl(0);
    let _ = client.gateway_status();
    let _ = client.bus_status(0);
    let _ = client.read_state(0);
    let _ = client.subscribe(&[0, 31], StateFields::NONE, Duration::from_millis(10));
    let ttl = Duration::from_millis(100);
    let epoch = client.arm(0).map_or(0, |armed| armed.epoch);
    let _ = client.move_relative(0, epoch, 1.0, 1.0, ttl);
    let _ = client.native(0, epoch, Bytes::new(), ttl);
    let hold = Hold { axis: 0, epoch, setpoint: Setpoint::Signal { fraction: 0.1 }, ttl };
    let _ = client
        .hold_setpoints(&[hold], Duration::from_millis(300), |_| Ok(ControlFlow::Continue(())));
    let _ = client.hold(Duration::from_millis(100), |_| Ok(ControlFlow::Continue(())));
    let _ = client.stop(StopTarget::All);
    let _ = client.stop_armed();
    let _ = (client.gateway_now_us(), client.clock_uncertainty(), client.expiry(Duration::MAX));
}

#[test]
fn replies_of_random_bytes_break_nothing() {
    for seed in 0..RUNS {
        let mut random = fastrand::Rng::with_seed(seed);
        let line = Scripted::new(move |heard| {
            if matches!(heard.request, Request::Hello(_))
                || random.u8(..4) == 0 && is_known(&heard.request)
            {
                return healthy(heard);
            }
            vec![(2 * LATENCY, random_reply(heard.sequence, heard.request.number(), &mut random))]
        });
        let Ok(mut client) = Client::connect_as(line.clone(), 1, 0) else { continue };
        use_everything(&mut client);
        assert!(line.0.borrow().now < LIMIT, "seed {seed}: {:?}", line.0.borrow().now);
    }
}

/// Whether the script of a healthy gateway knows it.
fn is_known(request: &Request) -> bool {
    matches!(
        request,
        Request::Ping(_)
            | Request::Setpoint(_)
            | Request::Stop(_)
            | Request::MoveRelative(_)
            | Request::Native(_)
    )
}

#[test]
fn a_time_beyond_all_bounds_overflows_nothing() {
    for time_us in [u64::MAX, u64::MAX - 50_000, 1 << 63, 0] {
        let line = Scripted::new(move |heard| match heard.request {
            Request::Ping(_) => {
                vec![(2 * LATENCY, reply_bytes(heard.sequence, &Reply::Ping(Pong { time_us })))]
            }
            Request::Arm(_) => vec![],
            _ => healthy(heard),
        });
        let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
        for _ in 0..20 {
            line.0.borrow_mut().now += Duration::from_millis(700);
            client.ping().unwrap();
            let _ =
                client.set(1, 7, Setpoint::Signal { fraction: 0.1 }, Duration::from_millis(100));
            client.clock_uncertainty();
        }
        assert!(matches!(client.arm(0), Err(ClientError::NoAnswer { .. })));
    }
}

/// The reply to everything but hello and pings is that of a healthy gateway and one more byte.
fn one_byte_too_many(heard: &Heard) -> Vec<Said> {
    let mut out = [0; MAX_FRAME];
    let length = match &heard.request {
        Request::Hello(_) | Request::Ping(_) => return healthy(heard),
        Request::Native(native) => {
            let reply = (NativeReply { data: native.data.clone() }, 0u8);
            host_protocol::encode(
                Kind::Reply,
                heard.sequence,
                heard.request.number(),
                &reply,
                &mut out,
            )
        }
        request => {
            host_protocol::encode(Kind::Reply, heard.sequence, request.number(), &0u8, &mut out)
        }
    };
    vec![(2 * LATENCY, out[..length.unwrap()].to_vec())]
}

#[test]
fn a_reply_with_bytes_left_over_is_none() {
    let line = Scripted::new(one_byte_too_many);
    let mut client = Client::connect_as(line.clone(), 1, 0).unwrap();
    let ttl = Duration::from_millis(100);
    let unreadable = |result: Result<(), ClientError>, name: &str| match result {
        Err(ClientError::UnreadableReply { request, .. }) => assert_eq!(request, name),
        other => panic!("{name}: {other:?}"),
    };
    unreadable(client.configure_axis(0, AxisParameter::Node, Value::Unsigned(1)), "ConfigureAxis");
    unreadable(client.set(0, 7, Setpoint::Signal { fraction: 0.1 }, ttl), "Setpoint");
    let hold = Hold { axis: 0, epoch: 7, setpoint: Setpoint::Signal { fraction: 0.1 }, ttl };
    let go_on = |_: &mut _| Ok(ControlFlow::Continue(()));
    unreadable(client.hold_setpoints(&[hold], Duration::from_secs(1), go_on), "Setpoint");
    let hold = NativeHold { axis: 0, epoch: 7, data: Bytes::new(), ttl };
    unreadable(client.hold_native(&hold, Duration::from_secs(1), go_on), "Native");
    assert_eq!(client.native_reply(), None);
}

#[test]
fn a_stop_whose_reply_has_bytes_left_over_is_written_again_and_not_confirmed() {
    let mut line = Scripted::new(one_byte_too_many);
    let stopped = stop_before_hello(&mut line, StopRequest::Stop(StopTarget::All));
    assert!(matches!(stopped, Err(ClientError::StopUnanswered { .. })), "{stopped:?}");
    assert!(line.0.borrow().sent.len() > 100, "{}", line.0.borrow().sent.len());
}
