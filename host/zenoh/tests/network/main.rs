//! Gateways in a network: simulated ones, each with its server and its `mgw-zenoh`, as processes.

mod commanding;
mod publishing;
mod refusing;
mod silence;
mod support;
