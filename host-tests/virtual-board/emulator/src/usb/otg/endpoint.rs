//! An endpoint's registers, IN or OUT.

use serde::{Deserialize, Serialize};

use super::registers::{epctl, epint, eptsiz};
use crate::usb::function::Toggle;

/// Packet sizes of endpoint 0 as DIEPCTL0.MPSIZ codes them.
const SIZES_OF_0: [usize; 4] = [64, 32, 16, 8];

/// The registers of one endpoint in one direction.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Endpoint {
    /// Endpoint 0: always active; its STALL is cleared by a SETUP only.
    is_0: bool,
    /// DIEPCTL or DOEPCTL, without the bits that only act.
    ctl: u32,
    /// DIEPINT or DOEPINT, without TXFE.
    pub flags: u32,
    /// DIEPTSIZ or DOEPTSIZ.
    pub size: u32,
}

impl Endpoint {
    /// Out of reset.
    pub fn new(number: usize) -> Self {
        let ctl = if number == 0 { epctl::USBAEP } else { 0 };
        Self { is_0: number == 0, ctl, flags: 0, size: 0 }
    }

    /// DIEPCTL or DOEPCTL.
    pub fn ctl(&self) -> u32 {
        self.ctl
    }

    /// It is written. Returns what the model does not do.
    pub fn write_ctl(&mut self, written: u32) -> Option<&'static str> {
        let kept =
            epctl::MPSIZ | epctl::EPTYP | epctl::TXFNUM | if self.is_0 { 0 } else { epctl::USBAEP };
        self.ctl = self.ctl & !kept | written & kept;
        let stall = written & epctl::STALL;
        self.ctl = if self.is_0 { self.ctl | stall } else { self.ctl & !epctl::STALL | stall };
        if written & epctl::SNAK != 0 {
            self.ctl |= epctl::NAKSTS;
            self.flags |= epint::INEPNE;
        }
        if written & epctl::CNAK != 0 {
            self.ctl &= !epctl::NAKSTS;
        }
        if written & epctl::SD0PID != 0 {
            self.ctl &= !epctl::DPID;
        }
        if written & epctl::SD1PID != 0 {
            self.ctl |= epctl::DPID;
        }
        if written & epctl::EPDIS != 0 {
            if self.is(epctl::EPENA) {
                self.flags |= epint::EPDISD;
            }
            self.ctl &= !epctl::EPENA;
        } else {
            self.ctl |= written & epctl::EPENA;
        }
        (self.ctl & epctl::EPTYP == epctl::ISOCHRONOUS).then_some("an isochronous endpoint")
    }

    /// Whether a bit of DIEPCTL or DOEPCTL is set.
    pub fn is(&self, bit: u32) -> bool {
        self.ctl & bit != 0
    }

    /// Sets bits of it.
    pub fn set(&mut self, bits: u32) {
        self.ctl |= bits;
    }

    /// Clears bits of it.
    pub fn clear(&mut self, bits: u32) {
        self.ctl &= !bits;
    }

    /// Bytes of the longest packet.
    pub fn packet(&self) -> usize {
        let coded = self.ctl & epctl::MPSIZ;
        if self.is_0 { SIZES_OF_0[(coded & 3) as usize] } else { coded as usize }
    }

    /// Of the next packet.
    pub fn toggle(&self) -> Toggle {
        if self.is(epctl::DPID) { Toggle::Data1 } else { Toggle::Data0 }
    }

    /// The next packet is the other one.
    pub fn flip(&mut self) {
        self.ctl ^= epctl::DPID;
    }

    /// Bytes of the transfer that are left.
    pub fn bytes(&self) -> usize {
        (self.size & eptsiz::XFRSIZ) as usize
    }

    /// A packet of the transfer is over. Returns whether it was the last.
    pub fn count(&mut self, bytes: usize) -> bool {
        let left = self.bytes().saturating_sub(bytes);
        let packets = (self.size & eptsiz::PKTCNT).saturating_sub(1 << eptsiz::PKTCNT_SHIFT);
        self.size = self.size & !(eptsiz::XFRSIZ | eptsiz::PKTCNT)
            | u32::try_from(left).expect("nineteen bits")
            | packets & eptsiz::PKTCNT;
        packets & eptsiz::PKTCNT == 0
    }

    /// The transmit FIFO of an IN endpoint.
    pub fn fifo(&self) -> usize {
        if self.is_0 { 0 } else { ((self.ctl & epctl::TXFNUM) >> epctl::TXFNUM_SHIFT) as usize }
    }
}
