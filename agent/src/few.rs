//! Lists of what is near a drone.

use smallvec::SmallVec;

/// Number of entries for which a [`Few`] has room on the stack.
pub(crate) const FEW: usize = 32;

/// A list that seldom has more than [`FEW`] entries. Its memory on the stack stays in the cache while one thread steps many drones in turn.
pub(crate) type Few<T> = SmallVec<[T; FEW]>;
