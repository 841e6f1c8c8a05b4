//! Client library of the motor gateway: requests with deadlines, events, the gateway's clock,
//! setpoints kept fresh.
//!
//! A [`Client`] lives on a [`Transport`], which carries its bytes and tells it the time: [`open`]
//! gives one for a serial device or a TCP port, a simulation brings its own in virtual time.
//!
//! ```no_run
//! use std::ops::ControlFlow;
//! use std::time::Duration;
//!
//! use mgw_client::host_protocol::{Setpoint, StopTarget};
//! use mgw_client::{Client, Hold, open};
//!
//! # fn main() -> Result<(), mgw_client::ClientError> {
//! let mut gateway = Client::connect(open("tcp:127.0.0.1:7401")?)?;
//! println!("{} runs {}", gateway.hello().board, gateway.hello().firmware);
//!
//! // Nothing moves unless it is armed, and no longer than setpoints keep coming.
//! let epoch = gateway.arm(0)?.epoch;
//! let setpoint = Setpoint::Velocity { velocity_rad_s: 2.0 };
//! let hold = Hold { axis: 0, epoch, setpoint, ttl: Duration::from_millis(100) };
//! gateway.hold_setpoints(&[hold], Duration::from_secs(1), |gateway| {
//!     while let Some(event) = gateway.poll_event(Duration::ZERO)? {
//!         println!("{event:?}");
//!     }
//!     Ok(ControlFlow::Continue(()))
//! })?;
//! gateway.stop(StopTarget::Axis(0))?;
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

mod asynchronous;
mod baud;
mod client;
mod clock;
mod commands;
mod cycle;
mod error;
mod flight;
mod hold;
mod image;
mod inbox;
mod interrupt;
mod kinds;
mod names;
mod port;
mod serial;
mod server;
mod stopping;
mod stream;
mod tcp;
mod transport;
#[cfg(unix)]
mod unix;

pub use host_protocol;

pub use asynchronous::{AsyncClient, Inner};
pub use client::{
    CLOCK_VALID_FOR, Client, DEADLINE, HELLO_DEADLINE, KEEP_ALIVE_AFTER, KEEP_SUBSCRIPTION_AFTER,
    REPEAT_AFTER,
};
pub use commands::MOTOR_DEADLINE;
pub use cycle::{
    AxisSetpoint, LAST_AXIS, make_current, make_impedance, make_position, make_signal,
    make_velocity,
};
pub use error::ClientError;
pub use hold::{Hold, NativeHold, Round};
pub use inbox::Losses;
pub use interrupt::Interrupt;
pub use names::names_before_hello;
pub use port::{ConnectError, Halves, check_shared_name, open, open_halves};
pub use serial::SerialTransport;
pub use server::{ReadCommander, server_port, server_socket};
pub use stopping::{REPEAT_STOP_AFTER, STOP_PATIENCE, StopRequest, stop_before_hello};
pub use tcp::TcpTransport;
pub use transport::Transport;
#[cfg(unix)]
pub use unix::UnixTransport;
