//! Limits that can act, and those that cannot: what nothing on an axis measures and no setpoint
//! carries is refused as a limit (GUARANTEES G2), in whatever order the parameters come.

use crate::bench::{self, configure_bus, hello};
use crate::rig::Rig;
use gateway::AxisRules;
use host_protocol::{
    AxisParameter, BusKind, Error, Protocol, Quantity, Reply, Request, StopAction, Value, requests,
};

const LIMITS: [AxisParameter; 7] = [
    AxisParameter::VelocityLimitRadS,
    AxisParameter::CurrentLimitA,
    AxisParameter::PositionMinRad,
    AxisParameter::PositionMaxRad,
    AxisParameter::SignalLimit,
    AxisParameter::TemperatureLimitC,
    AxisParameter::TorqueLimitNm,
];

/// Kinds of axes: protocol, whether it is a position device, bus, and the limits that are refused.
const KINDS: [(Protocol, bool, u8, &[AxisParameter]); 5] = [
    (Protocol::Rmd, false, 0, &[AxisParameter::SignalLimit]),
    (Protocol::Rmd, false, 2, &[AxisParameter::SignalLimit, AxisParameter::TorqueLimitNm]),
    (
        Protocol::Thruster,
        false,
        0,
        &[
            AxisParameter::PositionMinRad,
            AxisParameter::PositionMaxRad,
            AxisParameter::TorqueLimitNm,
        ],
    ),
    (Protocol::Thruster, true, 0, &[AxisParameter::TorqueLimitNm]),
    (
        Protocol::D5,
        false,
        1,
        &[AxisParameter::CurrentLimitA, AxisParameter::SignalLimit, AxisParameter::TorqueLimitNm],
    ),
];

fn rig() -> Rig {
    let mut rig = Rig::new();
    hello(&mut rig);
    configure_bus(&mut rig, 0, 1_000_000, &[Protocol::Rmd, Protocol::Thruster]);
    configure_bus(&mut rig, 1, 210_526, &[Protocol::D5]);
    configure_bus(&mut rig, 2, 115_200, &[Protocol::Rmd]);
    rig
}

fn set(rig: &mut Rig, parameter: AxisParameter, value: Value) -> Result<Reply, Error> {
    rig.ask(Request::ConfigureAxis(requests::ConfigureAxis {
        axis: 0,
        parameter: parameter.number(),
        value,
    }))
}

fn address(protocol: Protocol, device: bool, bus: u8) -> [(AxisParameter, Value); 5] {
    let stop = if protocol == Protocol::Thruster { StopAction::Coast } else { StopAction::Hold };
    [
        (AxisParameter::Bus, Value::Unsigned(bus.into())),
        (AxisParameter::Protocol, Value::Unsigned(protocol.number().into())),
        (AxisParameter::Node, Value::Unsigned(11)),
        (AxisParameter::PositionDevice, Value::Bool(device)),
        (AxisParameter::StopAction, Value::Unsigned(stop.number().into())),
    ]
}

#[test]
fn a_limit_that_nothing_measures_is_refused_in_whatever_order_the_parameters_come() {
    for (protocol, device, bus, refused) in KINDS {
        for limit in LIMITS {
            let wanted = match refused.contains(&limit) {
                true => Err(Error::CannotMeasure { axis: 0, parameter: limit.number() }),
                false => Ok(()),
            };
            let parameters = address(protocol, device, bus);
            let kind = if bus == 2 { BusKind::Rs485 } else { BusKind::Can };
            for limit_at in 0..=parameters.len() {
                let mut order = parameters.to_vec();
                order.insert(limit_at, (limit, Value::Float(0.5)));
                let (mut rig, mut rules) = (rig(), AxisRules::new(0, kind));
                // The one that makes the axis complete, or comes after, is the one that is refused.
                let results: Vec<_> = order
                    .iter()
                    .map(|(name, value)| set(&mut rig, *name, *value).map(drop))
                    .collect();
                let first =
                    results.iter().find(|result| result.is_err()).copied().unwrap_or(Ok(()));
                assert_eq!(first, wanted, "{protocol:?} {bus} {limit:?} at {limit_at}");
                order.iter().for_each(|(name, value)| rules.set(*name, *value).unwrap());
                assert_eq!(rules.check(), wanted, "{protocol:?} {bus} {limit:?}");
            }
        }
    }
}

#[test]
fn an_encoder_that_a_limit_needs_stays() {
    let mut rig = rig();
    for (parameter, value) in address(Protocol::Thruster, true, 0) {
        set(&mut rig, parameter, value).unwrap();
    }
    set(&mut rig, AxisParameter::PositionMaxRad, Value::Float(1.0)).unwrap();
    let refused =
        Err(Error::CannotMeasure { axis: 0, parameter: AxisParameter::PositionMaxRad.number() });
    assert_eq!(set(&mut rig, AxisParameter::PositionDevice, Value::Bool(false)), refused);
}

#[test]
fn a_position_limit_lies_where_the_motor_tells_of_what_is_beyond() {
    use AxisParameter::{
        LimitMargin, PositionMaxRad, PositionMinRad, StatePollUs, VelocityLimitRadS,
    };
    // A D5 tells 32 767°, a thruster 179.9° and an RMD 2^31 hundredths of a degree. 3/4 of that,
    // less the margin, unless a speed says how far the motor gets in 50 ms.
    let fast = (VelocityLimitRadS, Value::Float(100.0));
    let slow = (VelocityLimitRadS, Value::Float(3.2));
    let margin = (LimitMargin, Value::Float(0.0));
    let often = (StatePollUs, Value::Unsigned(5_000));
    for (protocol, bus, set_before, last) in [
        (Protocol::D5, 1, vec![], 389.9),
        (Protocol::D5, 1, vec![fast], 514.8),
        (Protocol::D5, 1, vec![fast, often], 519.3),
        (Protocol::D5, 1, vec![slow, margin], 571.7),
        (Protocol::Thruster, 0, vec![], 2.139),
        (Protocol::Thruster, 0, vec![slow], 2.692),
        (Protocol::Rmd, 0, vec![], 255_500.0),
    ] {
        let mut rig = rig();
        for (parameter, value) in address(protocol, protocol == Protocol::Thruster, bus) {
            set(&mut rig, parameter, value).unwrap();
        }
        for (parameter, value) in &set_before {
            set(&mut rig, *parameter, *value).unwrap();
        }
        for (limit, sign) in [(PositionMinRad, -1.0), (PositionMaxRad, 1.0)] {
            let what = format!("{protocol:?} {set_before:?} {limit:?}");
            set(&mut rig, limit, Value::Float(sign * last)).expect(&what);
            let result = set(&mut rig, limit, Value::Float(sign * last * 1.002));
            let Err(Error::OutOfRange { quantity, min, max, .. }) = result else {
                panic!("{what}: {result:?}")
            };
            assert_eq!(quantity, Quantity::Parameter(limit.number()), "{what}");
            assert!((last..last * 1.002).contains(&max) && min == -max, "{what}: {min} to {max}");
        }
    }
}

#[test]
fn a_speed_at_which_nothing_of_the_range_is_left_is_refused_beside_a_position_limit() {
    let mut rig = rig();
    for (parameter, value) in address(Protocol::Thruster, true, 0) {
        set(&mut rig, parameter, value).unwrap();
    }
    set(&mut rig, AxisParameter::PositionMaxRad, Value::Float(0.0)).unwrap();
    // 179.8° less 0.1 rad, in 50 ms, with a tenth as the speed's own margin.
    set(&mut rig, AxisParameter::VelocityLimitRadS, Value::Float(55.2)).unwrap();
    let result = set(&mut rig, AxisParameter::VelocityLimitRadS, Value::Float(55.3));
    let quantity = Quantity::Parameter(AxisParameter::VelocityLimitRadS.number());
    assert!(
        matches!(result, Err(Error::OutOfRange { quantity: of, .. }) if of == quantity),
        "{result:?}"
    );
}

#[test]
fn the_least_standstill_is_one_unit_of_the_motor_s_reading() {
    // 1 °/s, and 1 rpm.
    for (protocol, bus, unit, below) in [
        (Protocol::Rmd, 0, 0.017_453_3, 0.017),
        (Protocol::Thruster, 0, 0.104_72, 0.1),
        (Protocol::D5, 1, 0.017_453_3, 0.0),
    ] {
        let mut rig = rig();
        for (parameter, value) in address(protocol, false, bus) {
            set(&mut rig, parameter, value).unwrap();
        }
        set(&mut rig, AxisParameter::StandstillRadS, Value::Float(unit)).unwrap();
        let result = set(&mut rig, AxisParameter::StandstillRadS, Value::Float(below));
        let Err(Error::OutOfRange { quantity, value, min, max }) = result else {
            panic!("{result:?}")
        };
        assert_eq!((quantity, value, max), (Quantity::Parameter(11), below, 10.0));
        assert!((min - unit).abs() < 1e-5, "{min}");
    }
    // The default suits all of them.
    let (mut thruster, _) = bench::thruster();
    bench::arm(&mut thruster);
}
