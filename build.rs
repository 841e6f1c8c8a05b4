//! Chooses the memory regions of the board, passes the linker scripts and names the build.

use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// What `Hello` can carry of the build id, bytes.
const MAX_BUILD_ID: usize = 40;

/// The boards: the variable that cargo sets for the feature, and the board's memory regions.
const BOARDS: [(&str, &str); 2] = [
    ("CARGO_FEATURE_NUCLEO_H743ZI", "src/board/nucleo_h743zi.x"),
    ("CARGO_FEATURE_NUCLEO_G474RE", "src/board/nucleo_g474re.x"),
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    choose_memory_regions();
    // Here and not in .cargo/config.toml, because a RUSTFLAGS variable replaces the flags of that
    // file.
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=--icf=all");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo::rustc-env=GATEWAY_BUILD_ID={}", build_id());
}

/// Copies the regions of the chosen board to `board.x` in the output folder, where the linker finds
/// it: the root `memory.x` only includes it, as the linker would take a `memory.x` of the working
/// directory before any other.
fn choose_memory_regions() {
    let mut chosen = BOARDS.iter().filter(|(feature, _)| env::var_os(feature).is_some());
    let (Some((_, regions)), None) = (chosen.next(), chosen.next()) else {
        panic!("choose exactly one board feature, for example --features nucleo-h743zi");
    };
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    fs::copy(regions, Path::new(&out).join("board.x"))
        .expect("the board's memory regions can be copied");
    println!("cargo::rustc-link-search={out}");
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rerun-if-changed={regions}");
}

/// The commit with its nearest tag, marked when the tree differs from it; the package version where
/// git knows nothing.
fn build_id() -> String {
    for name in ["HEAD", "logs/HEAD", "index"] {
        if let Some(path) =
            git(&["rev-parse", "--git-path", name]).filter(|path| Path::new(path).exists())
        {
            println!("cargo::rerun-if-changed={path}");
        }
    }
    println!("cargo::rerun-if-changed=src");
    let mut id = git(&["describe", "--always", "--tags", "--dirty", "--abbrev=12"])
        .unwrap_or_else(|| format!("v{}", env!("CARGO_PKG_VERSION")));
    id.truncate(id.floor_char_boundary(MAX_BUILD_ID));
    id
}

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(arguments)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (!text.is_empty()).then_some(text)
}
