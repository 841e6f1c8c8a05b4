//! An image that calls every public function of a codec through which bytes of a wire pass, with
//! values that the compiler cannot know, and whose panic handler calls what no one defines: if the
//! optimiser leaves a way to a panic, the image does not link. Where it links, no bytes can make
//! these functions panic.
//!
//! Not called is the text of errors (`Display`): `core::fmt` keeps panics of its own. The image is
//! never run.
#![no_std]
#![no_main]

#[cfg(feature = "d5")]
mod d5_calls;
#[cfg(feature = "host-protocol")]
mod host_protocol_calls;
#[cfg(feature = "rmd")]
mod rmd_calls;
#[cfg(feature = "thruster")]
mod thruster_calls;

use core::hint::black_box;
use core::panic::PanicInfo;

/// As many bytes as a test input needs: the longest message of the host protocol, and more than any
/// frame.
const INPUT_LEN: usize = 600;

unsafe extern "C" {
    /// Defined nowhere. The linker's complaint names it.
    safe fn a_panic_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    a_panic_is_reachable()
}

/// Where the linker starts to look for what is used.
#[unsafe(no_mangle)]
extern "C" fn _start() -> ! {
    let input = any([0; INPUT_LEN]);
    let input = input.get(..any(INPUT_LEN)).unwrap_or_default();
    loop {
        #[cfg(feature = "d5")]
        d5_calls::all(input);
        #[cfg(feature = "host-protocol")]
        host_protocol_calls::all(input);
        #[cfg(feature = "rmd")]
        rmd_calls::all(input);
        #[cfg(feature = "thruster")]
        thruster_calls::all(input);
        #[cfg(feature = "planted-index")]
        used(input[any(0)]);
    }
}

/// The value, of which the compiler then knows nothing but its type.
fn any<T>(value: T) -> T {
    black_box(value)
}

/// Keeps the work that makes the value.
fn used<T>(value: T) {
    black_box(value);
}

/// Input bytes as an array, whatever they are.
#[cfg_attr(not(any(feature = "d5", feature = "rmd", feature = "host-protocol")), expect(dead_code))]
fn array<const N: usize>() -> [u8; N] {
    any([0; N])
}
