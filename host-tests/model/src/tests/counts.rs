//! Counters that are not what was on the bus, and a bus that goes off and trips nothing.

use super::*;

const BUS_STATUS: u16 = 0x12;
/// Places among the counters.
const SENT: usize = 0;
const RECEIVED: usize = 1;
const OVERFLOWS: usize = 5;
const MISSED: usize = 6;
const CANCELLED: usize = 7;
const BUS_OFFS: usize = 8;

impl Trace {
    /// The bus reports that it is active, and these counts, after all that has happened.
    fn counts(&mut self, counts: &[(usize, u8)]) {
        let mut counters = [0; 9];
        counts.iter().for_each(|(place, count)| counters[*place] = *count);
        let sequence = self.ask(2, BUS_STATUS, &[0]);
        self.answer(
            2,
            sequence,
            2,
            BUS_STATUS,
            &[&[0, 1, 0, 0], counters.as_slice(), &[0]].concat(),
        );
    }
}

/// Two frames, of which one is answered, one that is given back, and one that was lost on its way
/// in.
fn busy() -> Trace {
    let mut trace = Trace::new(HOLD);
    trace.exchange(READ_SPEED, STILL);
    trace.send(READ_FAULTS);
    trace.hand(READ_SPEED);
    trace.oracle.asked_back(trace.now, 0, 0);
    trace.oracle.withdrawn(trace.now, 0, 0);
    trace.oracle.overflow(0, 1);
    trace
}

const RIGHT: [(usize, u8); 4] = [(SENT, 2), (RECEIVED, 1), (OVERFLOWS, 1), (CANCELLED, 1)];

#[test]
pub fn each_counter_that_is_wrong() {
    let mut trace = busy();
    trace.counts(&RIGHT);
    trace.breaks_nothing();
    for wrong in 0..RIGHT.len() {
        let mut counts = RIGHT;
        counts[wrong].1 += 1;
        let mut trace = busy();
        trace.counts(&counts);
        trace.breaks(Check::CountWrong);
    }
    for more in [MISSED, BUS_OFFS] {
        let mut trace = busy();
        trace.counts(&[&RIGHT[..], &[(more, 2)]].concat());
        trace.breaks(Check::CountWrong);
    }
}

#[test]
fn a_frame_that_nobody_acknowledges_is_counted() {
    let told = |wait, missed| {
        let mut trace = Trace::new(HOLD);
        trace.hand(READ_SPEED);
        trace.now += wait;
        trace.counts(&[(MISSED, missed)]);
        trace
    };
    // 20 ms and four frames, 10 µs before the question arrives.
    told(20_529, 0).breaks_nothing();
    told(20_529, 1).breaks(Check::CountWrong);
    told(20_530, 1).breaks_nothing();
    told(20_530, 0).breaks(Check::CountWrong);
}

#[test]
fn a_bus_that_was_off_says_so() {
    let mut trace = Trace::new(HOLD);
    trace.oracle.bus_state(trace.now, 0, true);
    trace.settle();
    trace.counts(&[(BUS_OFFS, 1)]);
    trace.breaks(Check::CountWrong);
    let mut trace = Trace::new(HOLD);
    trace.oracle.bus_state(trace.now, 0, true);
    trace.oracle.bus_state(trace.now, 0, false);
    trace.counts(&[(BUS_OFFS, 1)]);
    trace.breaks_nothing();
    trace.counts(&[(BUS_OFFS, 0)]);
    trace.breaks(Check::CountWrong);
}

#[test]
pub fn a_bus_that_goes_off_and_trips_nothing() {
    let mut trace = Trace::active();
    trace.oracle.bus_state(trace.now, 0, true);
    trace.settle();
    trace.breaks(Check::BusOffIgnored);
}

#[test]
fn a_raw_frame_that_a_bus_off_should_have_purged() {
    let mut trace = Trace::new(HOLD);
    trace.done(0, 0x50, &[0, 0]);
    trace.done(0, 0x51, &[[0, 0, 0x80, 0x0E, 2].as_slice(), &[1, 2]].concat());
    trace.oracle.bus_state(trace.now, 0, true);
    trace.oracle.bus_state(trace.now, 0, false);
    trace.oracle.handed(trace.now, 0, 0, Frame::Can(0x700, &[1, 2]));
    trace.breaks(Check::RawUnopened);
}
