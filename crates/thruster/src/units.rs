//! The manual's own raw units: one count of the wire each, nothing scaled.

codec::units! {
    /// Control signal, 1 % per count, −100..=100; the sign gives the direction (Thruster manual
    /// §2.1).
    Percent(i16): "%" / 1.0;
    /// Signed speed, 1 rpm per count (Thruster manual §2.1).
    Rpm(i16): "rpm" / 1.0;
    /// Unsigned speed of a position move, 1 rpm per count; 0 does not start the move (Thruster
    /// manual §4.1).
    RpmLimit(u16): "rpm" / 1.0;
    /// Current, 0.1 A per count (Thruster manual §2.1).
    Deciamps(i16): "A" / 10.0;
    /// Voltage, 0.1 V per count (Thruster manual §2.1).
    Decivolts(u16): "V" / 10.0;
    /// Temperature, 1 °C per count (Thruster manual §2.1).
    Celsius(i16): "degC" / 1.0;
    /// Position, 0.1° per count (Thruster manual §4.1).
    Decidegrees(i32): "deg" / 10.0;
    /// Limit of the absolute position, 0.1° per count (Thruster manual §4.1, SPLA and RPLA).
    LimitDecidegrees(i16): "deg" / 10.0;
    /// Bitrate as CB carries it: kbit/s without its fraction (Thruster manual §2.2); see
    /// [`BITRATES`](crate::BITRATES).
    Kilobits(u16): "kbit/s";
    /// Time, 1 ms per count (Thruster manual §2.3, §2.5).
    Milliseconds(u16): "ms";
}
