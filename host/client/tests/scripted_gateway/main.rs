//! The client against a gateway that is a script, in virtual time.

mod bad_line;
mod flight;
mod hold;
mod hostile;
mod line;
mod natives;
mod session;
mod subscription;
