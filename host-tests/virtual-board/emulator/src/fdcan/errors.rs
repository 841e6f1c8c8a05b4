//! The error counters and the states that follow from them (ISO 11898-1), and ECR and PSR.

use serde::{Deserialize, Serialize};

use super::registers::ir;

/// From here on the warning status.
const WARNING: u16 = 96;
/// From here on error-passive.
const PASSIVE: u16 = 128;
/// From here on bus-off, for transmit errors.
const BUS_OFF: u16 = 256;
/// REC counts no further.
const REC_MAX: u16 = 128;
/// Where REC goes on from after a good frame, when it was at its end: 119 to 127 are allowed.
const REC_AFTER_PASSIVE: u16 = 127;
/// What an error at a sender counts, and at a receiver that saw a dominant bit after its error
/// flag.
const HEAVY: u16 = 8;

/// What went wrong: the codes of PSR.LEC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ErrorCode {
    /// Six equal bits.
    Stuff = 1,
    /// A field of fixed form.
    Form = 2,
    /// No acknowledgement.
    Acknowledge = 3,
    /// Sent recessive, read dominant.
    Bit1 = 4,
    /// Sent dominant, read recessive.
    Bit0 = 5,
    /// Checksum.
    Crc = 6,
}

/// Nothing since the last read.
const UNCHANGED: u8 = 7;
/// A frame went well.
const NO_ERROR: u8 = 0;

/// Counters and states of a controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Errors {
    /// TEC, 0..=255. Stays as it was when the controller went bus-off: 248 after errors that count
    /// eight, which is what Linux shows of an M_CAN there.
    transmit: u16,
    /// REC, 0..=128; 128 reads as 127 with RP.
    receive: u16,
    bus_off: bool,
    last: u8,
    /// CEL: errors counted since ECR was last read.
    logged: u8,
}

impl Errors {
    /// After a reset.
    pub const RESET: Self =
        Self { transmit: 0, receive: 0, bus_off: false, last: UNCHANGED, logged: 0 };

    /// Error warning.
    #[must_use]
    pub fn warning(&self) -> bool {
        self.transmit >= WARNING || self.receive >= WARNING
    }

    /// Error-passive.
    #[must_use]
    pub fn passive(&self) -> bool {
        self.transmit >= PASSIVE || self.receive >= PASSIVE
    }

    /// Bus-off.
    #[must_use]
    pub fn is_bus_off(&self) -> bool {
        self.bus_off
    }

    /// A frame that it sent failed. Returns the interrupt flags that follow.
    ///
    /// A missing acknowledgement counts only while it is error-active: alone on a bus it never goes
    /// bus-off.
    #[must_use]
    pub fn send_failed(&mut self, code: ErrorCode) -> u32 {
        let counts = code != ErrorCode::Acknowledge || !self.passive();
        self.change(code, |errors| {
            if !counts {
                return 0;
            }
            if errors.transmit + HEAVY >= BUS_OFF {
                errors.bus_off = true;
            } else {
                errors.transmit += HEAVY;
            }
            errors.log()
        })
    }

    /// A frame that it received failed; `first`: it was the first to find that, and saw the others'
    /// error flags after its own.
    #[must_use]
    pub fn receive_failed(&mut self, code: ErrorCode, first: bool) -> u32 {
        let by = if first { 1 + HEAVY } else { 1 };
        self.change(code, |errors| {
            errors.receive = (errors.receive + by).min(REC_MAX);
            errors.log()
        })
    }

    /// A frame that it sent was acknowledged and ended well.
    #[must_use]
    pub fn sent(&mut self) -> u32 {
        self.follow(|errors| {
            errors.last = NO_ERROR;
            errors.transmit = errors.transmit.saturating_sub(1);
            0
        })
    }

    /// A frame arrived well.
    #[must_use]
    pub fn received(&mut self) -> u32 {
        self.follow(|errors| {
            errors.last = NO_ERROR;
            errors.receive = match errors.receive {
                REC_MAX.. => REC_AFTER_PASSIVE,
                count => count.saturating_sub(1),
            };
            0
        })
    }

    /// On the way back from bus-off: another 11 recessive bits.
    pub fn recessive_sequence(&mut self) {
        self.last = ErrorCode::Bit0 as u8;
    }

    /// The controller joins the bus: if it was bus-off, its counters start anew.
    #[must_use]
    pub fn joined(&mut self) -> u32 {
        self.follow(|errors| {
            if errors.bus_off {
                *errors = Self { last: errors.last, logged: errors.logged, ..Self::RESET };
            }
            0
        })
    }

    /// ECR as it reads; `counted` stands in REC during the recovery from bus-off. Clears CEL.
    pub fn read_ecr(&mut self, counted: Option<u16>) -> u32 {
        let value = self.ecr(counted);
        self.logged = 0;
        value
    }

    /// ECR.
    #[must_use]
    pub fn ecr(&self, counted: Option<u16>) -> u32 {
        let receive = counted.unwrap_or(self.receive);
        let passive = u32::from(receive >= REC_MAX) << 15;
        u32::from(self.logged) << 16
            | passive
            | u32::from(receive.min(REC_MAX - 1)) << 8
            | u32::from(self.transmit)
    }

    /// PSR as it reads with this ACT. Sets LEC to "no change".
    pub fn read_psr(&mut self, activity: u32) -> u32 {
        let value = self.psr(activity);
        self.last = UNCHANGED;
        value
    }

    /// PSR. DLEC stays at its reset value: classic CAN has no data phase of its own.
    #[must_use]
    pub fn psr(&self, activity: u32) -> u32 {
        u32::from(UNCHANGED) << 8
            | u32::from(self.bus_off) << 7
            | u32::from(self.warning()) << 6
            | u32::from(self.passive()) << 5
            | activity << 3
            | u32::from(self.last)
    }

    fn change(&mut self, code: ErrorCode, act: impl FnOnce(&mut Self) -> u32) -> u32 {
        ir::PEA
            | self.follow(|errors| {
                errors.last = code as u8;
                act(errors)
            })
    }

    /// Acts, and returns the flags of the states that changed with what the act returned.
    fn follow(&mut self, act: impl FnOnce(&mut Self) -> u32) -> u32 {
        let before = *self;
        let mut flags = act(self);
        let mut compare =
            |flag, before: bool, now: bool| flags |= if before == now { 0 } else { flag };
        compare(ir::EW, before.warning(), self.warning());
        compare(ir::EP, before.passive(), self.passive());
        compare(ir::BO, before.bus_off, self.bus_off);
        flags
    }

    /// Counts in CEL, which stops at its end.
    fn log(&mut self) -> u32 {
        match self.logged.checked_add(1) {
            Some(logged) => {
                self.logged = logged;
                0
            }
            None => ir::ELO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_acknowledgement_it_stops_at_128() {
        let mut errors = Errors::RESET;
        let mut flags = Vec::new();
        for _ in 0..20 {
            flags.push(errors.send_failed(ErrorCode::Acknowledge));
        }
        assert_eq!(flags[10], ir::PEA);
        assert_eq!(flags[11], ir::PEA | ir::EW, "12 × 8 = 96");
        assert_eq!(flags[15], ir::PEA | ir::EP, "16 × 8 = 128");
        assert_eq!(flags[19], ir::PEA);
        assert_eq!(errors.read_ecr(None), 0x0010_0080, "CEL 16, TEC 128");
        assert_eq!(errors.ecr(None), 0x0000_0080, "reading clears CEL");
        assert_eq!(errors.read_psr(1), 0x0000_076B, "EW, EP, idle, acknowledge error");
        assert_eq!(errors.psr(1), 0x0000_076F, "no change since");
    }

    #[test]
    fn bit_errors_lead_to_bus_off_at_the_32nd() {
        let mut errors = Errors::RESET;
        for _ in 0..31 {
            assert_eq!(errors.send_failed(ErrorCode::Bit1) & ir::BO, 0);
        }
        assert_eq!(errors.send_failed(ErrorCode::Bit1), ir::PEA | ir::BO);
        assert_eq!(errors.ecr(None) & 0xFF, 248);
        assert_eq!(errors.joined(), ir::BO | ir::EP | ir::EW);
        assert_eq!(errors.ecr(None) & 0xFFFF, 0);
    }

    #[test]
    fn receive_errors_saturate_and_one_good_frame_leaves_passive() {
        let mut errors = Errors::RESET;
        for _ in 0..15 {
            let _ = errors.receive_failed(ErrorCode::Stuff, true);
        }
        assert!(errors.passive());
        assert_eq!(errors.ecr(None) & 0xFFFF, 0xFF00, "RP and 127");
        assert_eq!(errors.received(), ir::EP);
        assert_eq!(errors.ecr(None) & 0xFFFF, 0x7F00);
    }

    #[test]
    fn the_log_of_errors_stops_and_says_so() {
        let mut errors = Errors::RESET;
        for _ in 0..255 {
            assert_eq!(errors.receive_failed(ErrorCode::Form, false) & ir::ELO, 0);
        }
        assert_eq!(errors.receive_failed(ErrorCode::Form, false) & ir::ELO, ir::ELO);
        assert_eq!(errors.ecr(None) >> 16, 255);
    }
}
