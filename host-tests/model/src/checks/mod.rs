//! What follows from what was seen: one file for each side of it.

mod due;
mod frames;
mod hosts;
mod motors;
mod results;
