//! Values that many entries have in common, each kept once.

/// Distinct values, each with the number of entries that have it. They are few, so that a search looks at all of them. An entry keeps
/// the index of its value.
#[derive(Clone, Debug)]
pub(crate) struct SharedValues<T> {
    slots: Vec<Slot<T>>,
}

#[derive(Clone, Copy, Debug)]
struct Slot<T> {
    value: T,
    /// Number of entries that have it. A slot without any is free.
    uses: u32,
}

impl<T> Default for SharedValues<T> {
    fn default() -> Self {
        Self { slots: Vec::new() }
    }
}

impl<T: Copy + PartialEq> SharedValues<T> {
    /// The value at an index that [`Self::share`] returned and that was not released.
    #[inline]
    pub(crate) fn get(&self, index: u32) -> &T {
        &self.slots[index as usize].value
    }

    /// The index of a value, for one more entry.
    pub(crate) fn share(&mut self, value: &T) -> u32 {
        let found = self.slots.iter().position(|slot| slot.uses > 0 && slot.value == *value);
        let found = found.or_else(|| self.slots.iter().position(|slot| slot.uses == 0));
        let index = found.unwrap_or(self.slots.len());
        if index == self.slots.len() {
            self.slots.push(Slot { value: *value, uses: 0 });
        }
        let slot = &mut self.slots[index];
        (slot.value, slot.uses) = (*value, slot.uses + 1);
        index as u32
    }

    /// One entry less has the value at this index.
    pub(crate) fn release(&mut self, index: u32) {
        self.slots[index as usize].uses -= 1;
    }

    /// The index of a value for an entry that has had the value at `index`.
    #[inline]
    pub(crate) fn replace(&mut self, index: u32, value: &T) -> u32 {
        if self.get(index) == value {
            return index;
        }
        self.release(index);
        self.share(value)
    }

    /// The values that some entry has.
    pub(crate) fn used(&self) -> impl Iterator<Item = &T> {
        self.slots.iter().filter(|slot| slot.uses > 0).map(|slot| &slot.value)
    }

    /// All values, to be changed for all entries that have them.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.slots.iter_mut().map(|slot| &mut slot.value)
    }

    /// Removes all values.
    pub(crate) fn clear(&mut self) {
        self.slots.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_kept_once_and_its_place_is_used_again() {
        let mut values = SharedValues::default();
        let (a, b, c) = (values.share(&7), values.share(&8), values.share(&7));
        assert!(a == c && a != b);
        assert_eq!(values.replace(a, &7), a);
        let changed = values.replace(c, &9);
        assert_eq!((*values.get(a), *values.get(b), *values.get(changed)), (7, 8, 9));
        values.release(b);
        assert_eq!(values.used().collect::<Vec<_>>(), [&7, &9]);
        assert_eq!(values.share(&10), b, "nobody has 8 any more");
        assert_eq!(values.slots.len(), 3);
    }
}
