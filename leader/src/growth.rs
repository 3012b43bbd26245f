//! Vectors that leave little memory unused: a drone of a large swarm has dozens of them.

/// A vector grows by room for this part of its entries. No unit. 16. By hand.
const GROWTH: usize = 16;

/// Makes room for one more entry, and for few others. By itself a vector would double its room.
pub(crate) fn make_room<T>(entries: &mut Vec<T>) {
    if entries.len() == entries.capacity() {
        entries.reserve_exact(entries.len() / GROWTH + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn little_room_is_unused_and_a_vector_rarely_grows() {
        let (mut entries, mut growths) = (Vec::new(), 0);
        for entry in 0..1000 {
            let before = entries.capacity();
            make_room(&mut entries);
            growths += usize::from(entries.capacity() > before);
            entries.push(entry);
            assert!(entries.capacity() <= entries.len() + entries.len() / GROWTH + 1);
        }
        assert!(growths < 100, "{growths}");
    }
}
