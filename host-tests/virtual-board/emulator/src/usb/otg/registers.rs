//! Offsets and bits of the registers that a driver of a full-speed device uses (RM0433 chapter 57;
//! names as in stm32-metapac's `otg_v1`).

/// Global registers.
pub mod global {
    pub const GOTGCTL: u64 = 0x000;
    pub const GOTGINT: u64 = 0x004;
    pub const GAHBCFG: u64 = 0x008;
    pub const GUSBCFG: u64 = 0x00C;
    pub const GRSTCTL: u64 = 0x010;
    pub const GINTSTS: u64 = 0x014;
    pub const GINTMSK: u64 = 0x018;
    pub const GRXSTSR: u64 = 0x01C;
    pub const GRXSTSP: u64 = 0x020;
    pub const GRXFSIZ: u64 = 0x024;
    pub const DIEPTXF0: u64 = 0x028;
    pub const GCCFG: u64 = 0x038;
    pub const CID: u64 = 0x03C;
    /// A constant of the core, which stm32-metapac names and ST's manual does not.
    pub const HWCFG4: u64 = 0x050;
    /// DIEPTXF1; the others follow.
    pub const DIEPTXF1: u64 = 0x104;
}

/// Device registers.
pub mod device {
    pub const DCFG: u64 = 0x800;
    pub const DCTL: u64 = 0x804;
    pub const DSTS: u64 = 0x808;
    pub const DIEPMSK: u64 = 0x810;
    pub const DOEPMSK: u64 = 0x814;
    pub const DAINT: u64 = 0x818;
    pub const DAINTMSK: u64 = 0x81C;
    pub const DIEPEMPMSK: u64 = 0x834;
    /// The endpoints' registers: IN from here, OUT from there, 0x20 bytes each.
    pub const IN: u64 = 0x900;
    pub const OUT: u64 = 0xB00;
    pub const ENDPOINT: u64 = 0x20;
    /// In them.
    pub const CTL: u64 = 0x00;
    pub const INT: u64 = 0x08;
    pub const SIZ: u64 = 0x10;
    pub const TXFSTS: u64 = 0x18;
}

/// The power and clock gating register.
pub const PCGCCTL: u64 = 0xE00;
/// The FIFOs as the processor reaches them, 4 KiB each.
pub const FIFO: u64 = 0x1000;
pub const FIFO_BYTES: u64 = 0x1000;
/// What GRSTCTL.TXFNUM and others can name.
pub const ENDPOINTS: usize = 9;

/// GOTGCTL.
pub mod gotgctl {
    pub const BVALOEN: u32 = 1 << 6;
    pub const BVALOVAL: u32 = 1 << 7;
    /// CIDSTS, read-only: no plug of a host.
    pub const CIDSTS: u32 = 1 << 16;
    /// BSVLD, read-only: a session.
    pub const BSVLD: u32 = 1 << 19;
}

/// GAHBCFG.GINT.
pub const GINT: u32 = 1 << 0;
/// GUSBCFG.
pub const PHYSEL: u32 = 1 << 6;
pub const FDMOD: u32 = 1 << 30;
/// GCCFG.
pub const PWRDWN: u32 = 1 << 16;
pub const VBDEN: u32 = 1 << 21;

/// GRSTCTL.
pub mod grstctl {
    pub const CSRST: u32 = 1 << 0;
    pub const RXFFLSH: u32 = 1 << 4;
    pub const TXFFLSH: u32 = 1 << 5;
    pub const TXFNUM: u32 = 0x1F << 6;
    pub const ALL_FIFOS: u32 = 0x10;
    pub const AHBIDL: u32 = 1 << 31;
}

/// GINTSTS and GINTMSK.
pub mod gint {
    pub const CMOD: u32 = 1 << 0;
    pub const SOF: u32 = 1 << 3;
    pub const RXFLVL: u32 = 1 << 4;
    pub const NPTXFE: u32 = 1 << 5;
    pub const ESUSP: u32 = 1 << 10;
    pub const USBSUSP: u32 = 1 << 11;
    pub const USBRST: u32 = 1 << 12;
    pub const ENUMDNE: u32 = 1 << 13;
    pub const EOPF: u32 = 1 << 15;
    pub const IEPINT: u32 = 1 << 18;
    pub const OEPINT: u32 = 1 << 19;
    pub const PTXFE: u32 = 1 << 26;
    pub const WKUPINT: u32 = 1 << 31;
    /// What writing a 1 clears, of what can be set here.
    pub const LATCHED: u32 = SOF | ESUSP | USBSUSP | USBRST | ENUMDNE | EOPF | WKUPINT;
}

/// DCTL.
pub mod dctl {
    pub const SDIS: u32 = 1 << 1;
    pub const SGINAK: u32 = 1 << 7;
    pub const SGONAK: u32 = 1 << 9;
    pub const RWUSIG: u32 = 1 << 0;
}

/// DCFG.DAD.
pub const DAD_SHIFT: u32 = 4;
pub const DAD: u32 = 0x7F << DAD_SHIFT;

/// DSTS.
pub mod dsts {
    pub const SUSPSTS: u32 = 1 << 0;
    /// ENUMSPD: full speed, with the internal transceiver.
    pub const FULL_SPEED: u32 = 3 << 1;
    pub const FNSOF_SHIFT: u32 = 8;
}

/// DIEPCTL and DOEPCTL.
pub mod epctl {
    pub const MPSIZ: u32 = 0x7FF;
    pub const USBAEP: u32 = 1 << 15;
    pub const DPID: u32 = 1 << 16;
    pub const NAKSTS: u32 = 1 << 17;
    pub const EPTYP: u32 = 3 << 18;
    pub const ISOCHRONOUS: u32 = 1 << 18;
    pub const STALL: u32 = 1 << 21;
    pub const TXFNUM_SHIFT: u32 = 22;
    pub const TXFNUM: u32 = 0xF << TXFNUM_SHIFT;
    pub const CNAK: u32 = 1 << 26;
    pub const SNAK: u32 = 1 << 27;
    pub const SD0PID: u32 = 1 << 28;
    pub const SD1PID: u32 = 1 << 29;
    pub const EPDIS: u32 = 1 << 30;
    pub const EPENA: u32 = 1 << 31;
}

/// DIEPINT and DOEPINT.
pub mod epint {
    pub const XFRC: u32 = 1 << 0;
    pub const EPDISD: u32 = 1 << 1;
    /// DOEPINT only: the setup stage is over.
    pub const STUP: u32 = 1 << 3;
    /// DIEPINT only: an IN token found no data; NAK is in force; the FIFO is empty.
    pub const ITTXFE: u32 = 1 << 4;
    pub const INEPNE: u32 = 1 << 6;
    pub const TXFE: u32 = 1 << 7;
}

/// DIEPTSIZ and DOEPTSIZ.
pub mod eptsiz {
    pub const XFRSIZ: u32 = 0x7_FFFF;
    pub const PKTCNT_SHIFT: u32 = 19;
    pub const PKTCNT: u32 = 0x3FF << PKTCNT_SHIFT;
    /// DOEPTSIZ0 only.
    pub const STUPCNT_SHIFT: u32 = 29;
    pub const STUPCNT: u32 = 3 << STUPCNT_SHIFT;
}

/// GRXSTSP, PKTSTS of a device.
pub mod pktsts {
    pub const OUT_DATA: u32 = 2;
    pub const OUT_DONE: u32 = 3;
    pub const SETUP_DONE: u32 = 4;
    pub const SETUP_DATA: u32 = 6;
}
