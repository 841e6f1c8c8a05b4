//! Counterexamples that the random runs found, shrunk (`found/`, a file each, which says what was
//! broken): the core keeps every promise there now.

use model_check::{broken_by, text};
use std::path::Path;

/// After the last step, µs.
const SETTLE_US: u64 = 300_000;

#[test]
fn what_was_found_is_mended() {
    let found = Path::new(env!("CARGO_MANIFEST_DIR")).join("found");
    let mut files: Vec<_> =
        std::fs::read_dir(found).unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 8, "{files:?}");
    for file in files {
        let (start_us, steps) = text::read(&std::fs::read_to_string(&file).unwrap()).unwrap();
        assert!(!steps.is_empty(), "{file:?}");
        let broken = broken_by(start_us, &steps, SETTLE_US);
        assert!(broken.is_none(), "{file:?}: {}", broken.unwrap().0);
    }
}
