//! Messages on stderr. A terminal that is gone, or a full disk behind it, ends no command in the middle.

use skein_report::text::printable;
use std::fmt::Display;
use std::io::Write;

/// Prints a message to stderr, without the control characters that it may have from a file. If that fails, no one is there to
/// be told.
pub(crate) fn complain(message: impl Display) {
    let message = message.to_string();
    let _ = writeln!(std::io::stderr().lock(), "skein: {}", printable(&message));
}
