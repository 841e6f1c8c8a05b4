//! The flash interface of the STM32G474, for a firmware that does not program its flash: options
//! and wait states keep what they hold, and no write reaches the flash. A test may, as a debug
//! probe does.

use rigless::device::Device;
use rigless::soc::RegisterSpec;

use super::tables;
use crate::row::Row;

/// The instance's name.
pub const NAME: &str = "FLASH";

/// The interface.
#[derive(Debug)]
pub struct Flash {
    table: &'static [RegisterSpec],
}

impl Default for Flash {
    fn default() -> Self {
        Self { table: tables::named(NAME).registers }
    }
}

impl Device for Flash {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.table
    }
}
