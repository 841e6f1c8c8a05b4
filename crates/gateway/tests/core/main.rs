//! The core in virtual time: typed requests on one side, literal bytes on the other.

mod after_reset;
mod bad_input;
mod bench;
mod brake;
mod bystanders;
mod cancellation;
mod capabilities;
mod clearing;
mod d5;
mod dead_bus;
mod echo;
mod fairness;
mod holding;
mod impedance;
mod motion;
mod motors;
mod natives;
mod pins;
mod random;
mod relative_moves;
mod rig;
mod stops;
mod subscriptions;
mod text;
mod trip_groups;
mod wire;
