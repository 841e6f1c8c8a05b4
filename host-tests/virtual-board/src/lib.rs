//! The virtual board: the very image that would be flashed onto a NUCLEO-H743ZI or a NUCLEO-G474RE,
//! on an emulated STM32H743 or STM32G474 of the crate [`virtual_stm32`].

pub mod board;
pub mod can_motors;
pub mod cycle_rates;
pub mod host_uart;
pub mod machine;
pub mod measure;
pub mod nodes;
pub mod outside;
pub mod pins;
pub mod reaction;
pub mod replay;
pub mod rs485_line;
pub mod sections;
pub mod serve;
pub mod transport;
pub mod usb_session;
pub mod usual;
