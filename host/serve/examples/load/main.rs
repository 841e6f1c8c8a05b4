//! `mgw serve` under load, with real processes: 32 programs, of which one commands, one does not
//! read and two flood; each is killed (`kill -9`) again and again, and the cable is pulled out.
//!
//! ```text
//! cargo build --release -p mgw --bin mgw
//! cargo run --release -p mgw-serve --example load -- target/release/mgw 600
//! ```
//!
//! It fails where a stop comes more than 5 ms of this computer's time later than its bound, where
//! something is lost that was acknowledged, or where a program is not served. A third word plants a
//! fault that it must notice: `late-stop`, `late-trip` or `forgotten`.
#![forbid(unsafe_code)]

mod cable;
mod programs;
mod run;
mod times;
mod witness;

use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use run::Run;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match *words {
        ["program", kind, port, number] => programs::run(kind, port, number),
        [mgw, seconds] => all(mgw, seconds, ""),
        [mgw, seconds, plant @ ("late-stop" | "late-trip" | "forgotten")] => {
            all(mgw, seconds, plant)
        }
        _ => Err("usage: load MGW SECONDS [late-stop|late-trip|forgotten]".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("FAILED: {error}");
            ExitCode::FAILURE
        }
    }
}

fn all(mgw: &str, seconds: &str, plant: &str) -> Outcome<()> {
    let span = Duration::from_secs(seconds.parse()?);
    let mut run = Run::begin(mgw.into(), plant.into())?;
    let begin = Instant::now();
    let done = run.go_on_until(begin + span).and_then(|()| run.check_end());
    run.print(begin.elapsed());
    run.kill_all();
    done
}
