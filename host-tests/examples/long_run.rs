//! A gateway at full load in virtual time, for so many hours of it or minutes of real time,
//! whatever is over first.
//!
//! ```sh
//! cargo run --release -p host-tests --example long_run -- 24 10
//! ```
#![forbid(unsafe_code)]

use std::process::ExitCode;
use std::time::{Duration, Instant};

fn main() -> ExitCode {
    let numbers: Vec<u64> = std::env::args().skip(1).flat_map(|word| word.parse()).collect();
    let [hours, minutes] = numbers[..] else {
        eprintln!("usage: long_run HOURS MINUTES");
        return ExitCode::from(2);
    };
    let end = Instant::now() + Duration::from_secs(60 * minutes);
    let told = |tally: &host_tests::full_load::Tally| {
        eprintln!("{tally}");
        Instant::now() < end
    };
    match host_tests::long_run::run(Duration::from_secs(3_600 * hours), told) {
        Ok(tally) => {
            println!("{tally}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
