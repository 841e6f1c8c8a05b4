//! The virtual board: the very image that would be flashed onto a NUCLEO-H743ZI or a NUCLEO-G474RE, on an emulated STM32H743 or STM32G474.

pub mod can_motors;
pub mod chip;
pub mod crs;
pub mod fdcan;
pub mod g474;
pub mod host_uart;
pub mod iwdg;
pub mod machine;
pub mod measure;
pub mod message_ram;
pub mod nodes;
pub mod outside;
pub mod part;
pub mod pins;
pub mod reaction;
pub mod revision;
pub mod row;
pub mod rs485_line;
pub mod serial_port;
pub mod serve;
pub mod transport;
pub mod usb;
