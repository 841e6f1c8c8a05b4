//! The reply to a native command, in the words of a capture.

use embedded_can::StandardId;
use host_protocol::{CanFrame, Protocol};

use super::line::Origin;
use super::record::{Raw, Record};
use super::{d5, rmd, thruster};

/// What `mgw decode` prints of a motor's reply to a request, both given as data fields. `frame`
/// holds that of the reply; in JSON the axis stands beside it.
pub fn reply(
    axis: u8,
    protocol: Protocol,
    node: u8,
    request: &[u8],
    reply: &[u8],
    json: bool,
) -> String {
    let mut record = Record::new(Vec::new(), json);
    record.begin("reply", &Origin::default(), Raw::Bytes(reply));
    match protocol {
        Protocol::Rmd => {
            if let Ok(node) = ::rmd::Node::new(node)
                && let Some(request) = frame(::rmd::can::request_id(node), request)
                && let Some(reply) = frame(::rmd::can::reply_id(node), reply)
            {
                // The form of the reply tells its dialect.
                let mut conversation = rmd::Conversation::new(::rmd::Dialect::Unknown);
                // Only what was asked tells whether the reply has carried it out.
                let _ = conversation.can(&request, None);
                rmd::write(conversation.can(&reply, None), &mut record);
            }
        }
        Protocol::Thruster => {
            if let Ok(node) = ::thruster::Node::new(node)
                && let Some(request) = frame(::thruster::can::request_id(node), request)
                && let Some(reply) = frame(::thruster::can::reply_id(node), reply)
            {
                let mut conversation = thruster::Conversation::new(false);
                let _ = conversation.can(&request);
                thruster::write(conversation.can(&reply), &mut record);
            }
        }
        Protocol::D5 => {
            // Its ids say nothing, so any will do.
            if let Some(reply) = frame(StandardId::ZERO, reply) {
                d5::write(d5::can(&reply), &mut record);
            }
        }
    }
    if json {
        record.integer("axis", i64::from(axis));
    }
    record.into_line()
}

fn frame(id: StandardId, data: &[u8]) -> Option<CanFrame> {
    CanFrame::standard(id.as_raw(), data)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RMD V3.6 §2.17.4.
    const CURRENT: [u8; 8] = [0xA1, 0, 0, 0, 0x64, 0, 0, 0];

    #[test]
    fn a_reply_reads_as_in_a_capture() {
        let motion = [0xA1, 0x32, 0x64, 0x00, 0xF4, 0x01, 0x2D, 0x00];
        assert_eq!(
            reply(0, Protocol::Rmd, 1, &CURRENT, &motion, true),
            concat!(
                r#"{"event":"reply","frame":"A1326400F4012D00","direction":"reply","protocol":""#,
                r#"rmd","node":1,"command":"torque_current","#,
                r#""temperature_c":50,"current_a":1,"speed_dps":500,"angle_deg":45,"axis":0}"#
            )
        );
        let text = reply(0, Protocol::Rmd, 1, &CURRENT, &motion, false);
        assert!(text.starts_with("A1326400F4012D00"), "{text}");
        assert!(
            text.ends_with("temperature_c=50 current_a=1 speed_dps=500 angle_deg=45"),
            "{text}"
        );
    }

    #[test]
    fn an_echoed_command_has_not_been_executed() {
        let line = reply(0, Protocol::Rmd, 1, &CURRENT, &CURRENT, true);
        assert!(line.contains(r#""not_executed":true"#), "{line}");
    }
}
