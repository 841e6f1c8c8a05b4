//! A run as a text file: a line for each step, `#` begins a comment.
//!
//! ```text
//! start 4293967296
//! 240 host 0 bus 1 window 2000 protocols 4
//! 3180 host 0 configure 6 bus = 1
//! 74928 host 0 setpoint 6 epoch 0 lead 48000 velocity 0.5
//! 94138 motor 3 mute 5000
//! ```

mod read;
mod write;

pub use read::read;
pub use write::write;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Step, World, generate::Generator};

    #[test]
    fn what_is_written_is_read_again() {
        let (mut world, mut generator) = (World::new(1_000), Generator::new(7));
        let steps: Vec<Step> = (0..3_000)
            .map(|_| {
                let step = generator.next(&world);
                world.step(&step);
                step
            })
            .collect();
        let text = write(1_000, &steps);
        let (start_us, read) = read(&text).unwrap();
        assert_eq!(start_us, 1_000);
        // NaN is not equal to itself; as text it is.
        assert_eq!(write(1_000, &read), text);
    }

    #[test]
    fn a_line_that_is_none_is_told() {
        assert_eq!(read("5 host 0 dance").unwrap_err(), "not understood: 5 host 0 dance");
        assert_eq!(read("5 cut 0 10 20").unwrap_err(), "not understood: 5 cut 0 10 20");
    }
}
