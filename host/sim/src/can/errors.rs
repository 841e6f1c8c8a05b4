//! The error counters of one CAN controller (ISO 11898-1 §12.1).

use host_protocol::BusState;

/// Counter value from which a controller warns.
const WARNING: u16 = 96;
/// Counter value from which a controller is error passive.
const PASSIVE: u16 = 128;
/// Transmit counter value at which a controller is bus-off.
const BUS_OFF: u16 = 256;
/// What an error costs a transmitter.
const TRANSMIT_PENALTY: u16 = 8;

/// Transmit and receive error counter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ErrorCounters {
    pub(crate) transmit: u16,
    pub(crate) receive: u16,
}

impl ErrorCounters {
    pub(crate) fn state(self) -> BusState {
        let worst = self.transmit.max(self.receive);
        if self.transmit >= BUS_OFF {
            BusState::BusOff
        } else if worst >= PASSIVE {
            BusState::Passive
        } else if worst >= WARNING {
            BusState::Warning
        } else {
            BusState::Active
        }
    }

    pub(crate) fn is_passive(self) -> bool {
        self.transmit.max(self.receive) >= PASSIVE
    }

    pub(crate) fn is_bus_off(self) -> bool {
        self.transmit >= BUS_OFF
    }

    pub(crate) fn transmitted(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    pub(crate) fn received(&mut self) {
        // Out of error passive a good frame sets the counter just below the limit.
        self.receive = self.receive.min(PASSIVE).saturating_sub(1);
    }

    pub(crate) fn transmit_error(&mut self) {
        self.transmit = self.transmit.saturating_add(TRANSMIT_PENALTY).min(BUS_OFF);
    }

    /// Nobody acknowledged. An error-passive transmitter does not count that: a lone node never
    /// goes bus-off.
    pub(crate) fn missing_acknowledgement(&mut self) {
        if !self.is_passive() {
            self.transmit_error();
        }
    }

    pub(crate) fn receive_error(&mut self) {
        self.receive = self.receive.saturating_add(1).min(PASSIVE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lone_node_ends_error_passive() {
        let mut counters = ErrorCounters::default();
        let mut states = Vec::new();
        for _ in 0..40 {
            counters.missing_acknowledgement();
            states.push(counters.state());
        }
        assert_eq!(states[10..13], [BusState::Active, BusState::Warning, BusState::Warning]);
        assert_eq!(states[14..17], [BusState::Warning, BusState::Passive, BusState::Passive]);
        assert_eq!(counters, ErrorCounters { transmit: 128, receive: 0 });
    }

    #[test]
    fn thirty_two_bit_errors_are_bus_off() {
        let mut counters = ErrorCounters::default();
        (0..31).for_each(|_| counters.transmit_error());
        assert_eq!(counters.state(), BusState::Passive);
        counters.transmit_error();
        assert_eq!(counters.state(), BusState::BusOff);
    }
}
