//! The board's supply.

use std::time::Duration;

use super::Machine;
use crate::nodes::instant;

impl Machine {
    /// Cuts the board's supply for a while, and gives it back: the part starts as from power-on,
    /// its RAM holds anything, and what hangs on its ports never noticed.
    pub fn power_cycle(&mut self, off: Duration) {
        self.power_off();
        self.run_for(off);
        self.power_on();
    }

    /// Cuts the board's supply.
    pub fn power_off(&mut self) {
        let at = instant(self.now());
        self.part_mut().supply(at, false);
    }

    /// Gives the supply back that [`Machine::power_off`] has cut.
    pub fn power_on(&mut self) {
        self.core.order(|_, host, _, recorder| recorder.power_up(host));
        let at = instant(self.now());
        self.part_mut().supply(at, true);
    }
}
