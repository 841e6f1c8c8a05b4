//! How the buses are, and what their counters did while they were looked at.

use std::time::Duration;

use host_protocol::replies::BusReport;
use host_protocol::{BusCounters, BusKind, BusState, Protocol};

use super::{Findings, Grade, Wrong};
use crate::explain::Page;
use crate::failure::Failure;
use crate::session::Session;

/// Bits of a frame with eight data bytes, stuffed as usual, and of a serial byte with its share of
/// a pause.
const CAN_FRAME_BITS: f64 = 125.0;
const SERIAL_FRAME_BITS: f64 = 130.0;
/// A notice of a motor that meets a request spoils at most so many bytes: those of one frame. A
/// motor whose own timeout has struck sends one each second (docs/rmd-dialects.md).
const NOTICE_BYTES: u64 = rmd::rs485::FRAME_LEN as u64;
/// A bus with more than this part of its time taken delays setpoints.
const BUSY: f64 = 0.7;

/// Every bus of the board.
pub fn reports(session: &mut Session) -> Result<Vec<(u8, BusKind, BusReport)>, Failure> {
    let kinds: Vec<BusKind> = session.client.hello().buses.iter().map(|bus| bus.kind).collect();
    let mut reports = Vec::new();
    for (bus, kind) in (0u8..).zip(kinds) {
        reports.push((bus, kind, session.client.bus_status(bus)?));
    }
    Ok(reports)
}

/// What the reports before and after say.
pub fn judge(
    before: &[(u8, BusKind, BusReport)],
    after: &[(u8, BusKind, BusReport)],
    span: Duration,
    findings: &mut Findings,
) {
    if after.iter().all(|(_, _, report)| report.config.is_none()) {
        let text = "none is configured: `mgw scan` and `mgw adopt`";
        findings.wrong("buses", Page::NotConfigured, text);
    }
    for ((bus, kind, before), (_, _, after)) in before.iter().zip(after) {
        let Some(config) = after.config else { continue };
        let of = format!("bus {bus}");
        let grown =
            |of: fn(&BusCounters) -> u32| of(&after.counters).saturating_sub(of(&before.counters));
        let frames = grown(|count| count.transmitted).saturating_add(grown(|count| count.received));
        let bits = match kind {
            BusKind::Can => CAN_FRAME_BITS,
            BusKind::Rs485 => SERIAL_FRAME_BITS,
        };
        let load = f64::from(frames) * bits
            / (f64::from(config.bitrate.max(1)) * span.as_secs_f64().max(0.001));
        let rejected = grown(|count| count.rejected);
        let may_be_notices = *kind == BusKind::Rs485
            && config.protocols.contains(Protocol::Rmd)
            && u64::from(rejected) <= NOTICE_BYTES * (span.as_secs() + 1);
        findings.judge(
            &of,
            wrong(after, grown, load, may_be_notices),
            format!(
                "{} bit/s, {frames} frames in {:.1} s, load {:.0} %",
                config.bitrate,
                span.as_secs_f64(),
                load * 100.0
            ),
        );
        if rejected > 0 && may_be_notices {
            let text = format!(
                "{rejected} bytes were no frames, no more than when a motor whose own timeout has \
                    struck says so into a request: look again"
            );
            findings.add(&of, Grade::Note, text);
        }
        let counters = after.counters;
        let old = [
            (counters.missed_acknowledgements, "frames without acknowledgement"),
            (counters.bus_offs, "times bus-off"),
            (counters.receive_overflows, "frames lost for want of time"),
        ];
        let old: Vec<String> = old
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        if !old.is_empty() {
            let text = format!("since it was started: {}", old.join(", "));
            findings.add(&of, Grade::Note, text);
        }
    }
}

fn wrong(
    after: &BusReport,
    grown: impl Fn(fn(&BusCounters) -> u32) -> u32,
    load: f64,
    may_be_notices: bool,
) -> Vec<Wrong> {
    let mut wrong = Vec::new();
    let mut add = |page: Page, text: String| wrong.push((page, text));
    if after.state == BusState::BusOff {
        add(Page::BusOff, "bus-off: look for a short of the two wires, and at the bitrate".into());
    } else if grown(|count| count.missed_acknowledgements) > 0 {
        let text = "nobody acknowledges: look at the power of the motors, the cable, the termination \
                (120 Ω at both ends), and the bitrate";
        add(Page::NotAcknowledged, text.into());
    } else if matches!(after.state, BusState::Warning | BusState::Passive) {
        let text = format!(
            "error counters are high (TEC {}, REC {}): a wrong bitrate, the termination, or a bad \
                cable",
            after.transmit_errors, after.receive_errors
        );
        add(Page::BusErrors, text);
    }
    let rejected = grown(|count| count.rejected);
    if rejected > 0 && !may_be_notices {
        let text = format!(
            "{rejected} bytes were no frames: noise, the bias of the line, another baud rate, or \
                two motors with one id"
        );
        add(Page::BusErrors, text);
    }
    if grown(|count| count.receive_overflows) > 0 {
        add(Page::BusErrors, "frames are lost: somebody floods the bus".into());
    }
    if load > BUSY {
        let text = format!(
            "load {:.0} %: poll less often (state_poll_us, refresh_us), or move axes to another bus",
            load * 100.0
        );
        add(Page::BusOverloaded, text);
    }
    wrong
}
