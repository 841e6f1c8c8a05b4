//! Chooses the memory regions of the board, passes the linker scripts, builds the board's loader
//! and names the build.

use std::ffi::OsString;
use std::path::Path;
use std::process::Command;
use std::{env, fs};

/// What `Hello` can carry of the build id, bytes.
const MAX_BUILD_ID: usize = 40;

/// A board.
struct Board {
    /// The variable that cargo sets for its feature.
    feature: &'static str,
    /// Its memory regions.
    regions: &'static str,
    /// What these include.
    included: &'static [&'static str],
    /// Whether there is a loader for it, so that it takes images.
    has_loader: bool,
}

const BOARDS: [Board; 2] = [
    Board {
        feature: "CARGO_FEATURE_NUCLEO_H743ZI",
        regions: "src/board/nucleo_h743zi.x",
        included: &["src/board/h743_layout.x"],
        has_loader: true,
    },
    Board {
        feature: "CARGO_FEATURE_NUCLEO_G474RE",
        regions: "src/board/nucleo_g474re.x",
        included: &[],
        has_loader: false,
    },
];

/// Variables with which a cargo that builds the firmware would change how the loader is built: its
/// flags, clippy in the compiler's place, and where its folders are.
const NOT_FOR_THE_LOADER: [&str; 6] = [
    "CARGO_ENCODED_RUSTFLAGS",
    "RUSTFLAGS",
    "RUSTC_WORKSPACE_WRAPPER",
    "CARGO_TARGET_DIR",
    "CARGO_BUILD_TARGET",
    "CARGO_BUILD_TARGET_DIR",
];
/// What the loader's build begins with.
const LOADER_SOURCES: [&str; 7] = [
    "loader/build.rs",
    "loader/Cargo.toml",
    "loader/Cargo.lock",
    "loader/memory.x",
    "loader/src",
    "src/board/h743_flash.rs",
    "src/board/h743_layout.x",
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let board = board();
    choose_memory_regions(board);
    println!("cargo::rustc-check-cfg=cfg(has_loader)");
    if board.has_loader {
        println!("cargo::rustc-cfg=has_loader");
        build_loader();
    }
    // Here and not in .cargo/config.toml, because a RUSTFLAGS variable replaces the flags of that
    // file.
    println!("cargo::rustc-link-arg-bins=--nmagic");
    println!("cargo::rustc-link-arg-bins=--icf=all");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo::rustc-env=GATEWAY_BUILD_ID={}", build_id());
}

fn board() -> &'static Board {
    let mut chosen = BOARDS.iter().filter(|board| env::var_os(board.feature).is_some());
    let (Some(board), None) = (chosen.next(), chosen.next()) else {
        panic!("choose exactly one board feature, for example --features nucleo-h743zi");
    };
    board
}

fn out() -> String {
    env::var("OUT_DIR").expect("cargo sets OUT_DIR")
}

/// Copies the regions of the board to `board.x` in the output folder, where the linker finds it:
/// the root `memory.x` only includes it, as the linker would take a `memory.x` of the working
/// directory before any other.
fn choose_memory_regions(board: &Board) {
    let out = out();
    let copy = |from: &str, name: &str| {
        fs::copy(from, Path::new(&out).join(name))
            .expect("the board's memory regions can be copied");
        println!("cargo::rerun-if-changed={from}");
    };
    copy(board.regions, "board.x");
    for included in board.included {
        let name = Path::new(included).file_name().and_then(|name| name.to_str());
        copy(included, name.expect("a file's name"));
    }
    println!("cargo::rustc-link-search={out}");
    println!("cargo::rerun-if-changed=memory.x");
}

/// Builds the loader in a folder of its own, and leaves its bytes as `loader.bin` in the output
/// folder, whence `src/board/loader.rs` takes them.
fn build_loader() {
    let target = env::var("TARGET").expect("cargo sets TARGET");
    let cargo = env::var_os("CARGO").unwrap_or(OsString::from("cargo"));
    let folder = Path::new(&out()).join("loader");
    let mut build = Command::new(cargo);
    build.args(["build", "--release", "--locked", "--manifest-path", "loader/Cargo.toml"]);
    build.args(["--bin", "loader", "--target", &target]).arg("--target-dir").arg(&folder);
    for name in NOT_FOR_THE_LOADER {
        build.env_remove(name);
    }
    let status = build.status().expect("cargo runs");
    assert!(status.success(), "the loader does not build: cargo {status}");
    let elf = fs::read(folder.join(&target).join("release/loader")).expect("the loader's file");
    fs::write(Path::new(&out()).join("loader.bin"), flashed(&elf)).expect("a file of the output");
    LOADER_SOURCES.iter().for_each(|path| println!("cargo::rerun-if-changed={path}"));
}

/// What of a little-endian ELF32 file goes to the flash, from its lowest address on.
fn flashed(elf: &[u8]) -> Vec<u8> {
    const LOAD: usize = 1;
    let number = |at: usize, bytes: usize| {
        let bytes = elf.get(at..at + bytes).expect("the file is whole");
        bytes.iter().rev().fold(0, |number, byte| number << 8 | usize::from(*byte))
    };
    let (first, length, count) = (number(28, 4), number(42, 2), number(44, 2));
    let headers = (0..count).map(|index| first + index * length);
    // Type, offset in the file, virtual address, address, bytes in the file.
    let parts = headers
        .map(|at| (number(at, 4), number(at + 4, 4), number(at + 12, 4), number(at + 16, 4)));
    let mut parts: Vec<_> = parts.filter(|(kind, .., bytes)| *kind == LOAD && *bytes > 0).collect();
    parts.sort_by_key(|(_, _, address, _)| *address);
    let begin = parts.first().expect("it loads something").2;
    let mut flashed = Vec::new();
    for (_, offset, address, bytes) in parts {
        flashed.resize(address - begin, 0xFF);
        flashed.extend_from_slice(elf.get(offset..offset + bytes).expect("the file is whole"));
    }
    flashed
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
