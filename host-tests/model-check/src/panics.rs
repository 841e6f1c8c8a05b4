//! Panics that are caught, and told by who has caught them.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static CATCHES: Cell<bool> = const { Cell::new(false) };
    static SAID: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Returns what a panic says and where it was, and prints nothing of it. What `act` has left behind
/// then is not to be used.
pub(crate) fn caught(act: impl FnOnce()) -> Result<(), String> {
    static LISTENS: Once = Once::new();
    LISTENS.call_once(|| {
        let others = take_hook();
        set_hook(Box::new(move |panic| {
            if CATCHES.get() {
                SAID.replace(panic.to_string());
            } else {
                others(panic);
            }
        }));
    });
    let outer = CATCHES.replace(true);
    let done = catch_unwind(AssertUnwindSafe(act));
    CATCHES.set(outer);
    done.map_err(|_| SAID.take())
}
