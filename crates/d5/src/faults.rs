//! The fault byte of register 0x12.

/// One bit of the fault byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FaultInfo {
    /// The bit.
    pub fault: Faults,
    /// Its name in snake_case.
    pub name: &'static str,
    /// Whether a 1 to register 0x19 clears it (D5 manual, register 0x19). How the others end is
    /// not given.
    pub is_clearable: bool,
}

const fn info(fault: Faults, name: &'static str, is_clearable: bool) -> FaultInfo {
    FaultInfo { fault, name, is_clearable }
}

codec::flags! {
    /// Faults, several at once (D5 manual, error states at address 0x12).
    ///
    /// Bits without a name stay as received.
    struct Faults: u8;

    /// Every bit the manual lists, the lowest first (D5 manual, error states at address 0x12).
    FAULTS of FaultInfo by info;

    /// Circuit board too hot.
    BOARD_HOT = 0x01, false;
    /// Over-current; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
    OVER_CURRENT = 0x02, true;
    /// Over-voltage.
    OVER_VOLTAGE = 0x04, false;
    /// Under-voltage.
    UNDER_VOLTAGE = 0x08, false;
    /// Stall; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
    STALL = 0x40, true;
    /// Motor too hot.
    MOTOR_HOT = 0x80, false;
}

impl Faults {
    /// What a 1 to register 0x19 clears (D5 manual, register 0x19).
    pub const CLEARABLE: Faults = Faults::STALL.union(Faults::OVER_CURRENT);
}
