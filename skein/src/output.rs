//! Prints to stdout.

use crate::exit::Failure;
use rustix::stdio::dup2_stdout;
use std::fmt::Display;
use std::fs::File;
use std::io::{ErrorKind, IsTerminal, Stdout, Write};
use std::os::fd::AsFd;
use std::sync::{Mutex, PoisonError};

/// The caller's stdout while pilots print to stderr.
static KEPT: Mutex<Option<File>> = Mutex::new(None);

/// Keeps stdout for the command's own output. Until this is dropped, whatever else prints to stdout, such as a pilot in this process,
/// prints to stderr.
pub(crate) struct KeptStdout(());

impl KeptStdout {
    /// Takes stdout.
    pub(crate) fn take() -> std::io::Result<Self> {
        let stdout = std::io::stdout().as_fd().try_clone_to_owned()?;
        dup2_stdout(std::io::stderr())?;
        *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = Some(stdout.into());
        Ok(Self(()))
    }
}

impl Drop for KeptStdout {
    fn drop(&mut self) {
        // What was printed without an end of line. If it cannot be written, no one is there to read it.
        let _ = std::io::stdout().flush();
        if let Some(stdout) = KEPT.lock().unwrap_or_else(PoisonError::into_inner).take() {
            let _ = dup2_stdout(stdout);
        }
    }
}

/// Whether the command's output goes to a terminal.
pub(crate) fn is_terminal() -> bool {
    let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    kept.as_ref().map_or_else(|| std::io::stdout().is_terminal(), File::is_terminal)
}

/// Prints to stdout. Returns whether the output has a reader: a closed pipe is the reader's choice, not a failure.
pub(crate) fn print(text: impl AsRef<[u8]>) -> Result<bool, Failure> {
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    let written = match kept.as_mut() {
        Some(stdout) => stdout.write_all(text.as_ref()),
        None => write(std::io::stdout(), text.as_ref()),
    };
    match written {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Failure::environment(format!("stdout: {error}"))),
    }
}

fn write(stdout: Stdout, text: &[u8]) -> std::io::Result<()> {
    let mut out = stdout.lock();
    out.write_all(text)?;
    out.flush()
}

/// Prints a line to stdout, as [`print`].
pub(crate) fn print_line(line: impl Display) -> Result<bool, Failure> {
    print(format!("{line}\n"))
}
