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
