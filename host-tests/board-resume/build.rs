//! Passes the linker script, and the regions beside the image of the board.

use std::path::Path;
use std::{env, fs};

/// Each has a feature, and a file that says where its regions lie.
const BOARDS: [(&str, &str); 2] = [
    ("CARGO_FEATURE_NUCLEO_H743ZI", "nucleo-h743zi.x"),
    ("CARGO_FEATURE_NUCLEO_G474RE", "nucleo-g474re.x"),
];
const SCRIPT: &str = "board-resume.x";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let chosen = BOARDS.iter().find(|(feature, _)| env::var_os(feature).is_some());
    let (_, regions) = chosen.expect("a feature chooses the board");
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    for (from, to) in [(SCRIPT, SCRIPT), (regions, "regions.x")] {
        println!("cargo::rerun-if-changed={from}");
        fs::copy(from, Path::new(&out).join(to)).expect("it is here");
    }
    println!("cargo::rustc-link-search={out}");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=-T{SCRIPT}");
}
