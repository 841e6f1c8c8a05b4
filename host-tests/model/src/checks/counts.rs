//! What a bus is said to have carried (G7). Frames that are for nobody or come late are the
//! gateway's view of them, and not looked at.

use crate::oracle::Oracle;
use crate::violation::Check;

impl Oracle {
    /// The gateway reports a bus.
    pub(super) fn counted(&mut self, now: u64, bus: u8, off: bool, counters: [u32; 9]) {
        let Some(state) = self.buses.get(usize::from(bus)) else { return };
        let [sent, received, _unmatched, _late, _rejected, overflows, missed, cancelled, bus_offs] =
            counters;
        let tally = state.tally;
        let is_right = [
            (sent.clamp(tally.sent - tally.sent_or_not, tally.sent), sent),
            // After a collision on a serial line, which bytes are a frame of a motor is the
            // gateway's view too.
            (if state.is_can() { received } else { tally.received }, tally.received),
            (overflows, tally.overflows),
            (cancelled, tally.cancelled),
            (bus_offs, tally.bus_offs),
        ];
        // Allowance: what takes the place of a frame that was given back may be counted before its
        // own time is up, and whose time it had is not followed over a restart of the
        // controller.
        let least = tally.missed.saturating_sub(tally.cancelled);
        let most = tally.missed + tally.missed_or_not + tally.cancelled;
        let missed_fits = (least..=most).contains(&missed);
        if is_right.iter().any(|(told, counted)| told != counted)
            || !missed_fits
            || off != state.off_since.is_some()
        {
            let seen = format!("bus {bus}: off {off}, {counters:?}, not {tally:?}");
            self.broken(Check::CountWrong, now, seen);
        }
    }
}
