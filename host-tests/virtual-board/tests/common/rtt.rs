//! An image's own log: taken out of its RTT buffer, decoded with the strings of the same image.

use std::path::Path;
use std::time::Duration;

use defmt_decoder::{DecodeError, Table};
use virtual_board::machine::Machine;

/// Takes the lines that the firmware of this image has logged since the last time: `INFO bus 0: CAN
/// at 1000000 bit/s`.
pub fn take(machine: &mut Machine, image: &Path) -> Vec<String> {
    // Drained each whole millisecond.
    machine.run_for(Duration::from_millis(1));
    let image = std::fs::read(image).expect("a readable image");
    let table =
        Table::parse(&image).expect("the strings of the image").expect("an image that logs");
    let mut decoder = table.new_stream_decoder();
    decoder.received(&machine.take_rtt());
    let mut lines = Vec::new();
    loop {
        match decoder.decode() {
            Ok(frame) => {
                let line = frame.display(false).to_string();
                // Before the level stands the time since the start.
                let (_, line) = line.split_once(' ').expect("a time and a text");
                lines.push(line.trim().to_owned());
            }
            Err(DecodeError::UnexpectedEof) => return lines,
            Err(DecodeError::Malformed) => {
                panic!("a log line that cannot be decoded, after {lines:?}")
            }
        }
    }
}
