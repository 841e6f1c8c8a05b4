//! What no line of a vector file can say.

use codec_testing::{CanFrame, check_names};
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use thruster::{
    COMMANDS, Decidegrees, EncodeError, FAULTS, FaultAction, FaultInfo, FaultRecovery, Faults,
    Kilobits, Node, Payload, Reply, Request, ReturnFlags, ReturnFrames, ReturnedFrame, Rpm,
    RpmLimit, can,
};

#[test]
fn the_names_of_the_table() {
    check_names(COMMANDS);
}

/// Thruster manual §1.1.
#[test]
fn every_id_is_that_of_a_device_or_refused() {
    for id in 0..0x800 {
        let id = StandardId::new(id).expect("11 bits");
        let frame = CanFrame::new(id, b"EF\0\0").expect("4 bytes");
        let device = |base: u16| {
            let node = u8::try_from(id.as_raw().checked_sub(base)?).ok()?;
            Node::new(node).ok()
        };
        assert_eq!(can::node_of_request_id(id.into()), device(0x300));
        assert_eq!(can::node_of_reply_id(id.into()), device(0x280));
        let decoded = can::decode_request(&frame).ok();
        assert_eq!(decoded, device(0x300).map(|node| (node, Request::ReadFaults)));
    }
    let extended = Id::Extended(ExtendedId::new(0x281).expect("29 bits"));
    assert_eq!((can::node_of_reply_id(extended), can::node_of_request_id(extended)), (None, None));
    for id in [0, 128, 255] {
        let refused =
            EncodeError::OutOfRange { field: "node", value: i64::from(id), min: 1, max: 127 };
        assert_eq!(Node::new(id), Err(refused));
    }
}

/// Thruster manual §1.3: an echo must not look like a refusal, and a query is never refused.
#[test]
fn replies_that_no_device_sends_are_refused() {
    let data = [0, 0, 0xEE, 0xEE];
    let frames = ReturnFrames::from_bits_retain(0xEE);
    for (reply, refused) in [
        (Reply::RelativePosition { speed: RpmLimit(1), position: Decidegrees(61_166) }, "position"),
        (Reply::ParameterSet { parameter: 0x4D01, data }, "data"),
        (Reply::ParameterSet { parameter: 0x4C41, data: [0; 4] }, "parameter"),
        (Reply::Parameter { parameter: 0x4C41, data }, "parameter"),
        (Reply::Speed { speed: Rpm(-4370) }, "speed"),
        (Reply::ReturnConfigured { flags: ReturnFlags::from_bits_retain(0xEE), frames }, "flags"),
        (Reply::Refused { command: 0x5156, parameter: 0 }, "command"),
    ] {
        let error = reply.encode();
        let is_it = matches!(error, Err(EncodeError::Forbidden { field, .. }) if field == refused);
        assert!(is_it, "{reply:?}: {error:?}");
    }
    let with_parameter = Reply::Refused { command: 0x5443, parameter: 1 }.encode();
    let refused = EncodeError::OutOfRange { field: "parameter", value: 1, min: 0, max: 0 };
    assert_eq!(with_parameter, Err(refused));
}

/// Thruster manual §4.1: SPLA has a variant of its own.
#[test]
fn a_raw_parameter_does_not_go_around_the_limits() {
    for request in [
        Request::SetParameter { parameter: 0x4C41, data: [0x7F, 0xFF, 0, 0] },
        Request::ReadParameter { parameter: 0x4C41 },
    ] {
        let refused = request.encode();
        assert!(matches!(
            refused,
            Err(EncodeError::Forbidden { field: "parameter", value: 0x4C41, .. })
        ));
    }
}

/// The command words of requests that only read and that act after a power cycle (Thruster manual
/// §2, §4), of all words.
#[test]
fn what_requests_do() {
    let words = |of: fn(&Request) -> bool| -> Vec<String> {
        let word = |word: u16| {
            let [high, low] = word.to_be_bytes();
            let short = Request::decode(&[high, low, 0, 0]);
            let request = short.or(Request::decode(&[high, low, 0, 0, 0, 0, 0, 0])).ok()?;
            of(&request).then(|| String::from_utf8_lossy(&[high, low]).into_owned())
        };
        (0..=u16::MAX).filter_map(word).collect()
    };
    let reads = ["EF", "EQ", "FR", "QA", "QC", "QP", "QR", "QT", "QV", "RP"];
    assert_eq!(words(Request::only_reads), reads);
    assert_eq!(words(Request::acts_after_power_cycle), ["CB", "CI"]);
}

/// Thruster manual §3, protections: every named bit has one row, in the order of the bits.
#[test]
fn what_devices_do_about_faults() {
    assert!(Faults::all().iter().eq(FAULTS.iter().map(|row| row.fault)));
    let bits = |of: &dyn Fn(&FaultInfo) -> bool| -> u16 {
        FAULTS.iter().filter(|row| of(row)).fold(0, |bits, row| bits | row.fault.bits())
    };
    let off = [FaultAction::OutputOff, FaultAction::BarOutput];
    assert_eq!(bits(&|row| off.contains(&row.action)), 0x0C47);
    assert_eq!(bits(&|row| row.recovery == FaultRecovery::Never), 0x00C7);
    assert_eq!(bits(&|row| row.level == 1), 0x0047);
    assert_eq!(bits(&|row| row.threshold == Some(120)), 0x0300);
    assert_eq!(bits(&|row| row.action == FaultAction::Report), Faults::REPORTED.bits());
    assert_eq!((Faults::REPORTED.bits(), Faults::TEMPERATURE_SENSORS.bits()), (0x3018, 0x3000));
}

/// Thruster manual §2.2, §2.5: rates without their fraction, and the first word of frame 3.
#[test]
fn what_values_stand_for() {
    let rate = |setting| Kilobits(setting).info().map(|info| info.bits_per_second);
    assert_eq!(
        [1000, 83, 66, 33, 10].map(rate),
        [1_000_000, 83_333, 66_666, 33_333, 10_000].map(Some)
    );
    assert_eq!(rate(84), None);
    let position = ReturnedFrame::Position { raw: [0xFC, 0x7C, 0x00, 0x01, 0x51, 0x80] };
    assert_eq!(position.absolute_position(), Some(Decidegrees(-900)));
}

/// Thruster manual §2.4: the command words and headers read as speeds that no device has.
#[test]
fn a_frame_without_a_header_is_read_where_the_reply_is_unknown() {
    let values = |bytes: [u8; 8]| Reply::decode(&bytes).expect("eight bytes").headerless();
    let unknown = [0x03, 0xE8, 0x00, 0xF0, 0x00, 0x0A, 0x00, 0x10];
    assert_eq!(values(unknown).map(|values| values.encode()), Some(Payload::Full(unknown)));
    assert_eq!(values([0x51, 0x56, 0, 0, 0, 0, 0, 0x10]), None);
}
