//! What must not be accepted as a configuration (G2, G7).

use crate::axis::Axis;
use crate::motor::Protocol;
use crate::oracle::Oracle;
use crate::violation::Check;

/// Group id of RMD requests, and of their ids.
const RMD_GROUPS: [u32; 2] = [0x280, 0x300];

impl Oracle {
    /// An axis was configured or removed: where its ids have 29 bits its frames are longer.
    pub(super) fn note_extended(&mut self) {
        for (index, bus) in self.buses.iter_mut().enumerate() {
            bus.has_extended =
                self.axes.iter().any(|axis| axis.bus() == Some(index) && axis.has_extended_ids());
        }
    }

    /// An axis was configured.
    pub(super) fn judge_configuration(&mut self, now: u64, index: usize) {
        let axis = &self.axes[index];
        if !axis.is_complete() {
            return;
        }
        let blind = axis
            .unmeasurable_limit()
            .map(|parameter| format!("axis {index}, {:?}: parameter {parameter}", axis.protocol()));
        let is_can =
            axis.bus().and_then(|bus| self.buses.get(bus)).is_some_and(crate::bus::Bus::is_can);
        let clash = self.axes.iter().enumerate().find_map(|(other_index, other)| {
            let beside = is_can
                && other_index != index
                && other.is_complete()
                && other.bus() == self.axes[index].bus();
            let id = beside.then(|| clash(axis, other).or_else(|| clash(other, axis)))??;
            Some(format!("axis {index} and axis {other_index}: id {id:03X}"))
        });
        if let Some(threshold) = axis.blind_standstill() {
            let seen = format!("axis {index}, {:?}: {threshold} rad/s", axis.protocol());
            self.broken(Check::StandstillBlind, now, seen);
        }
        if let Some(seen) = blind {
            self.broken(Check::LimitBlind, now, seen);
        }
        if let Some(seen) = clash {
            self.broken(Check::IdShared, now, seen);
        }
    }
}

/// An id on which one axis is sent requests, and on which the other's motor acts or answers.
/// Exempt: replies of D5 motors, which say whose they are.
fn clash(one: &Axis, other: &Axis) -> Option<u32> {
    let requests = |axis: &Axis| {
        let node = u32::from(axis.node()?);
        Some(match axis.protocol()? {
            Protocol::Rmd => vec![0x140 + node, 0x400 + node],
            Protocol::Thruster => vec![0x300 + node],
            Protocol::D5 => vec![axis.d5_request_id().unwrap_or(node)],
        })
    };
    let mut uses = requests(other)?;
    let node = u32::from(other.node()?);
    match other.protocol()? {
        Protocol::Rmd => {
            uses.extend([0x240 + node, 0x500 + node]);
            uses.extend(RMD_GROUPS);
        }
        Protocol::Thruster => uses.push(0x280 + node),
        Protocol::D5 => {}
    }
    requests(one)?.into_iter().find(|id| uses.contains(id))
}
