//! Registers and bits of the STM32G474's USB (stm32-metapac 21, `usb_v3`; RM0440, USB registers). A
//! test compares them.

/// Offsets of the registers behind those of the endpoints.
pub const CNTR: u32 = 0x40;
pub const ISTR: u32 = 0x44;
pub const FNR: u32 = 0x48;
pub const DADDR: u32 = 0x4C;
pub const BTABLE: u32 = 0x50;
pub const LPMCSR: u32 = 0x54;
pub const BCDR: u32 = 0x58;

/// CNTR: held in reset, switched off, low power, suspended, remote wake-up.
pub const FRES: u16 = 1 << 0;
pub const PDWN: u16 = 1 << 1;
pub const LPMODE: u16 = 1 << 2;
pub const FSUSP: u16 = 1 << 3;
pub const RESUME: u16 = 1 << 4 | 1 << 5;
/// ISTR, and in the same places the interrupt enables of CNTR.
pub const ESOF: u16 = 1 << 8;
pub const SOF: u16 = 1 << 9;
pub const RESET: u16 = 1 << 10;
pub const SUSP: u16 = 1 << 11;
pub const WKUP: u16 = 1 << 12;
pub const CTR: u16 = 1 << 15;
/// The flags that a 0 clears, and the direction of [`CTR`].
pub const FLAGS: u16 = 0x7F80;
pub const DIR: u16 = 1 << 4;
/// FNR: three frames are missing; the timer is locked; the lines' levels.
pub const LSOF: u16 = 3 << 11;
pub const LCK: u16 = 1 << 13;
pub const RXDP: u16 = 1 << 15;
/// DADDR: the device takes part; its address.
pub const EF: u16 = 1 << 7;
pub const ADD: u16 = 0x7F;
pub const BTABLE_BITS: u16 = 0xFFF8;
/// BCDR: the pull-up on D+, and everything else that can be set.
pub const DPPU: u16 = 1 << 15;
pub const CHARGER: u16 = 0xF;
