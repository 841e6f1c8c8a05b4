//! What RMD motors of newer dialects do otherwise (docs/rmd-dialects.md).

use super::super::dynamics::Drive;
use super::super::model::Context;
use super::Rmd;
use rmd::{DegreesPerSecondSquared, Dialect, Function, ModelPart, MotionRanges, Reply, Request};

/// Three parts of a name.
const MODEL: [[u8; 5]; 3] = [*b"RMD-X", *b"4-P36", *b"-36\0\0"];
/// What motion mode of a V4.4 motor ends at, N·m and N·m·s/rad.
const MOST_NM: f64 = 60.0;
const MOST_KD: f64 = 50.0;

impl Rmd {
    /// A request as a motor of its dialect takes it. What has an id of its own has no dialect.
    pub(super) fn in_dialect(&self, cx: &Context<'_>, request: Request, data: &[u8]) -> Request {
        let dialect = self.dialect(cx);
        let is_own = matches!(
            request,
            Request::MotionMode { .. } | Request::ReadCanId | Request::SetCanId { .. }
        );
        match data.try_into() {
            Ok(data) if dialect != Dialect::V3_6 && !is_own => {
                match Request::decode_in(dialect, data) {
                    // The index of a read that it does not know of it passes over.
                    Request::Unknown { .. }
                        if request.only_reads() && request.dialects().contains(dialect) =>
                    {
                        request
                    }
                    known => known,
                }
            }
            _ => request,
        }
    }

    /// The ranges of its motion mode.
    pub(super) fn ranges(&self, cx: &Context<'_>) -> MotionRanges {
        match self.dialect(cx) {
            Dialect::V4_4 => MotionRanges::v4_4(MOST_NM, MOST_KD),
            _ => MotionRanges::DEFAULT,
        }
    }

    /// Whether it echoes a request and does not store it.
    pub(super) fn only_echoes(&self, cx: &Context<'_>, request: &Request) -> bool {
        let is_on = self.wanted != Drive::Off;
        cx.injected.stores_only_off && is_on && request.is_stored_only_off(Dialect::V4_4)
    }

    /// What it answers to a request that older dialects lack.
    pub(super) fn reply_to_newer(&mut self, request: &Request) -> Option<Reply> {
        let motion = self.motion();
        Some(match *request {
            Request::CappedVelocity { .. } => Reply::Velocity { motion },
            Request::CappedPosition { .. } => Reply::CappedPosition { motion },
            Request::ReadGain { gain } => Reply::Gain { gain: self.memory.fine_gain(gain) },
            Request::WriteGainRam { gain } => {
                self.memory.set_fine_gain(gain, false);
                Reply::GainRamWritten { gain }
            }
            Request::WriteGainRom { gain } => {
                self.memory.set_fine_gain(gain, true);
                Reply::GainRomWritten { gain }
            }
            Request::ReadRamp { ramp } => {
                Reply::Ramp { ramp, acceleration: DegreesPerSecondSquared(self.memory.ramp(ramp)) }
            }
            Request::ReadModelPart { part } => {
                let text = MODEL.get(usize::from(part).checked_sub(1)?)?;
                Reply::ModelPart { part, text: ModelPart(*text) }
            }
            Request::Function { function: function @ Function::NextCanId { id } } => {
                self.next_node = Some(id.get());
                Reply::Function { function }
            }
            _ => return None,
        })
    }
}
