//! What a native command does to a motor, as far as `mgw` asks the user to say so. The gateway decides by itself.

use host_protocol::Protocol;

/// What a command does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// It stops the motor.
    Stops,
    /// It moves the motor, and may be sent again and again.
    Moves,
    /// It moves the motor anew each time it is sent.
    MovesOnce,
    /// Neither: it asks, it changes the motor, or it is no command at all.
    Other,
}

/// What the data field of a request does.
pub fn of(protocol: Protocol, data: &[u8]) -> Effect {
    match protocol {
        Protocol::Rmd => rmd(data),
        Protocol::Thruster => thruster(data),
        Protocol::D5 => d5(data),
    }
}

fn rmd(data: &[u8]) -> Effect {
    use rmd::Request;
    let Ok(data) = data.try_into() else { return Effect::Other };
    match Request::decode(data) {
        Request::Shutdown | Request::Stop => Effect::Stops,
        Request::TorqueCurrent { .. }
        | Request::Velocity { .. }
        | Request::PositionTracking { .. }
        | Request::AbsolutePosition { .. }
        | Request::LimitedPositionTracking { .. } => Effect::Moves,
        Request::IncrementalPosition { .. } => Effect::MovesOnce,
        _ => Effect::Other,
    }
}

fn thruster(data: &[u8]) -> Effect {
    use thruster::{Percent, Request, Rpm};
    match Request::decode(data) {
        Ok(
            Request::EmergencyStop
            | Request::Signal { signal: Percent(0) }
            | Request::Speed { speed: Rpm(0) },
        ) => Effect::Stops,
        Ok(Request::Signal { .. } | Request::Speed { .. } | Request::AbsolutePosition { .. }) => {
            Effect::Moves
        }
        Ok(Request::RelativePosition { .. }) => Effect::MovesOnce,
        _ => Effect::Other,
    }
}

fn d5(data: &[u8]) -> Effect {
    use d5::{Register, Request, Value, decode_speed};
    let Ok(frame) = data.try_into() else { return Effect::Other };
    match d5::decode_request_frame(frame) {
        Ok((_, Request::Write { register: Register::SPEED, value: Value::Word(word) })) => {
            if decode_speed(word).0 == 0 { Effect::Stops } else { Effect::Moves }
        }
        Ok((_, Request::AsyncWrite { register: Register::SPEED, .. } | Request::Execute)) => {
            Effect::MovesOnce
        }
        _ => Effect::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §2; the first byte is the command.
    #[test]
    fn rmd_commands() {
        let effect = |command: u8| of(Protocol::Rmd, &[command, 0, 0, 0, 0x64, 0, 0, 0]);
        for command in [0x80, 0x81] {
            assert_eq!(effect(command), Effect::Stops, "{command:#x}");
        }
        for command in [0xA1, 0xA2, 0xA3, 0xA4, 0xA5] {
            assert_eq!(effect(command), Effect::Moves, "{command:#x}");
        }
        assert_eq!(effect(0xA8), Effect::MovesOnce);
        for command in [0x92, 0x9A, 0x9C, 0x43, 0x64, 0x76, 0x77, 0xB3, 0xFF] {
            assert_eq!(effect(command), Effect::Other, "{command:#x}");
        }
        assert_eq!(of(Protocol::Rmd, &[0xA1, 0, 0, 0]), Effect::Other);
    }

    /// Thruster manual §2.1, §4.1.
    #[test]
    fn thruster_commands() {
        let effect = |data: &[u8]| of(Protocol::Thruster, data);
        assert_eq!(effect(b"TC\0\0\0\0\xFF\xFB"), Effect::Moves);
        assert_eq!(effect(b"TC\0\0\0\0\0\0"), Effect::Stops);
        assert_eq!(effect(b"VC\0\0\0\0\x01\x2C"), Effect::Moves);
        assert_eq!(effect(b"VC\0\0\0\0\0\0"), Effect::Stops);
        assert_eq!(effect(b"LA\x01\x2C\xFF\xFF\xF8\xF9"), Effect::Moves);
        assert_eq!(effect(b"LR\x01\x2C\xFF\xFF\xF8\xF9"), Effect::MovesOnce);
        assert_eq!(effect(b"QV\0\0"), Effect::Other);
        assert_eq!(effect(b"XX\0\0"), Effect::Other);
    }

    /// D5 manual, common rows 2 and 3, rows 11 and 13; checksums are sums of the bytes after the first.
    #[test]
    fn d5_commands() {
        let effect = |data: [u8; 8]| of(Protocol::D5, &data);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D]), Effect::Moves);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x03, 0x20, 0x00, 0x00, 0x33]), Effect::Stops);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x04, 0x20, 0x58, 0x02, 0x8E]), Effect::MovesOnce);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x05, 0x00, 0x00, 0x00, 0x15]), Effect::MovesOnce);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x02, 0x26, 0x00, 0x00, 0x38]), Effect::Other);
        assert_eq!(effect([0xD5, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8E]), Effect::Other, "checksum");
    }
}
