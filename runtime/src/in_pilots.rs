//! Which pilots this process is in: those that threads make or step right now, if they say so. Saying so takes two stores.

use skein_bus::{BusError, guard_exit};
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

thread_local! {
    /// The drone whose pilot this thread is in. It is never dropped, so that it can be read while the process ends.
    static HERE: Cell<Option<u32>> = const { Cell::new(None) };
}

/// What the places of all threads hold.
static PLACES: Mutex<Vec<Arc<Word>>> = Mutex::new(Vec::new());

/// 0, or a [`Stay`] as a number. Threads write theirs all the time, so each has a cache line of its own.
#[repr(align(128))]
struct Word(AtomicU64);

/// Where a thread says which pilot it is in.
pub(crate) struct Place {
    word: Arc<Word>,
    /// Number of stays so far.
    stays: u32,
}

/// A pilot that a thread is in: one call of it, from its begin to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stay(u64);

/// A thread is in a pilot for as long as this lives.
pub(crate) struct InPilot<'p>(&'p Place);

impl Place {
    /// A place of this thread.
    pub(crate) fn new() -> Self {
        let word = Arc::new(Word(AtomicU64::new(0)));
        places(|places| places.push(Arc::clone(&word)));
        Self { word, stays: 0 }
    }

    /// Says that this thread is in the pilot of a drone from now on.
    #[inline]
    pub(crate) fn enter(&mut self, drone: u32) -> InPilot<'_> {
        // Never 0, which means that it is in none.
        self.stays = self.stays.wrapping_add(1).max(1);
        self.word.0.store(u64::from(self.stays) << 32 | u64::from(drone), Ordering::Relaxed);
        HERE.set(Some(drone));
        InPilot(self)
    }
}

impl Default for Place {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        places(|places| places.retain(|place| !Arc::ptr_eq(place, &self.word)));
    }
}

impl Drop for InPilot<'_> {
    #[inline]
    fn drop(&mut self) {
        HERE.set(None);
        self.0.word.0.store(0, Ordering::Relaxed);
    }
}

impl Stay {
    /// The drone whose pilot it is.
    pub(crate) fn drone(self) -> u32 {
        self.0 as u32
    }
}

/// All pilots that threads are in now.
pub(crate) fn stays() -> Vec<Stay> {
    let words: Vec<u64> = places(|places| places.iter().map(|word| word.0.load(Ordering::Relaxed)).collect());
    words.into_iter().filter(|&word| word != 0).map(Stay).collect()
}

/// From now on, a pilot that ends this process, such as by [`std::process::exit`], ends it with words on stderr and exit code 3.
pub(crate) fn guard() -> Result<(), BusError> {
    guard_exit(|| {
        let drone = HERE.get()?;
        Some(format!(
            "the pilot of drone {drone} ended the process, and with it the run; expected that it returns, or panics to give up; \
             with --runtime processes, only this drone is lost"
        ))
    })
}

fn places<R>(look: impl FnOnce(&mut Vec<Arc<Word>>) -> R) -> R {
    look(&mut PLACES.lock().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Other tests of this program step drones with lower numbers.
    const DRONE: u32 = u32::MAX;

    fn here() -> Vec<Stay> {
        stays().into_iter().filter(|stay| stay.drone() == DRONE).collect()
    }

    #[test]
    fn each_call_of_a_pilot_is_a_stay_of_its_own() {
        let mut place = Place::new();
        let first = {
            let _in = place.enter(DRONE);
            assert_eq!(HERE.get(), Some(DRONE));
            here()
        };
        assert_eq!((first.len(), here(), HERE.get()), (1, Vec::new(), None));
        let _in = place.enter(DRONE);
        assert!(here().len() == 1 && here() != first);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut other = Place::new();
                let _in = other.enter(DRONE);
                assert_eq!(here().len(), 2, "each thread has its own");
            });
        });
        assert_eq!(here().len(), 1);
    }
}
