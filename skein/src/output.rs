//! Prints to stdout and stderr. A terminal that is gone, or a full disk behind them, ends no command in the middle.

use crate::exit::Failure;
use std::borrow::Cow;
use std::fmt::Display;
use std::io::{ErrorKind, Write};

/// Prints to stdout. Returns whether anybody reads it: a closed pipe is the reader's choice, not a failure.
pub(crate) fn print(text: impl AsRef<[u8]>) -> Result<bool, Failure> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_ref()).and_then(|()| out.flush()) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Failure::environment(format!("stdout: {error}"))),
    }
}

/// Prints a line to stdout, as [`print`].
pub(crate) fn print_line(line: impl Display) -> Result<bool, Failure> {
    print(format!("{line}\n"))
}

/// Prints a message to stderr. If that fails, nobody is there to be told.
pub(crate) fn complain(message: impl Display) {
    let message = message.to_string();
    let _ = writeln!(std::io::stderr().lock(), "skein: {}", printable(&message));
}

/// The text with its control characters replaced, except for line feeds and tabs. Texts from files may contain sequences
/// that steer a terminal.
fn printable(text: &str) -> Cow<'_, str> {
    skein_report::text::printable(text)
}
