//! Properties over arbitrary bytes.

use d5::{
    Celsius, DegreesPerSecond, Payload, Reply, Request, decode_reply_frame, decode_request_frame,
    decode_speed, decode_temperature, encode_speed, encode_temperature, reply_frame, request_frame,
};
use proptest::prelude::*;

/// Five bytes between id and checksum, those of the manual often enough to be met.
fn payload() -> impl Strategy<Value = Payload> {
    let byte = |bytes: Vec<u8>| prop_oneof![proptest::sample::select(bytes), any::<u8>()];
    let address = byte(vec![0x00, 0x01, 0x03, 0x07, 0x10, 0x15, 0x20, 0x26, 0xCC, 0xFF]);
    let data = || byte(vec![0x00, 0xEE, 0xCC, 0xFF]);
    (byte(vec![4, 5]), byte(vec![0, 1, 2, 3, 4, 5, 6, 0xD4]), address, data(), data())
        .prop_map(|(length, command, address, low, high)| Payload([length, command, address, low, high]))
}

/// The frame of these bytes with the right checksum.
fn frame(header: u8, id: u8, Payload([length, command, address, low, high]): Payload) -> [u8; 8] {
    let sum = [id, length, command, address, low, high].into_iter().fold(0, u8::wrapping_add);
    [header, id, length, command, address, low, high, sum]
}

proptest! {
    #[test]
    fn what_decodes_and_encodes_decodes_to_itself(
        id in prop_oneof![Just(0x0B), Just(0xFE), any::<u8>()],
        payload in payload(),
    ) {
        if let Ok((address, request)) = decode_request_frame(&frame(0xD5, id, payload)) {
            prop_assert_eq!(Request::decode(&payload), Ok(request));
            if let Ok(sent) = request_frame(address, &request) {
                prop_assert_eq!(sent, frame(0xD5, id, payload));
            }
        }
        if let Ok((node, reply)) = decode_reply_frame(&frame(0x5D, id, payload)) {
            prop_assert_eq!(Reply::decode(&payload), Ok(reply));
            prop_assert_eq!(reply_frame(node, &reply), Ok(frame(0x5D, id, payload)));
        }
    }

    #[test]
    fn any_bytes_decode_or_name_an_error(bytes in any::<[u8; 8]>()) {
        let [header, ..] = bytes;
        prop_assert!(header == 0xD5 || decode_request_frame(&bytes).is_err());
        prop_assert!(header == 0x5D || decode_reply_frame(&bytes).is_err());
    }

    #[test]
    fn speeds_and_temperatures_survive_the_wire(speed in -32_767_i16..=32_767, temperature in -127_i8..=127) {
        let (speed, temperature) = (DegreesPerSecond(speed), Celsius(temperature));
        prop_assert_eq!(encode_speed(speed).map(decode_speed), Ok(speed));
        prop_assert_eq!(encode_temperature(temperature).map(decode_temperature), Ok(temperature));
    }
}
