//! Prints to stdout.

use std::io::Write;

/// Prints a line. A reader that is gone does not matter.
pub(crate) fn say(line: &str) {
    let mut out = std::io::stdout();
    let _ = writeln!(out, "{line}").and_then(|()| out.flush());
}
