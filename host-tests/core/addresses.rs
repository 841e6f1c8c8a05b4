//! No id that one axis is sent frames on is an id of another axis's motor (GUARANTEES G7). What
//! each protocol uses is written here from the manuals, as numbers, apart from the code under test.

use crate::bench::{self, hello};
use crate::rig::Rig;
use host_protocol::{
    AxisParameter as Parameter, CanId, Error, Protocol, Reply, Request, StopAction, Value, requests,
};

/// An axis as far as its ids go.
#[derive(Debug, Clone, Copy)]
struct Motor {
    protocol: Protocol,
    node: u8,
    request_id: Option<u32>,
    reply_id: Option<u32>,
}

const fn rmd(node: u8) -> Motor {
    Motor { protocol: Protocol::Rmd, node, request_id: None, reply_id: None }
}

const fn thruster(node: u8) -> Motor {
    Motor { protocol: Protocol::Thruster, node, request_id: None, reply_id: None }
}

/// A D5. Its ids are numbers of the wire: bit 31 makes one of 29 bits.
const fn d5(node: u8, request_id: Option<u32>, reply_id: Option<u32>) -> Motor {
    Motor { protocol: Protocol::D5, node, request_id, reply_id }
}

/// RMD V3.6 §1.1.2 and §5: 0x140 + node, in motion mode 0x400 + node. Thruster manual §1.1: 0x300 +
/// node. D5: the node (D14).
fn sent(motor: Motor) -> Vec<u32> {
    let node = u32::from(motor.node);
    match motor.protocol {
        Protocol::Rmd => vec![0x140 + node, 0x400 + node],
        Protocol::Thruster => vec![0x300 + node],
        Protocol::D5 => vec![motor.request_id.unwrap_or(node)],
    }
}

/// Those, the replies (RMD 0x240 + node and 0x500 + node, thruster 0x280 + node), and the groups of
/// RMD (§3 and §4) and of D5 (D14).
fn used(motor: Motor, asked_in: Protocol) -> Vec<u32> {
    let node = u32::from(motor.node);
    let mut ids = sent(motor);
    match motor.protocol {
        Protocol::Rmd => ids.extend([0x240 + node, 0x500 + node, 0x280, 0x300]),
        Protocol::Thruster => ids.push(0x280 + node),
        Protocol::D5 if asked_in == Protocol::D5 => ids.push(0x0FE),
        Protocol::D5 => ids.extend([0x0FE].into_iter().chain(motor.reply_id)),
    }
    ids
}

/// Who is sent frames, on which id, and whose motor uses it: axis 0 is `a`, axis 1 is `b`.
fn expected(a: Motor, b: Motor) -> Vec<Error> {
    let both = [(0, a, 1, b), (1, b, 0, a)];
    let hits = both.into_iter().flat_map(|(axis, motor, other, motor_of_other)| {
        let used = used(motor_of_other, motor.protocol);
        let hits = sent(motor).into_iter().filter(move |id| used.contains(id));
        hits.map(move |id| Error::IdInUse { axis, id: CanId::from_wire(id).unwrap(), other })
    });
    hits.collect()
}

fn set(rig: &mut Rig, axis: u8, parameter: Parameter, value: u32) -> Result<Reply, Error> {
    let value = Value::Unsigned(value);
    rig.ask(Request::ConfigureAxis(requests::ConfigureAxis {
        axis,
        parameter: parameter.number(),
        value,
    }))
}

/// What makes up an axis on bus 0.
fn steps(motor: Motor) -> Vec<(Parameter, u32)> {
    let stop =
        if motor.protocol == Protocol::Thruster { StopAction::Coast } else { StopAction::Hold };
    let mut steps = vec![
        (Parameter::Bus, 0),
        (Parameter::Protocol, motor.protocol.number().into()),
        (Parameter::Node, motor.node.into()),
        (Parameter::StopAction, stop.number().into()),
    ];
    steps.extend(motor.request_id.map(|id| (Parameter::D5RequestId, id)));
    steps.extend(motor.reply_id.map(|id| (Parameter::D5ReplyId, id)));
    steps
}

fn configure(rig: &mut Rig, axis: u8, steps: &[(Parameter, u32)]) -> Result<(), Error> {
    steps.iter().try_for_each(|(parameter, value)| set(rig, axis, *parameter, *value).map(drop))
}

/// Its buses are not configured: one with a D5 is configured for nothing else, and the rule holds
/// before.
fn rig() -> Rig {
    let mut rig = Rig::new();
    hello(&mut rig);
    rig
}

#[track_caller]
fn assert_outcome(outcome: Result<(), Error>, (a, b): (Motor, Motor)) {
    let expected = expected(a, b);
    match outcome {
        Ok(()) => assert_eq!(expected, [], "{a:?} beside {b:?}"),
        Err(error) => {
            assert!(expected.contains(&error), "{a:?} beside {b:?}: {error:?}, not {expected:?}")
        }
    }
}

const RMD_NODES: [u8; 5] = [1, 2, 16, 31, 32];
const THRUSTER_NODES: [u8; 6] = [1, 2, 11, 64, 126, 127];
const D5_NODES: [u8; 4] = [1, 2, 0x0B, 0xFD];

/// An id of 29 bits is that of no RMD and no thruster, nor that of a D5 with the same number of 11
/// bits: those of node 1 and 2, of RMD 1 and of node 2 in bits 28 to 18 among them.
const EXTENDED_IDS: [(u32, Option<u32>); 4] = [
    (0x8000_0002, None),
    (0x8000_0401, Some(0x8000_0141)),
    (0x8008_0000, Some(0x8000_030B)),
    (0x9FFF_FFFF, Some(0x8000_0002)),
];

fn motors() -> Vec<Motor> {
    let with_ids =
        [(0x401, None), (0x7FF, Some(0x141)), (0x241, Some(0x30B)), (0x0B, Some(0x0B)), (2, None)];
    let mut motors: Vec<_> = RMD_NODES.map(rmd).to_vec();
    motors.extend(THRUSTER_NODES.map(thruster));
    motors.extend(D5_NODES.map(|node| d5(node, None, None)));
    motors.extend(with_ids.map(|(request, reply)| d5(0x20, Some(request), reply)));
    motors.extend(EXTENDED_IDS.map(|(request, reply)| d5(0x21, Some(request), reply)));
    motors
}

#[test]
fn of_every_two_motors_those_are_refused_whose_ids_meet_in_either_order() {
    let mut refused = 0;
    for a in motors() {
        for b in motors() {
            if (a.protocol, a.node) == (b.protocol, b.node) {
                continue;
            }
            let mut rig = rig();
            configure(&mut rig, 0, &steps(a)).unwrap();
            let mut rightly = steps(b);
            // Ids that name the motor differently come before it has an address.
            rightly.rotate_left(4);
            let outcome = configure(&mut rig, 1, &rightly);
            refused += usize::from(outcome.is_err());
            assert_outcome(outcome, (a, b));
        }
    }
    assert_eq!(refused, 12);
}

/// 2147483664 is bit 31 and 0x10.
#[test]
fn two_d5_motors_with_one_id_of_29_bits_are_refused_and_with_11_bits_of_that_number_not() {
    let mut rig = rig();
    configure(&mut rig, 0, &steps(d5(1, Some(2_147_483_664), None))).unwrap();
    configure(&mut rig, 1, &steps(d5(2, Some(0x10), None))).unwrap();
    let refused = configure(&mut rig, 2, &steps(d5(3, Some(2_147_483_664), None)));
    assert_eq!(
        refused,
        Err(Error::IdInUse { axis: 2, id: CanId::extended(0x10).unwrap(), other: 0 })
    );
    let refused = set(&mut rig, 2, Parameter::D5RequestId, 0x10);
    assert_eq!(
        refused,
        Err(Error::IdInUse { axis: 2, id: CanId::standard(0x10).unwrap(), other: 1 })
    );
    // No motor can be asked with these.
    for value in [0x800, 0x1234_5678, 0xA000_0000] {
        let refused = set(&mut rig, 2, Parameter::D5RequestId, value);
        assert_eq!(refused, Err(Error::NotACanId { parameter: 23, value }));
    }
}

/// All 2,048 ids as request and as reply id of a D5 beside every kind of axis.
#[test]
fn of_all_ids_of_a_d5_those_of_another_axis_are_refused() {
    let others = RMD_NODES.map(rmd).into_iter().chain(THRUSTER_NODES.map(thruster));
    let others = others.chain([d5(2, None, None), d5(3, Some(0x555), Some(0x666))]);
    for other in others {
        let mut rig = rig();
        configure(&mut rig, 0, &steps(other)).unwrap();
        configure(&mut rig, 1, &steps(d5(1, Some(0x7F0), None))).unwrap();
        for id in 0..=0x7FF {
            let outcome = set(&mut rig, 1, Parameter::D5RequestId, id).map(drop);
            assert_outcome(outcome, (other, d5(1, Some(id), None)));
        }
        set(&mut rig, 1, Parameter::D5RequestId, 0x7F0).unwrap();
        for id in 0..=0x7FF {
            let outcome = set(&mut rig, 1, Parameter::D5ReplyId, id).map(drop);
            assert_outcome(outcome, (other, d5(1, Some(0x7F0), Some(id))));
        }
    }
}

/// 0x401 is the motion mode of RMD 1: a stop of the D5 would set it turning.
#[test]
fn ids_that_meet_are_refused_in_whatever_order_the_parameters_come() {
    let pair = (rmd(1), d5(5, Some(0x401), None));
    let (a, b) = pair;
    for (axis, order) in orders(&steps(b))
        .into_iter()
        .map(|o| (1, o))
        .chain(orders(&steps(a)).into_iter().map(|o| (0, o)))
    {
        let mut rig = rig();
        configure(&mut rig, 1 - axis, &steps(if axis == 1 { a } else { b })).unwrap();
        assert_outcome(configure(&mut rig, axis, &order), pair);
    }
}

fn orders(steps: &[(Parameter, u32)]) -> Vec<Vec<(Parameter, u32)>> {
    let Some((first, rest)) = steps.split_first() else { return vec![vec![]] };
    let mut all = Vec::new();
    for order in orders(rest) {
        for at in 0..=order.len() {
            let mut longer = order.clone();
            longer.insert(at, *first);
            all.push(longer);
        }
    }
    all
}

#[test]
fn an_axis_that_moves_or_is_renamed_is_held_to_it_and_one_that_is_removed_is_forgotten() {
    let meets = (rmd(2), d5(5, Some(0x142), None));
    let mut rig = rig();
    configure(&mut rig, 0, &steps(rmd(1))).unwrap();
    configure(&mut rig, 1, &steps(meets.1)).unwrap();
    assert_outcome(set(&mut rig, 0, Parameter::Node, 2).map(drop), meets);
    set(&mut rig, 1, Parameter::Bus, 1).unwrap();
    set(&mut rig, 0, Parameter::Node, 2).unwrap();
    assert_outcome(set(&mut rig, 1, Parameter::Bus, 0).map(drop), meets);
    rig.ask(Request::RemoveAxis(requests::RemoveAxis { axis: 0 })).unwrap();
    set(&mut rig, 1, Parameter::Bus, 0).unwrap();
    rig.run(10_000);
    rig.reset();
    hello(&mut rig);
    assert_outcome(configure(&mut rig, 0, &steps(meets.0)), meets);
}

#[test]
fn on_rs485_there_are_no_ids_to_meet() {
    let (mut rig, _) = bench::rmd_serial(StopAction::Hold);
    let other = [
        (Parameter::Bus, 2),
        (Parameter::Protocol, 1),
        (Parameter::Node, 2),
        (Parameter::StopAction, 1),
    ];
    configure(&mut rig, 1, &other).unwrap();
}
