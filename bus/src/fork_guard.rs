//! Finds out whether this process is a copy that `fork` made.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::process_end::end_process;
use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous};
use std::ptr::NonNull;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Exit code of a copy that is ended.
const COPY_ENDED: i32 = 3;

/// Belongs to the process that makes it. A copy of that process finds out by it that it is a copy. This costs no system call.
#[derive(Clone, Copy, Debug)]
pub struct ForkGuard {
    token: u32,
}

/// A word that the kernel sets to 0 in every copy of this process, in memory that stays mapped.
struct WipedWord(NonNull<AtomicU32>);

// SAFETY: the pointer is to an atomic that stays mapped until the process ends; any thread may use it.
unsafe impl Send for WipedWord {}
// SAFETY: as for `Send`.
unsafe impl Sync for WipedWord {}

impl ForkGuard {
    /// A guard of this process. A copy of a process can make guards of its own.
    ///
    /// # Errors
    /// [`BusError::System`] if the kernel is older than 4.14.
    pub fn new() -> Result<Self, BusError> {
        /// Counts the processes that made a guard and descend from each other by `fork`.
        static GENERATION: AtomicU32 = AtomicU32::new(1);
        let word = wiped_word()?;
        let fresh = GENERATION.fetch_add(1, Ordering::Relaxed);
        // Of several threads that come here first, one sets the word.
        let token = match word.compare_exchange(0, fresh, Ordering::Relaxed, Ordering::Relaxed) {
            Ok(_) => fresh,
            Err(set) => set,
        };
        Ok(Self { token })
    }

    /// Whether this process is a copy of the one that made the guard.
    #[inline]
    #[must_use]
    pub fn is_copy(self) -> bool {
        wiped_word().is_ok_and(|word| word.load(Ordering::Relaxed) != self.token)
    }

    /// Ends this process if it is a copy of the one that made the guard, with these words on stderr. Nothing else of the process
    /// is touched: what it has open in shared memory belongs to the original.
    #[inline]
    pub fn end_copy(self, words: impl FnOnce() -> String) {
        if self.is_copy() {
            end_process(&words(), COPY_ENDED);
        }
    }
}

/// The word of this process.
fn wiped_word() -> Result<&'static AtomicU32, BusError> {
    static WORD: OnceLock<WipedWord> = OnceLock::new();
    if WORD.get().is_none() {
        let made = make_word()?;
        // If another thread was first, its word counts, and this one stays unused.
        let _ = WORD.set(made);
    }
    // SAFETY: the mapping is never removed, it is aligned to a page, and all bit patterns are values of an atomic.
    Ok(unsafe { WORD.get_or_init(|| unreachable!("it was set above")).0.as_ref() })
}

fn make_word() -> Result<WipedWord, BusError> {
    let (len, prot) = (rustix::param::page_size(), ProtFlags::READ | ProtFlags::WRITE);
    // SAFETY: a new mapping at an address that the kernel chooses overlaps no other memory.
    let page = unsafe { mmap_anonymous(std::ptr::null_mut(), len, prot, MapFlags::PRIVATE) };
    let page = page.map_err(BusError::system("map a page"))?;
    // SAFETY: the page was just mapped, and holds nothing yet.
    unsafe { madvise(page, len, Advice::LinuxWipeOnFork) }.map_err(BusError::system("have a page wiped on fork"))?;
    let word =
        NonNull::new(page.cast()).ok_or_else(|| BusError::Control("a page was mapped at address 0".to_owned()))?;
    Ok(WipedWord(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_knows_that_it_is_one_and_ends() {
        let guard = ForkGuard::new().unwrap();
        assert!(!guard.is_copy() && ForkGuard::new().unwrap().token == guard.token);
        // SAFETY: the copy calls nothing but atomics, a write and `_exit`, apart from one allocation; glibc allows that.
        let copy = unsafe { libc::fork() };
        if copy == 0 {
            let own = ForkGuard::new().is_ok_and(|own| !own.is_copy());
            if guard.is_copy() && own {
                guard.end_copy(|| "this line is expected: a copy has ended".to_owned());
            }
            // SAFETY: as above.
            unsafe { libc::_exit(1) }
        }
        let mut status = 0;
        // SAFETY: waits for a child of this process, and writes to a variable that lives.
        assert_eq!(unsafe { libc::waitpid(copy, &raw mut status, 0) }, copy);
        assert_eq!((libc::WIFEXITED(status), libc::WEXITSTATUS(status)), (true, COPY_ENDED));
        guard.end_copy(|| unreachable!("this is the original"));
    }
}
