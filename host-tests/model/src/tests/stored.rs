//! What is stored, and what counts after a loss of power.

use super::*;

impl Trace {
    fn loses_power(&mut self) {
        self.now += 1_000;
        self.oracle.power_lost(self.now);
    }
}

#[test]
fn a_configuration_that_is_stored_and_loaded_and_stopped_first() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.stores(trace.now, true);
    trace.oracle.stored(trace.now + 500, true);
    trace.loses_power();
    trace.exchange(STOP, STOP);
    trace.status(1, 0);
    trace.listed(&[5]);
    trace.breaks_nothing();
}

#[test]
fn a_stored_axis_that_is_not_stopped_after_a_loss_of_power() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.stores(trace.now, true);
    trace.oracle.stored(trace.now + 500, true);
    trace.loses_power();
    trace.status(1, 0);
    trace.listed(&[5]);
    trace.wait(50_000);
    trace.breaks(Check::StopLate);
}

#[test]
fn a_stored_axis_that_is_gone_or_armed_after_a_loss_of_power() {
    for state in [0, 3] {
        let mut trace = Trace::new(HOLD);
        trace.oracle.stores(trace.now, true);
        trace.oracle.stored(trace.now + 500, true);
        trace.loses_power();
        trace.exchange(STOP, STOP);
        trace.listed(&[state]);
        trace.breaks(Check::ResetForgot);
    }
}

#[test]
fn a_storage_that_fails_and_is_written_all_the_same() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.stores(trace.now, true);
    trace.oracle.stored(trace.now + 500, false);
    trace.loses_power();
    trace.listed(&[1]);
    trace.breaks(Check::PowerLossKept);
}

#[test]
pub fn a_configuration_that_is_stored_while_an_axis_is_armed() {
    let mut trace = Trace::armed();
    trace.oracle.stores(trace.now, true);
    trace.breaks(Check::StoredInMotion);
}

#[test]
fn an_axis_that_is_armed_before_its_configuration_is_stored() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.stores(trace.now, true);
    trace.arm(0);
    trace.oracle.stored(trace.now, true);
    trace.breaks(Check::StoredInMotion);
}
