//! A person or a shell suspends the program and lets it go on: the terminal is another's meanwhile.

#[cfg(unix)]
mod signals {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    use signal_hook::consts::{SIGCONT, SIGTSTP};
    use signal_hook::{flag, low_level};

    use super::super::display::Display;
    use crate::failure::Failure;

    /// Notes both signals.
    pub struct Suspension {
        asked: Arc<AtomicBool>,
        continued: Arc<AtomicBool>,
    }

    impl Suspension {
        /// From now on.
        pub fn note() -> Self {
            let noted = |signal| {
                let flag = Arc::new(AtomicBool::new(false));
                // Where it cannot be arranged the signal does what it always does.
                let _ = flag::register(signal, flag.clone());
                flag
            };
            Self { asked: noted(SIGTSTP), continued: noted(SIGCONT) }
        }

        /// Suspends where that was asked for, and takes the terminal again after it: also after
        /// SIGSTOP, which nobody is told of. Whether it is to be drawn anew.
        pub fn heed(&self, display: &mut Display) -> Result<bool, Failure> {
            if self.asked.swap(false, Ordering::Relaxed) {
                display.give_back();
                // Returns when the program goes on.
                let _ = low_level::emulate_default_handler(SIGTSTP);
                self.continued.store(true, Ordering::Relaxed);
            }
            let has_gone_on = self.continued.swap(false, Ordering::Relaxed);
            if has_gone_on {
                display.take_again()?;
            }
            Ok(has_gone_on)
        }
    }
}

#[cfg(not(unix))]
mod signals {
    use super::super::display::Display;
    use crate::failure::Failure;

    /// There is none here.
    pub struct Suspension;

    impl Suspension {
        pub fn note() -> Self {
            Self
        }

        pub fn heed(&self, _: &mut Display) -> Result<bool, Failure> {
            Ok(false)
        }
    }
}

pub use signals::Suspension;
