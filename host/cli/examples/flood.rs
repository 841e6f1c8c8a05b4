//! A cable with a flood of samples on it, for `.ci/view`: `flood tcp:HOST:PORT RATE`. Lines of
//! standard input: `on`, `off`, and `count`, which prints how many samples went by.

#[path = "../tests/program/flood.rs"]
mod flood;

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;

use flood::Flood;

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [gateway, rate] = arguments.as_slice() else {
        eprintln!("usage: flood tcp:HOST:PORT SAMPLES_PER_SECOND");
        std::process::exit(2);
    };
    let Ok(rate) = rate.parse() else {
        eprintln!("{rate:?}: samples each second are a whole number");
        std::process::exit(2);
    };
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("listening on tcp:{}", listener.local_addr()?);
    let flood = Arc::new(Flood::default());
    let gateway = gateway.trim_start_matches("tcp:").to_owned();
    let served = flood.clone();
    thread::spawn(move || served.serve(&listener, &gateway, rate));
    for line in std::io::stdin().lines() {
        match line?.trim() {
            "on" => flood.on.store(true, Ordering::Relaxed),
            "off" => flood.on.store(false, Ordering::Relaxed),
            "count" => println!("sent {}", flood.sent.load(Ordering::Relaxed)),
            other => println!("{other:?}: on, off or count"),
        }
    }
    Ok(())
}
