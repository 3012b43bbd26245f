//! Prints to stdout.

use crate::exit::Failure;
use std::fmt::Display;
use std::io::{ErrorKind, Write};

/// Prints to stdout. Returns whether the output has a reader: a closed pipe is the reader's choice, not a failure.
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
