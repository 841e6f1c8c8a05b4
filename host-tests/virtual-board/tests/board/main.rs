//! The unmodified image, end to end and under faults: commands go in through the public client
//! library, what comes out is read on the virtual wires and in the motors' own logs. All of it in
//! virtual time.

mod baud;
mod bench;
mod can;
mod checkers;
mod determinism;
#[path = "../common/dma.rs"]
mod dma;
mod end_to_end;
mod faults;
mod first_turn;
mod flight;
mod floods;
mod full_load;
mod gaps;
mod hse;
mod lab;
mod log;
mod only_g474;
mod only_h743;
mod part;
mod reaction;
mod rs485_times;
#[path = "../common/rtt.rs"]
mod rtt;
mod serial_settings;
mod silicon;
mod storage;
#[path = "../../../../host/cli/tests/program/typed.rs"]
mod typed;
mod unmodelled;
mod update;
mod wire;
