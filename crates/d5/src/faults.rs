//! The fault byte of register 0x12.

bitflags::bitflags! {
    /// Faults, several at once (D5 manual, error states at address 0x12).
    ///
    /// Bits without a name stay as received.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
    pub struct Faults: u8 {
        /// Circuit board too hot.
        const BOARD_HOT = 0x01;
        /// Over-current; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
        const OVER_CURRENT = 0x02;
        /// Over-voltage.
        const OVER_VOLTAGE = 0x04;
        /// Under-voltage.
        const UNDER_VOLTAGE = 0x08;
        /// Stall; [`Register::CLEAR_PROTECTION`](crate::Register::CLEAR_PROTECTION) clears it.
        const STALL = 0x40;
        /// Motor too hot.
        const MOTOR_HOT = 0x80;
    }
}

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

/// Every bit the manual lists, the lowest first (D5 manual, error states at address 0x12).
pub const FAULTS: &[FaultInfo] = &[
    info(Faults::BOARD_HOT, "board_hot"),
    info(Faults::OVER_CURRENT, "over_current"),
    info(Faults::OVER_VOLTAGE, "over_voltage"),
    info(Faults::UNDER_VOLTAGE, "under_voltage"),
    info(Faults::STALL, "stall"),
    info(Faults::MOTOR_HOT, "motor_hot"),
];

const fn info(fault: Faults, name: &'static str) -> FaultInfo {
    FaultInfo { fault, name, is_clearable: Faults::CLEARABLE.contains(fault) }
}

impl Faults {
    /// What a 1 to register 0x19 clears (D5 manual, register 0x19).
    pub const CLEARABLE: Faults = Faults::STALL.union(Faults::OVER_CURRENT);

    /// The table's row of every listed bit that is set, the lowest first.
    pub fn infos(self) -> impl Iterator<Item = &'static FaultInfo> {
        FAULTS.iter().filter(move |info| self.contains(info.fault))
    }

    /// Hands on the name of every listed bit in a word, as [`FieldValue`](crate::FieldValue) has
    /// it.
    pub(crate) fn visit_names(word: u32, visit: &mut dyn FnMut(&'static str)) {
        let listed = FAULTS.iter().filter(|info| word & u32::from(info.fault.bits()) != 0);
        listed.for_each(|info| visit(info.name));
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Faults {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "Faults({=u8:#04x})", self.bits());
    }
}
