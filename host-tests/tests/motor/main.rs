//! `mgw motor` on simulated motors in virtual time: its frames byte by byte, and what is left where
//! power or cable are lost at any of them.

mod bytes;
mod cuts;
mod doubts;
mod rig;
