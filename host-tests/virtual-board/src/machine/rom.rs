//! ROM bootloaders that do one thing each: leave for the image in the flash, with their own vector
//! table still in place, or wait.

use std::path::Path;

use rigless::image::Image;

use crate::board::Board;

/// Entries of its vector table: 16 of the core, 150 of the STM32H743 or 102 of the STM32G474.
const VECTORS: usize = 166;
/// Where its code begins.
const CODE: u32 = 0x400;
/// Where every interrupt leads: `b .`, 16 bytes into the code.
const HANDLER: u32 = CODE + 0x10;
/// Thumb code.
const THUMB: u32 = 1;

/// Takes stack pointer and entry from the vector table of the image.
const LEAVE: [u16; 9] = [
    0x4802, // ldr r0, [pc, #8]: the literal
    0x6801, // ldr r1, [r0]
    0xF381, 0x8808, // msr msp, r1
    0x6841, // ldr r1, [r0, #4]
    0x4708, // bx r1
    0x0000, 0x0800, // the image: 0x0800_0000
    0xE7FE, // b .
];

/// The bootloader of a board's chip, to be placed beside an image, and its address: the first
/// system memory (AN2606).
pub fn rom_bootloader(board: Board) -> (u32, Image) {
    // Its stack begins at the end of the DTCM or of SRAM1.
    let (rom, stack) = match board {
        Board::NucleoH743zi => (0x1FF0_0000, 0x2002_0000),
        Board::NucleoG474re => (0x1FFF_0000, 0x2001_4000),
    };
    let mut words = vec![stack, rom + CODE + THUMB];
    words.resize(VECTORS, rom + HANDLER + THUMB);
    let mut bytes: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    bytes.resize(CODE as usize, 0xFF);
    bytes.extend(LEAVE.into_iter().flat_map(u16::to_le_bytes));
    let image = Image::new(Path::new("ROM bootloader"), bytes, Some(rom.into()));
    (rom, image.expect("no ELF file, and placed"))
}

/// Where the firmware of a board starts the bootloader: its vector table (AN2606).
const fn started_at(board: Board) -> u32 {
    match board {
        Board::NucleoH743zi => 0x1FF0_9800,
        Board::NucleoG474re => 0x1FFF_0000,
    }
}

/// RAM of either board, for the stack.
const STACK: u32 = 0x2000_4000;

/// The first instruction of the bootloader that a board's firmware starts.
pub const fn bootloader_entry(board: Board) -> u64 {
    (started_at(board) + WAIT) as u64
}

/// Where it lies, behind stack pointer and entry.
const WAIT: u32 = 8;

/// That bootloader, to be placed beside an image: it waits for an update that does not come.
pub fn waiting_bootloader(board: Board) -> Image {
    let place = started_at(board);
    let mut bytes: Vec<u8> =
        [STACK, place + WAIT + THUMB].into_iter().flat_map(u32::to_le_bytes).collect();
    bytes.extend(0xE7FE_u16.to_le_bytes()); // b .
    Image::new(Path::new("ROM bootloader"), bytes, Some(place.into()))
        .expect("no ELF file, and placed")
}
