//! The output lines of a model: the bus hears of a level when it changes.

use rigless::device::Level;

/// Drives each line whose level is not the one that it was `driven` to last.
pub(crate) fn follow(
    driven: &mut [bool],
    level: impl Fn(usize) -> bool,
    mut drive: impl FnMut(usize, Level),
) {
    for (line, driven) in driven.iter_mut().enumerate() {
        let level = level(line);
        if *driven != level {
            *driven = level;
            drive(line, Level::from(level));
        }
    }
}
