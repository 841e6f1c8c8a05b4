//! Tests of `axis/config.rs`.

use super::*;
use host_protocol::ParameterInfo;

#[test]
fn values_of_every_kind_come_back() {
    let mut config = AxisConfig::new();
    let values = [
        (AxisParameter::Node, Value::Unsigned(253)),
        (AxisParameter::Direction, Value::Signed(-1)),
        (AxisParameter::PositionMinRad, Value::Float(-2.5)),
        (AxisParameter::UnsafeInfiniteTtl, Value::Bool(true)),
    ];
    for (parameter, value) in values {
        config.set(parameter, value).unwrap();
        assert_eq!(config.get(parameter), Some(value));
    }
    assert_eq!(config.get(AxisParameter::TtlUs), Some(Value::Unsigned(100_000))); // the default
    assert_eq!(config.get(AxisParameter::VelocityLimitRadS), None);
    assert_eq!(config.missing(), Some(AxisParameter::Bus));
}

#[test]
fn a_configuration_comes_back_from_its_words_and_a_value_out_of_range_does_not() {
    let mut config = AxisConfig::new();
    config.set(AxisParameter::Node, Value::Unsigned(253)).unwrap();
    config.set(AxisParameter::Direction, Value::Signed(-1)).unwrap();
    config.set(AxisParameter::TripGroup, Value::Unsigned(7)).unwrap();
    let mut words = config.to_words();
    assert_eq!(AxisConfig::from_words(&words), Ok(config));
    assert_eq!(AxisConfig::from_words(&[0; AxisConfig::WORDS]), Ok(AxisConfig::new()));
    assert_eq!(AxisConfig::from_words(&[]), Ok(AxisConfig::new()));
    words[SET_WORDS + 2] = 254; // the node
    assert!(AxisConfig::from_words(&words).is_err());
}

/// Another image reads them: which parameters are set, then one word for each.
#[test]
fn the_words_of_a_configuration_are_these() {
    let mut config = AxisConfig::new();
    for (parameter, value) in [
        (AxisParameter::Bus, Value::Unsigned(1)),
        (AxisParameter::Protocol, Value::Unsigned(3)),
        (AxisParameter::Node, Value::Unsigned(11)),
        (AxisParameter::Direction, Value::Signed(-1)),
        (AxisParameter::StopAction, Value::Unsigned(2)),
        (AxisParameter::StandstillRadS, Value::Float(0.5)),
    ] {
        config.set(parameter, value).unwrap();
    }
    let words = config.to_words();
    let (begin, rest) = words.split_at(13);
    assert_eq!(begin, [0x41F, 0, 1, 3, 11, 0xFFFF_FFFF, 2, 0, 0, 0, 0, 0, 0x3F00_0000]);
    assert!(rest.iter().all(|word| *word == 0));
}

#[test]
fn a_refused_value_changes_nothing() {
    let mut config = AxisConfig::new();
    assert!(config.set(AxisParameter::TtlUs, Value::Unsigned(4_999)).is_err());
    assert!(config.set(AxisParameter::TtlUs, Value::Float(5_000.0)).is_err());
    assert!(config.is_empty());
}

/// Every parameter at both ends of its range, all set at once: no value touches another.
#[test]
fn each_value_has_room_of_its_own() {
    for end in [|info: &ParameterInfo| info.min, |info: &ParameterInfo| info.max] {
        let mut config = AxisConfig::new();
        for parameter in AxisParameter::ALL.iter().copied() {
            config.set(parameter, end(parameter.info())).unwrap();
        }
        for parameter in AxisParameter::ALL.iter().copied() {
            assert_eq!(config.get(parameter), Some(end(parameter.info())), "{parameter}");
        }
        assert_eq!(AxisConfig::from_words(&config.to_words()), Ok(config.clone()));
        for parameter in AxisParameter::ALL {
            assert!(config.exchange(parameter.place(), None).is_some());
        }
        assert_eq!(config, AxisConfig::new());
    }
}
