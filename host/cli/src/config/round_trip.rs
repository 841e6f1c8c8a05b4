//! What a dump prints is the same configuration again, whatever requests made it.

use fastrand::Rng;
use host_protocol::{Change, ParameterInfo, ValueKind};
use mgw_client::{Client, ClientError};
use mgw_sim::SimTransport;

use super::*;
use crate::four_motors;

type Gateway = Client<SimTransport>;

/// Configurations that are tried.
const RUNS: u64 = 300;
/// Requests that lead to each, as a rule not all of them taken.
const REQUESTS: usize = 40;
/// Few, so that they meet: in one place, with one name.
const AXES: [u8; 5] = [0, 1, 2, 3, 31];
const BUSES: [u8; 4] = [0, 1, 2, 3];

fn gateway() -> Gateway {
    let mut client = four_motors::connect(&four_motors::world(None)).unwrap();
    client.take_authority().unwrap();
    client
}

fn one<T: Copy>(rng: &mut Rng, of: &[T]) -> T {
    *rng.choice(of).unwrap()
}

/// A value that the parameter can have.
fn value(rng: &mut Rng, info: &ParameterInfo) -> Value {
    match (info.kind, info.min, info.max) {
        (ValueKind::Unsigned, Value::Unsigned(min), Value::Unsigned(max)) => {
            Value::Unsigned(match rng.u8(..4) {
                0 => min,
                1 => max,
                2 => rng.u32(min..=max),
                _ => rng.u32(min..=max.min(min.saturating_add(11))),
            })
        }
        (ValueKind::Float, Value::Float(min), Value::Float(max)) => {
            Value::Float(match rng.u8(..4) {
                0 => min,
                1 => max,
                2 => f32::EPSILON * rng.f32(),
                _ => (min + (max - min) * rng.f32()).clamp(min, max),
            })
        }
        (ValueKind::Signed, ..) => Value::Signed(one(rng, &[-1, 1])),
        _ => Value::Bool(rng.bool()),
    }
}

fn change(rng: &mut Rng) -> Change {
    let axis = one(rng, &AXES);
    match rng.u8(..12) {
        0 => {
            let parameter = GatewayParameter::LinkSilenceUs;
            Change::Gateway { parameter: parameter.number(), value: value(rng, parameter.info()) }
        }
        1 | 2 => {
            let some: Vec<Protocol> =
                Protocol::ALL.iter().copied().filter(|_| rng.bool()).collect();
            let config = BusConfig {
                bitrate: one(rng, &[1_000_000, 500_000, 210_526, 115_200]),
                protocols: ProtocolSet::of(&some),
                exclusive: rng.bool(),
                reply_window_us: rng.u32(100..=20_000),
            };
            let config = (rng.u8(..4) > 0).then_some(config);
            Change::Bus { bus: one(rng, &BUSES), config }
        }
        3 => {
            let of = [Subject::Gateway, Subject::Bus(one(rng, &BUSES)), Subject::Axis(axis)];
            let name = rng.bool().then(|| one(rng, &["left", "A-1_b", "sixteen-letters_"]));
            let name = name.map(|name| Text::try_from(name).unwrap());
            Change::Name { of: one(rng, &of), name }
        }
        _ => {
            let all = AxisParameter::ALL;
            let required: Vec<_> =
                all.iter().copied().filter(|parameter| parameter.info().required).collect();
            let parameter = if rng.bool() { one(rng, &required) } else { one(rng, all) };
            let value = (rng.u8(..8) > 0).then(|| value(rng, parameter.info()));
            Change::Axis { axis, parameter: parameter.number(), value }
        }
    }
}

/// What makes an axis whole.
fn whole(rng: &mut Rng) -> Vec<Change> {
    let axis = one(rng, &AXES);
    let (bus, protocol) = one(rng, &[(0, 1), (0, 2), (1, 3), (2, 1), (2, 3), (7, 1)]);
    let values = [
        (AxisParameter::Bus, bus),
        (AxisParameter::Protocol, protocol),
        (AxisParameter::Node, rng.u32(1..12)),
        (AxisParameter::StopAction, rng.u32(1..4)),
    ];
    let set = |(parameter, value): (AxisParameter, u32)| Change::Axis {
        axis,
        parameter: parameter.number(),
        value: Some(Value::Unsigned(value)),
    };
    values.map(set).into()
}

/// Has a gateway do something, which it may refuse.
fn ask(rng: &mut Rng, client: &mut Gateway) -> Result<(), ClientError> {
    let axis = one(rng, &AXES);
    match rng.u8(..10) {
        0 => client.remove_axis(axis).map(drop),
        1 => client.provision_motor_timeout(axis, one(rng, &[0, 1, 100, 300, 5_000])).map(drop),
        2 | 3 => make(client, &whole(rng)),
        4 | 5 => {
            let changes: Vec<Change> = (0..rng.usize(2..6)).map(|_| change(rng)).collect();
            make(client, &changes)
        }
        _ => make(client, &[change(rng)]),
    }
}

#[test]
fn what_requests_have_made_is_dumped_as_a_file_that_makes_it_again() {
    let (mut taken, mut incomplete) = (0, 0);
    for seed in 0..RUNS {
        let rng = &mut Rng::with_seed(seed);
        let mut before = gateway();
        if rng.bool() {
            let changes =
                Configuration::default().changes_to(&four_motors::configuration().unwrap());
            make(&mut before, &changes).unwrap();
        }
        for _ in 0..REQUESTS {
            match ask(rng, &mut before) {
                Ok(()) => taken += 1,
                Err(ClientError::Gateway(_)) => {}
                Err(error) => panic!("{seed}: {error}"),
            }
        }
        let mut made = read(&mut before).unwrap();
        let text = dump(&made);
        incomplete += text.matches("incomplete = true").count();
        let source = Source { path: format!("the dump of run {seed}"), text: text.clone() };
        let board = BoardPorts::of(before.hello());
        let nothing = Configuration::default();
        let wanted = source.onto(nothing.clone(), &board);
        let wanted = wanted.unwrap_or_else(|failure| panic!("{failure}\n{text}"));
        let whole = made.clone();
        made.motor_timeouts.retain(|axis, _| whole.check_motor_timeout(*axis).is_ok());
        assert_eq!(wanted, made, "{text}");
        source.for_any_board().unwrap_or_else(|failure| panic!("{failure}\n{text}"));
        let mut after = gateway();
        make(&mut after, &nothing.changes_to(&wanted))
            .unwrap_or_else(|error| panic!("{seed}: {error}\n{text}"));
        // What the motors keep is written to them afterwards, to those that are there.
        let made = Configuration { motor_timeouts: BTreeMap::new(), ..made };
        let read = Configuration { motor_timeouts: BTreeMap::new(), ..read(&mut after).unwrap() };
        assert_eq!(read, made, "{text}");
        let same = source.onto(read.clone(), &board).unwrap();
        assert_eq!(read.changes_to(&same), [], "merged: {text}");
        assert_eq!(dump_like(&text, &wanted).unwrap(), text);
    }
    // Otherwise it tries little.
    assert!(taken > 5 * RUNS && incomplete > 10, "{taken} taken, {incomplete} incomplete");
}
