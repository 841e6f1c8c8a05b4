//! The manual's own raw units.

codec::units! {
    /// Speed, 1 °/s per count; positive is counter-clockwise (D5 manual, common commands, rows 2
    /// and 3).
    DegreesPerSecond(i16): "dps" / 1.0;
    /// Angle, 1° per count (D5 manual, common commands, row 5).
    Degrees(i16): "deg" / 1.0;
    /// Angle within one turn, 1° per count, 0..=360 (D5 manual, table row 14).
    TurnDegrees(u16): "deg" / 1.0;
    /// Temperature, 1 °C per count (D5 manual, register 0x0B).
    Celsius(i8): "degC" / 1.0;
}
