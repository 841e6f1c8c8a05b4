//! What the tables of every protocol have in common.

use super::*;
use host_protocol::Value;

/// An axis that is due for a poll looks for the exchange when it has its turn
/// (`axis/wants.rs`): it relies on finding one.
#[test]
fn every_motor_has_a_command_for_a_poll_and_for_a_reading_of_its_state() {
    for protocol in Protocol::ALL.iter().copied() {
        for position_device in [false, true] {
            let mut config = AxisConfig::new();
            let unsigned = Value::Unsigned(protocol.number().into());
            config.set(AxisParameter::Protocol, unsigned).unwrap();
            config.set(AxisParameter::PositionDevice, Value::Bool(position_device)).unwrap();
            let is_served = |exchange: &Exchange| command(*exchange, &config).is_some();
            let Info { state, polls, .. } = Info::of(protocol);
            assert!(polls.iter().any(is_served), "{protocol:?} {position_device}: armed");
            assert!(state.iter().any(is_served), "{protocol:?} {position_device}: watched");
            assert!(
                is_served(&Exchange::Velocity),
                "{protocol:?} {position_device}: holding, or in doubt"
            );
        }
    }
}
