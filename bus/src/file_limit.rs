//! The limit of file sizes (`ulimit -f`). It holds for files in shared memory, too.
#![allow(unsafe_code)]

use std::io;

/// From now on, a file that reaches the limit of file sizes (`ulimit -f`) is an error of the call that writes or lengthens it. By default
/// it ends the process, without words. Processes that this one starts inherit it. A program that handles the signal itself keeps its handler.
pub fn outlive_file_limit() {
    // SAFETY: plain data; zeroes are a value of it.
    let mut now = unsafe { std::mem::zeroed::<libc::sigaction>() };
    // SAFETY: changes nothing, and writes to a variable that lives.
    let known = unsafe { libc::sigaction(libc::SIGXFSZ, std::ptr::null(), &raw mut now) } == 0;
    if known && now.sa_sigaction == libc::SIG_DFL {
        // SAFETY: no code of this process runs for a signal that is ignored.
        unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    }
}

/// What to do about an error, in words that follow it; empty for all errors but that of the limit.
pub(crate) fn hint(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::FileTooLarge => "; raise the limit of file sizes (`ulimit -f`)",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn an_error_of_the_limit_names_it() {
        let error = |kind| crate::BusError::io("reserve", Path::new("/dev/shm/x"))(io::Error::from(kind)).to_string();
        assert!(error(io::ErrorKind::FileTooLarge).ends_with("; raise the limit of file sizes (`ulimit -f`)"));
        assert!(!error(io::ErrorKind::StorageFull).contains("ulimit"));
    }
}
