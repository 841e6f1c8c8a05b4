//! Lays snapshots of the core out as an image of the same build has it in memory, and takes them of
//! a core that lies there: for `.ci/virtual-board replay`, which runs it on a processor of its own,
//! beside an image that stands still.
//!
//! The compiler lays a type out the same in two programs of one build; whoever uses this checks it,
//! as a core that lies otherwise gives no snapshot that reads well.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod desk;

#[cfg(not(target_os = "none"))]
fn main() {}
