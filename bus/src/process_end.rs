//! Ends this process at once.
#![allow(unsafe_code)]

/// Ends this process with these words on stderr and this exit code. Nothing else of the process runs any more, not even what it has
/// registered for its end.
#[cold]
pub fn end_process(words: &str, code: i32) -> ! {
    // Not by `std`: another thread may hold its lock for ever. If it fails, no one is there to be told.
    let _ = rustix::io::write(rustix::stdio::stderr(), format!("skein: {words}\n").as_bytes());
    // SAFETY: ends the process at once; no code runs after it.
    unsafe { libc::_exit(code) }
}
