//! Memory that a burst needed and later ticks do not.

/// Room for this many times the entries of the last tick is kept for the next one. No unit. 4. By hand.
const MOST_UNUSED: usize = 4;

/// Gives back what a tick with many entries needed. `empty`: what the next tick writes to. `count`: number of entries of the last tick.
/// `least`: room for four times this many is kept in any case.
pub(crate) fn give_back<T>(empty: &mut Vec<T>, count: usize, least: usize) {
    if empty.capacity() > MOST_UNUSED * count.max(least) {
        empty.shrink_to(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_a_burst_is_given_back_and_that_of_usual_ticks_is_kept() {
        let room = |capacity, count| {
            let mut empty: Vec<u8> = Vec::with_capacity(capacity);
            give_back(&mut empty, count, 10);
            empty.capacity()
        };
        assert_eq!(room(1000, 300), 1000);
        assert_eq!(room(1000, 100), 100);
        assert_eq!(room(40, 0), 40);
        assert_eq!(room(41, 0), 0);
    }
}
