//! The client library of the motor gateway for C. `include/mgw.h` is made of this.
//!
//! A handle belongs to one thread at a time; each may have its own, and a handle that is used
//! otherwise, or after it was closed, is refused. Every function that can fail
//! returns a [`mgw_result`]; [`mgw_error_text`] then says in words what was wrong and what to do.
#![allow(non_camel_case_types, reason = "the names of C")]

mod arguments;
mod commands;
mod connection;
mod error;
mod events;
mod values;

pub use commands::{
    mgw_arm, mgw_clear, mgw_clear_gateway, mgw_cycle, mgw_disarm, mgw_estop, mgw_output_off,
    mgw_read, mgw_set, mgw_stop, mgw_stop_all,
};
pub use connection::{mgw_close, mgw_connect, mgw_gateway, mgw_keep_alive, mgw_time_us};
pub use error::{mgw_error_number, mgw_error_text, mgw_result};
pub use events::{mgw_event, mgw_event_kind, mgw_poll_event};
pub use values::{mgw_axis, mgw_cycle_result, mgw_mode, mgw_setpoint, mgw_state, mgw_trip_reason};
