//! Switches a virtual board with the simulator's four motors on and serves its host UARTs over TCP,
//! in real time, until Ctrl-C.
//!
//! `.ci/virtual-board serve [HOST:PORT [HOST:PORT]]` builds the image and starts it.

use std::net::TcpListener;
use std::process::ExitCode;
use std::time::Duration;
use std::{env, fs, io};

use virtual_board::board::Board;
use virtual_board::machine::{Builder, image_path};
use virtual_board::outside::Outside;
use virtual_board::serve::serve;

/// Where host links 0 and 1 are served unless said otherwise.
const ADDRESSES: [&str; 2] = ["127.0.0.1:7401", "127.0.0.1:7402"];
/// Decides the motors' reply times.
const SEED: u64 = 1;
/// By then the board has started: it takes 3 ms.
const STARTED: Duration = Duration::from_millis(20);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.len() > ADDRESSES.len()
        || arguments.iter().any(|argument| argument.starts_with('-'))
    {
        eprintln!(
            "usage: serve [HOST:PORT of host link 0 [HOST:PORT of host link 1]]; \
             port 0 takes a free one"
        );
        return ExitCode::from(2);
    }
    let mut addresses = ADDRESSES.map(str::to_owned);
    for (address, argument) in addresses.iter_mut().zip(arguments) {
        *address = argument;
    }
    match run(&addresses) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// A file that configures the four motors: the example, which is of the NUCLEO-H743ZI, or a copy of
/// it with the RS485 bus of this board.
fn configuration() -> io::Result<String> {
    const FILE: &str = "host/cli/examples/four-motors.toml";
    let (example, board) = (Board::default(), Board::chosen());
    if board == example {
        return Ok(FILE.to_owned());
    }
    let text = fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../host/cli/examples/four-motors.toml"
    ))?;
    let [of_example, of_board] =
        [example, board].map(|board| format!("\nbus = {}\n", board.rs485_bus()));
    let copy = env::temp_dir().join(format!("four-motors-{}.toml", board.name()));
    fs::write(&copy, text.replace(&of_example, &of_board))?;
    Ok(copy.display().to_string())
}

fn run([first, second]: &[String; 2]) -> Result<(), Box<dyn std::error::Error>> {
    let listen = |address: &String| {
        TcpListener::bind(address).map_err(|error| format!("{address}: {error}"))
    };
    let listeners = [listen(first)?, listen(second)?];
    let image = image_path()?;
    let mut board = Builder::new(&image)?;
    let outside = Outside::four_motors(&mut board, SEED);
    let mut machine = board.power_on();
    machine.run_for(STARTED);

    let port = listeners[0].local_addr()?;
    println!("the virtual board runs {}", image.display());
    println!("host link 0 is tcp:{port}, host link 1 is tcp:{}", listeners[1].local_addr()?);
    println!("try: mgw --port tcp:{port} info");
    println!("     mgw --port tcp:{port} config apply {}", configuration()?);
    println!("     mgw --port tcp:{port} set 0 velocity 2 --for 3");
    println!("Ctrl-C ends it. What its motors do, in seconds since the start:");
    serve(listeners, machine, outside, |line| println!("{line}"))?;
    Ok(())
}
