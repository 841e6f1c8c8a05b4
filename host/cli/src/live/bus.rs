//! A bus of a live view.

use std::time::Duration;

use host_protocol::replies::BusReport;
use host_protocol::{BusKind, Protocol};

/// The longest frames on a bus, bits: of CAN with intermission (docs of `bus/frame_bits.rs` in the
/// core), with extended ids as D5 motors may have; on RS485 ten bits for each byte, RMD frames have
/// 13 and D5 frames 8.
const CAN_BITS: f64 = 135.0;
const EXTENDED_CAN_BITS: f64 = 160.0;
const RMD_SERIAL_BITS: f64 = 130.0;
const D5_SERIAL_BITS: f64 = 80.0;

/// A bus, how it is, and what passed on it of late.
#[derive(Debug, Clone)]
pub struct Bus {
    /// Its number.
    pub number: u8,
    /// What carries it.
    pub kind: BusKind,
    /// Its name.
    pub name: Option<String>,
    /// How it is, once it has been asked.
    pub report: Option<BusReport>,
    asked: Duration,
    /// Frames in a second that the gateway sent and received of late.
    rates: Option<(f64, f64)>,
}

impl Bus {
    /// One that has not been asked yet.
    pub fn new(number: u8, kind: BusKind) -> Self {
        Self { number, kind, name: None, report: None, asked: Duration::ZERO, rates: None }
    }

    /// Takes how it is now.
    pub fn take(&mut self, report: BusReport, now: Duration) {
        let span = now.saturating_sub(self.asked).as_secs_f64();
        self.rates = self.report.filter(|_| span > 0.0).and_then(|before| {
            let (then, counts) = (before.counters, report.counters);
            // A bus that is configured anew counts from 0.
            let sent = counts.transmitted.checked_sub(then.transmitted)?;
            let received = counts.received.checked_sub(then.received)?;
            Some((f64::from(sent) / span, f64::from(received) / span))
        });
        self.asked = now;
        self.report = Some(report);
    }

    /// Frames in a second: sent, received.
    pub fn rates(&self) -> Option<(f64, f64)> {
        self.rates
    }

    /// Of the time of the bus, what these frames take at most: each counts as the longest. Frames
    /// that the gateway does not take, as those for others, are not in it.
    pub fn load_at_most(&self) -> Option<f64> {
        let ((sent, received), config) = (self.rates?, self.report?.config?);
        let has_d5 = config.protocols.contains(Protocol::D5);
        let bits = match (self.kind, has_d5) {
            (BusKind::Can, false) => CAN_BITS,
            (BusKind::Can, true) => EXTENDED_CAN_BITS,
            (BusKind::Rs485, false) => RMD_SERIAL_BITS,
            (BusKind::Rs485, true) => D5_SERIAL_BITS,
        };
        (config.bitrate > 0).then(|| (sent + received) * bits / f64::from(config.bitrate))
    }
}
