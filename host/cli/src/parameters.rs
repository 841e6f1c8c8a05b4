//! Values of parameters as people write them: `stop_action=hold`, `ttl_us=100000`.

use host_protocol::{
    AxisParameter, CanId, GatewayParameter, ParameterInfo, Protocol, StopAction, Value, ValueKind,
};

use crate::config::NAME;
use crate::failure::Failure;

/// What stands before a hexadecimal number.
const HEX_PREFIX: &str = "0x";

/// Splits `NAME=VALUE`.
pub fn split(assignment: &str) -> Result<(&str, &str), Failure> {
    match assignment.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => {
            Ok((name.trim(), value.trim()))
        }
        _ => Err(Failure::Usage(format!("`{assignment}` sets nothing. Write NAME=VALUE"))),
    }
}

/// The axis parameter of that name.
pub fn axis_parameter(name: &str) -> Result<AxisParameter, Failure> {
    let names = AxisParameter::ALL.iter().map(|parameter| parameter.text().name).chain([NAME]);
    AxisParameter::from_name(name).ok_or_else(|| unknown("an axis", name, names))
}

/// The gateway parameter of that name.
pub fn gateway_parameter(name: &str) -> Result<GatewayParameter, Failure> {
    let names = GatewayParameter::ALL.iter().map(|parameter| parameter.text().name).chain([NAME]);
    GatewayParameter::from_name(name).ok_or_else(|| unknown("the gateway", name, names))
}

/// The failure for a name that is not among `names`.
pub fn unknown(owner: &str, name: &str, names: impl Iterator<Item = &'static str>) -> Failure {
    let names: Vec<&str> = names.collect();
    Failure::Usage(format!("{owner} has no parameter `{name}`. There are: {}", names.join(", ")))
}

/// Reads the value of a parameter. Whether it lies in the parameter's range its own `check` says.
pub fn value(info: &ParameterInfo, text: &str) -> Result<Value, Failure> {
    let parsed = match info.kind {
        ValueKind::Bool => text.parse().ok().map(Value::Bool),
        ValueKind::Unsigned if info.is_can_id() => {
            text.parse().ok().map(|id: CanId| Value::Unsigned(id.to_wire()))
        }
        ValueKind::Unsigned => named(info, text).or_else(|| unsigned(text)).map(Value::Unsigned),
        ValueKind::Signed => text.parse().ok().map(Value::Signed),
        ValueKind::Float => text.parse().ok().map(Value::Float),
    };
    parsed.ok_or_else(|| {
        let name = host_protocol::parameters::name(info.number).unwrap_or_default();
        Failure::Usage(format!("`{text}` is no value for {name}. It takes {}", allowed(info)))
    })
}

/// A whole number, decimal or with 0x.
pub fn unsigned(text: &str) -> Option<u32> {
    match text.strip_prefix(HEX_PREFIX) {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.replace('_', "").parse().ok(),
    }
}

/// The number of a dialect, as the wire has it.
pub fn dialect_number(dialect: rmd::Dialect) -> u32 {
    (0..).zip(rmd::Dialect::ALL).find(|(_, of)| *of == dialect).map_or(0, |(number, _)| number)
}

/// What a parameter takes, for people.
pub fn allowed(info: &ParameterInfo) -> String {
    if info.is_can_id() {
        return CanId::ALLOWED.to_owned();
    }
    if let Some(names) = names(info) {
        return names.map(|(name, _)| name).collect::<Vec<_>>().join(", ");
    }
    match info.kind {
        ValueKind::Bool => "true or false".to_owned(),
        // The only signed parameter is a direction: one of two values.
        ValueKind::Signed => format!("{} or {}", info.min, info.max),
        ValueKind::Unsigned | ValueKind::Float => {
            let unit = host_protocol::parameters::unit(info.number).unwrap_or_default();
            format!("{} to {} {unit}", info.min, info.max).trim_end().to_owned()
        }
    }
}

/// Whether its values may be words.
pub fn takes_words(info: &ParameterInfo) -> bool {
    info.is_can_id() || names(info).is_some()
}

/// A value for people: a name where the number has one.
pub fn shown(info: &ParameterInfo, value: Value) -> String {
    let name = match value {
        Value::Unsigned(number) if info.is_can_id() => {
            CanId::from_wire(number).map(|id| id.to_string())
        }
        Value::Unsigned(number) => names(info)
            .and_then(|mut names| names.find(|(_, of)| *of == number))
            .map(|(name, _)| name.to_owned()),
        _ => None,
    };
    name.unwrap_or_else(|| value.to_string())
}

/// A value for programs: a name where the number has one.
pub fn to_json(info: &ParameterInfo, value: Value) -> serde_json::Value {
    let shown = shown(info, value);
    match value {
        _ if shown != value.to_string() => shown.into(),
        Value::Bool(value) => value.into(),
        Value::Unsigned(value) => value.into(),
        Value::Signed(value) => value.into(),
        Value::Float(value) => crate::output::number(value),
    }
}

fn named(info: &ParameterInfo, text: &str) -> Option<u32> {
    names(info)?.find(|(name, _)| *name == text).map(|(_, number)| number)
}

/// The names of a parameter's numbers, where they have some.
fn names(info: &ParameterInfo) -> Option<Box<dyn Iterator<Item = (&'static str, u32)>>> {
    if info.number == AxisParameter::Protocol.number() {
        Some(Box::new(Protocol::ALL.iter().map(|protocol| (protocol.name(), u32::from(*protocol)))))
    } else if info.number == AxisParameter::StopAction.number() {
        Some(Box::new(StopAction::ALL.iter().map(|action| (action.name(), u32::from(*action)))))
    } else if info.number == AxisParameter::RmdDialect.number() {
        Some(Box::new(rmd::Dialect::ALL.iter().map(|dialect| dialect.name()).zip(0..)))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str, text: &str) -> Result<Value, Failure> {
        value(axis_parameter(name)?.info(), text)
    }

    #[test]
    fn each_kind_of_value_is_read() {
        assert_eq!(read("stop_action", "hold").unwrap(), Value::Unsigned(2));
        assert_eq!(read("protocol", "3").unwrap(), Value::Unsigned(3));
        assert_eq!(read("rmd_dialect", "unknown").unwrap(), Value::Unsigned(0));
        assert_eq!(read("rmd_dialect", "v4_4").unwrap(), Value::Unsigned(6));
        assert_eq!(read("node", "0x0B").unwrap(), Value::Unsigned(11));
        assert_eq!(read("ttl_us", "60_000_000").unwrap(), Value::Unsigned(60_000_000));
        assert_eq!(read("direction", "-1").unwrap(), Value::Signed(-1));
        assert_eq!(read("velocity_limit_rad_s", "20.5").unwrap(), Value::Float(20.5));
        assert_eq!(read("allow_unknown_motor_timeout", "true").unwrap(), Value::Bool(true));
    }

    #[test]
    fn what_cannot_be_read_is_named_with_what_is_allowed() {
        let text = read("stop_action", "halt").unwrap_err().to_string();
        assert_eq!(text, "`halt` is no value for stop_action. It takes coast, hold, brake");
        let text = read("ttl_us", "-5").unwrap_err().to_string();
        assert_eq!(text, "`-5` is no value for ttl_us. It takes 5000 to 60000000 µs");
        let text = read("speed", "1").unwrap_err().to_string();
        assert!(text.contains("no parameter `speed`. There are: bus, protocol, node"), "{text}");
        for id in ["0x800", "extended:0x20000000", "extended"] {
            let text = read("d5_request_id", id).unwrap_err().to_string();
            let takes = "It takes 0 to 0x7FF, or extended:0 to extended:0x1FFFFFFF";
            assert_eq!(text, format!("`{id}` is no value for d5_request_id. {takes}"));
        }
        assert!(split("node").is_err() && split("=1").is_err() && split("node=").is_err());
    }

    #[test]
    fn an_id_of_29_bits_is_another_than_that_of_11_with_its_number() {
        for (name, text, value) in [
            ("d5_request_id", "0x010", 0x10),
            ("d5_request_id", "extended:0x00000010", 0x8000_0010),
            ("d5_reply_id", "extended:0x1FFFFFFF", 0x9FFF_FFFF),
        ] {
            let value = Value::Unsigned(value);
            assert_eq!(read(name, text).unwrap(), value);
            assert_eq!(shown(axis_parameter(name).unwrap().info(), value), text);
        }
        assert_eq!(read("d5_request_id", "16").unwrap(), Value::Unsigned(16));
    }

    #[test]
    fn numbers_with_names_are_shown_by_them() {
        assert_eq!(shown(AxisParameter::Protocol.info(), Value::Unsigned(2)), "thruster");
        assert_eq!(shown(AxisParameter::Protocol.info(), Value::Unsigned(9)), "9");
        assert_eq!(shown(AxisParameter::Node.info(), Value::Unsigned(2)), "2");
    }
}
