//! The boards' images on USB, at 100 million instructions a second.

/// The tests of a module, on each board.
macro_rules! on_each_board {
    ($($test:ident),+ $(,)?) => {
        mod h743 {
            $(#[test]
            fn $test() {
                super::$test(virtual_board::board::Board::NucleoH743zi);
            })+
        }
        mod g474 {
            $(#[test]
            fn $test() {
                super::$test(virtual_board::board::Board::NucleoG474re);
            })+
        }
    };
}

mod absence;
mod detach;
mod enumeration;
mod halt;
mod requests;
mod rig;
#[path = "../common/rtt.rs"]
mod rtt;
mod traffic;
mod urgency;
