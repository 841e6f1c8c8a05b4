//! The header is that of the code; `.ci/c header` writes it anew.

use std::fs;
use std::path::Path;

#[test]
fn the_header_is_made_of_the_code() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = crate_folder.join("include/mgw.h");
    let bindings = cbindgen::generate(crate_folder).expect("the code can be read");
    let mut made = Vec::new();
    bindings.write(&mut made);
    if std::env::var_os("MGW_WRITE_HEADER").is_some() {
        fs::write(&path, &made).expect("the header can be written");
    }
    let kept = fs::read(&path).unwrap_or_default();
    assert!(kept == made, "include/mgw.h is not that of the code: .ci/c header writes it anew");
}
