//! Tests of the model on register level, as the processor sees it. Values are literal; a comment
//! says what they mean.

mod bench;
mod bus_off;
mod cancellation;
mod configuration;
mod errors;
mod interrupts;
mod nodes;
mod reception;
mod timing;
mod transmission;
