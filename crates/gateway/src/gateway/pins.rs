//! What the pins of a board tell the core, and what they show of it: e-stop input, enable output,
//! light (GUARANTEES G6).

use crate::axis::Is;
use crate::gateway::Gateway;
use crate::port::Light;
use crate::time::Instant;
use host_protocol::replies::GatewayReport;
use host_protocol::{AxisState, Event};

impl Gateway {
    /// The e-stop input was read. Open it does what the e-stop does; closed it only allows the
    /// e-stop to be cleared.
    pub(crate) fn e_stop_input(&mut self, now: Instant, open: bool) {
        let changed = core::mem::replace(&mut self.e_stop_input_open, open) != open;
        if open && (changed || !self.e_stopped) {
            self.e_stop(now);
        }
        if changed {
            self.outbox(now).event(&Event::EStopInputChanged { open });
        }
    }

    /// The level of the enable output since the latest event: inactive while a motor counts as
    /// unreachable, or one may be that a damaged memory has lost, so that its power can be cut.
    #[must_use]
    pub fn enable_output(&self) -> bool {
        self.enabled
    }

    /// Tells the hosts of an enable output that has changed.
    pub(crate) fn watch_enable_output(&mut self, now: Instant) {
        let active = self.axes.which(Is::Unreachable).is_empty() && !self.retention.has_lost();
        if core::mem::replace(&mut self.enabled, active) != active && self.board.enable_output {
            self.outbox(now).event(&Event::EnableOutputChanged { active });
        }
    }

    /// What the light of the board shows: the first of these that is so.
    #[must_use]
    pub fn light(&self) -> Light {
        let any = |is: fn(AxisState) -> bool| self.axes.iter().any(|axis| is(axis.state()));
        if self.e_stopped {
            Light::EStopped
        } else if any(|state| matches!(state, AxisState::Tripped { .. })) {
            Light::Tripped
        } else if self.link_lost {
            Light::LinkLost
        } else if any(|state| matches!(state, AxisState::Armed | AxisState::Active)) {
            Light::Armed
        } else if any(|state| state == AxisState::Holding) {
            Light::Holding
        } else {
            Light::Idle
        }
    }

    pub(crate) fn status(&self, now: Instant) -> GatewayReport {
        GatewayReport {
            time_us: now.as_micros(),
            starts: self.starts,
            holder: self.authority.holder,
            e_stop_latched: self.e_stopped,
            e_stop_input_open: self.board.e_stop_input.then_some(self.e_stop_input_open),
            enable_output: self.board.enable_output.then_some(self.enabled),
            random_number: self.epoch.is_some(),
            memory_damaged: self.retention.is_damaged,
            bus_limit: self.board.bus_limit,
        }
    }
}
