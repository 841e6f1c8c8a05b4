//! The boards' images on USB.

mod enumeration;
mod halt;
#[path = "../common/rtt.rs"]
mod rtt;

use std::path::PathBuf;
use std::time::Duration;

use virtual_board::board::Board;
use virtual_board::machine::{Builder, Machine};

/// Longer than the start takes, USB included.
const STARTED: Duration = Duration::from_millis(60);

/// The image of a board.
fn image(board: Board) -> PathBuf {
    let variable = match board {
        Board::NucleoH743zi => "MOTOR_GATEWAY_ELF",
        Board::NucleoG474re => "MOTOR_GATEWAY_G474_ELF",
    };
    std::env::var_os(variable).unwrap_or_else(|| panic!("{variable} names the image")).into()
}

fn builder(board: Board) -> Builder {
    Builder::of(board, &image(board)).unwrap_or_else(|error| panic!("{error}"))
}

/// The lines that the firmware has logged, without their times.
fn log(machine: &mut Machine, board: Board) -> Vec<String> {
    rtt::take(machine, &image(board))
}
