//! Panics of a pilot are caught, and their messages kept instead of printed.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread is in [`catch`].
    static CATCHING: Cell<bool> = const { Cell::new(false) };
    static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
}

static HOOK: Once = Once::new();

/// Calls `step`. If it panics, gives the panic in words, such as `panicked at src/boid.rs:12:5: no neighbour`, and nothing is
/// printed. Without unwinding (`panic = "abort"`), a panic ends the process.
pub(crate) fn catch<R>(step: impl FnOnce() -> R) -> Result<R, String> {
    HOOK.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info| if CATCHING.get() { keep(info) } else { before(info) }));
    });
    CATCHING.set(true);
    let result = catch_unwind(AssertUnwindSafe(step));
    CATCHING.set(false);
    result.map_err(|_| MESSAGE.take())
}

fn keep(info: &PanicHookInfo<'_>) {
    let text = info.payload_as_str().unwrap_or("a panic without a message");
    let place = info.location().map(|place| format!(" at {}:{}:{}", place.file(), place.line(), place.column()));
    MESSAGE.set(format!("panicked{}: {text}", place.unwrap_or_default()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_words_with_its_place() {
        assert_eq!(catch(|| 3), Ok(3));
        let words = catch(|| panic!("no {}", "neighbour")).unwrap_err();
        assert!(words.starts_with("panicked at ") && words.ends_with(": no neighbour"), "{words}");
        assert!(words.contains("reported_panic.rs:"), "{words}");
    }
}
