//! The manual's raw units, one type each: what a word on the wire counts.

codec::units! {
    /// Torque current, 0.01 A per count (RMD V3.6 §2.13.3, §2.17.1).
    Centiamps(i16): "A" / 100.0;
    /// Commanded output-shaft speed, 0.01 degree per second per count (RMD V3.6 §2.18.1).
    CentidegreesPerSecond(i32): "dps" / 100.0;
    /// Measured output-shaft speed, 1 degree per second per count (RMD V3.6 §2.13.3).
    DegreesPerSecond(i16): "dps" / 1.0;
    /// Highest output-shaft speed of a position move, 1 degree per second per count (RMD V3.6
    /// §2.20.1).
    ///
    /// The manual does not say what 0 means; newer ones say "unlimited", so whoever commands motion
    /// must not send it.
    SpeedLimit(u16): "dps" / 1.0;
    /// Multi-turn output-shaft angle from the zero point, 0.01 degree per count (RMD V3.6 §2.11.3,
    /// §2.20.1).
    Centidegrees(i32): "deg" / 100.0;
    /// Output-shaft angle in motion replies, 1 degree per count, ±32767 (RMD V3.6 §2.13.3).
    ///
    /// The range ends after 91 turns: a position is read with 0x92 instead.
    Degrees(i16): "deg" / 1.0;
    /// Motor temperature, 1 °C per count (RMD V3.6 §2.12.3).
    Celsius(i8): "degC" / 1.0;
    /// Supply voltage, 0.1 V per count (RMD V3.6 §2.12.3).
    Decivolts(u16): "V" / 10.0;
    /// Time, 1 ms per count (RMD V3.6 §2.30.1).
    Milliseconds(u32): "ms";
    /// Highest output-shaft speed of a tracking move, 0.01 degree per second per count, on the wire
    /// half the width of [`CentidegreesPerSecond`] (RMD V3.6 §2.21.1).
    FineSpeedLimit(u16): "dps" / 100.0;
    /// Acceleration or deceleration of the output shaft, 1 degree per second squared per count (RMD
    /// V3.6 §2.4.3).
    DegreesPerSecondSquared(u32): "dps/s" / 1.0;
    /// Position of the multi-turn encoder, in its pulses (RMD V3.6 §2.6.3).
    EncoderPulses(i32): "pulses";
    /// Power, 0.1 W per count (RMD V3.6 §2.24.3).
    Deciwatts(u16): "W" / 10.0;
    /// Date of the motor's firmware as the decimal number year, month, day (RMD V3.6 §2.29.3).
    ///
    /// Motors also send ten digits, so it is not taken apart.
    VersionDate(u32): "";
    /// Single-turn angle, 0.01 degree per count, 0 to 359.99° (V3.7 0x94, 0xA6).
    SingleTurn(u16): "deg" / 100.0;
    /// Counts of the single-turn encoder (V3.7 0x90).
    EncoderCounts(u16): "";
    /// Highest torque that the motor itself allows, 1 % of its rated current per count (V4.3 0xA2,
    /// 0xA9).
    ///
    /// Above its stall current nothing is capped, nor by 0 in 0xA2.
    TorqueCap(u8): "%";
    /// Speed or torque in addition, 1 % of the rated speed or current per count (V4.4 0x72, 0x73).
    FeedForward(i8): "%";
}
