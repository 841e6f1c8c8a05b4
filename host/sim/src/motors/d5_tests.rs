
/// The same eight bytes on a line: a pause ends a frame begun, a spoilt sum is complained of (table
/// row 3), and frames to others, replies among them, are not answered.
#[test]
fn on_a_serial_line_it_speaks_in_the_same_frames() {
    let mut motor = TestMotor::new(Protocol::D5, 0x0B, true);
    assert_eq!(motor.ask_serial(&SPEED_600), ["5D0B05032058028D"]);
    assert_eq!(motor.ask_serial(&SPEED_0[..5]), [""; 0]);
    assert_eq!(motor.ask_serial(&SPEED_0), ["5D0B050320000033"]);
    let mut spoilt = SPEED_600;
    spoilt[7] ^= 1;
    assert_eq!(motor.ask_serial(&spoilt), ["5D0B050307EEEEF6"]);
    assert_eq!(motor.ask_serial(&[0xD5, 0x0C, 0x05, 0x01, 0, 0, 0, 0x12]), [""; 0]);
    assert_eq!(motor.ask_serial(&[0x5D, 0x0B, 0x05, 0x03, 0x20, 0x58, 0x02, 0x8D]), [""; 0]);
    assert_eq!(motor.ask_serial(&[0xD5, 0xFE, 0x05, 0x01, 0, 0, 0, 0x04]), ["5D0B0501CCCCCC75"]);
    // One that reads leniently looks neither at the sum nor at pauses.
    motor.inject(Injection::Lenient(true));
    motor.ask_serial(&spoilt[..5]);
    assert_eq!(motor.ask_serial(&spoilt[5..]), ["5D0B05032058028D"]);
}
