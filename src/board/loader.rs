//! The board's loader (`loader/`), which build.rs builds: it lies where the chip starts, before the
//! image. So one file has both.

/// Its bytes.
#[used]
#[unsafe(link_section = ".loader")]
static LOADER: [u8; BYTES.len()] = *BYTES;
const BYTES: &[u8; include_bytes!(concat!(env!("OUT_DIR"), "/loader.bin")).len()] =
    include_bytes!(concat!(env!("OUT_DIR"), "/loader.bin"));
