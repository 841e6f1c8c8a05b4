//! The configuration that a gateway has, and what is written to its motors.

use host_protocol::{Change, GatewayParameter, MotorTimeout, Protocol};
use mgw_client::{Client, ClientError, Transport};

use super::Configuration;
use crate::failure::Failure;

/// Reads the whole configuration of a gateway.
pub fn read<T: Transport>(client: &mut Client<T>) -> Result<Configuration, ClientError> {
    let mut configuration = Configuration::default();
    for parameter in GatewayParameter::ALL.iter().copied() {
        if let Some(value) = client.read_gateway_parameter(parameter)? {
            configuration.gateway.insert(parameter, value);
        }
    }
    for bus in 0..u8::try_from(client.hello().buses.len()).unwrap_or(u8::MAX) {
        if let Some(config) = client.bus_status(bus)?.config {
            configuration.buses.insert(bus, config);
        }
    }
    for summary in client.list_axes()? {
        let (settings, motor_timeout) = client.axis_settings(summary.axis)?;
        let known = |number| host_protocol::AxisParameter::from_number(number);
        let values =
            settings.iter().filter_map(|setting| Some((known(setting.parameter)?, setting.value)));
        configuration.axes.insert(summary.axis, values.collect());
        if let Some(timeout_ms) = written(motor_timeout, summary.protocol) {
            configuration.motor_timeouts.insert(summary.axis, timeout_ms);
        }
    }
    for named in client.names()? {
        configuration.names.insert(named.of, named.name);
    }
    Ok(configuration)
}

/// Makes all of these changes or none.
pub fn make<T: Transport>(client: &mut Client<T>, changes: &[Change]) -> Result<(), ClientError> {
    if changes.is_empty() {
        return Ok(());
    }
    client.begin_changes()?;
    client.add_changes(changes)?;
    client.apply_changes()
}

/// The time that writing gives the motor the timeout that is known of it.
fn written(timeout: MotorTimeout, protocol: Option<Protocol>) -> Option<u32> {
    match timeout {
        MotorTimeout::Written { timeout_ms } => Some(timeout_ms),
        // The switch of a D5: nobody states its time.
        MotorTimeout::Verified if protocol == Some(Protocol::D5) => Some(1),
        MotorTimeout::Off => Some(0),
        MotorTimeout::Verified | MotorTimeout::Unknown => None,
    }
}

/// Writes the motors' own timeouts, but for those that the gateway knows the motor to have: an RMD
/// keeps it in ROM, which wears (RMD V3.6 §2.30). Returns how many were written.
pub fn write_timeouts<T: Transport>(
    client: &mut Client<T>,
    wanted: &Configuration,
) -> Result<usize, Failure> {
    let (mut count, mut failed) = (0, None);
    for (axis, timeout_ms) in &wanted.motor_timeouts {
        let protocol = wanted.protocol_of(*axis);
        let known = written(client.axis_settings(*axis)?.1, protocol);
        let is_known = known == Some(*timeout_ms)
            || protocol == Some(Protocol::D5) && known == Some(1) && *timeout_ms != 0;
        if is_known {
            continue;
        }
        match client.provision_motor_timeout(*axis, *timeout_ms) {
            Ok(_) => count += 1,
            // The others are told all the same.
            Err(error @ ClientError::Gateway(_)) => {
                failed.get_or_insert(not_written(*axis, error));
            }
            Err(error) => return Err(error.into()),
        }
    }
    failed.map_or(Ok(count), Err)
}

/// The configuration is there, and the motor was not told.
fn not_written(axis: u8, error: ClientError) -> Failure {
    match error {
        ClientError::Gateway(error) => Failure::Explained {
            error,
            text: format!(
                "the configuration is applied; the timeout of the motor of axis {axis} is not \
                    written: {error}. Apply the file again when the motor answers; where it has another id by \
                    now, `mgw config axis {axis} node=…` says so"
            ),
        },
        error => error.into(),
    }
}
