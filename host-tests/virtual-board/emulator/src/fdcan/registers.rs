//! Bits of the registers, by the names of the reference manual.

/// CCCR, control.
pub mod cccr {
    pub const INIT: u32 = 1 << 0;
    pub const CCE: u32 = 1 << 1;
    pub const ASM: u32 = 1 << 2;
    pub const CSA: u32 = 1 << 3;
    pub const CSR: u32 = 1 << 4;
    pub const MON: u32 = 1 << 5;
    pub const DAR: u32 = 1 << 6;
    pub const TEST: u32 = 1 << 7;
    pub const FDOE: u32 = 1 << 8;
    pub const BRSE: u32 = 1 << 9;
    pub const PXHD: u32 = 1 << 12;
    pub const EFBI: u32 = 1 << 13;
    pub const TXP: u32 = 1 << 14;
    pub const NISO: u32 = 1 << 15;
    /// Changed only while INIT and CCE are set.
    pub const PROTECTED: u32 = DAR | FDOE | BRSE | PXHD | EFBI | TXP | NISO;
    /// Set only while INIT and CCE are set, cleared at any time.
    pub const SET_PROTECTED: u32 = ASM | MON | TEST;
}

/// IR, IE and ILS: one bit for each source.
pub mod ir {
    /// RF0N, RF0W, RF0F and RF0L; those of FIFO 1 lie [`RX_FIFO_SHIFT`] higher.
    pub const RF0N: u32 = 1 << 0;
    pub const RF0W: u32 = 1 << 1;
    pub const RF0F: u32 = 1 << 2;
    pub const RF0L: u32 = 1 << 3;
    pub const RX_FIFO_SHIFT: u32 = 4;
    pub const HPM: u32 = 1 << 8;
    pub const TC: u32 = 1 << 9;
    pub const TCF: u32 = 1 << 10;
    pub const TFE: u32 = 1 << 11;
    pub const TEFN: u32 = 1 << 12;
    pub const TEFW: u32 = 1 << 13;
    pub const TEFF: u32 = 1 << 14;
    pub const TEFL: u32 = 1 << 15;
    pub const TSW: u32 = 1 << 16;
    pub const MRAF: u32 = 1 << 17;
    pub const DRX: u32 = 1 << 19;
    pub const ELO: u32 = 1 << 22;
    pub const EP: u32 = 1 << 23;
    pub const EW: u32 = 1 << 24;
    pub const BO: u32 = 1 << 25;
    pub const PEA: u32 = 1 << 27;
    /// The bits that exist.
    pub const ALL: u32 = 0x3FFF_FFFF;
}

/// Reset values that are not 0. Of CREL, ENDN and NBTP the values that embassy-stm32 asks for or a
/// board shows; the others from the register descriptions of the M_CAN.
pub mod reset {
    pub const CREL: u32 = 0x3214_1218;
    pub const ENDN: u32 = 0x8765_4321;
    pub const DBTP: u32 = 0x0000_0A33;
    pub const CCCR: u32 = super::cccr::INIT;
    pub const NBTP: u32 = 0x0600_0A03;
    pub const TOCC: u32 = 0xFFFF_0000;
    pub const TOCV: u32 = 0x0000_FFFF;
    pub const XIDAM: u32 = 0x1FFF_FFFF;
}

/// `width` bits of `value` from `low` on.
pub const fn field(value: u32, low: u32, width: u32) -> u32 {
    value >> low & ((1 << width) - 1)
}

/// The same as an index or a count.
pub const fn count(value: u32, low: u32, width: u32) -> usize {
    field(value, low, width) as usize
}

/// Words of a message RAM element with the data field size that the code says: two of header, then
/// the data.
pub const fn element_words(code: u32) -> usize {
    const DATA_BYTES: [usize; 8] = [8, 12, 16, 20, 24, 32, 48, 64];
    2 + DATA_BYTES[(code & 7) as usize] / 4
}
