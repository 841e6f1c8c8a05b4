#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| checks::promises::from_bad_hosts(bytes));
