//! Memory that is needed soon. A swarm of hundreds of drones in one process does not fit into a cache, and reads that are begun together take
//! as long as one.
#![allow(unsafe_code, reason = "the processor's instruction takes an address")]

/// Bytes that a processor fetches at once.
const LINE: usize = 64;

/// Asks the processor to fetch this value into its cache, and does not wait for it. Without any other effect, and on processors other than
/// x86-64 without any.
#[inline]
pub fn prefetch<T: ?Sized>(value: &T) {
    let start = std::ptr::from_ref(value).cast::<i8>();
    let (len, align) = (size_of_val(value), align_of_val(value));
    let mut offset = 0;
    while offset < len {
        fetch_line(start, offset);
        offset += LINE;
    }
    // A value may begin within a line and end in the next one.
    if align < LINE && len > align {
        fetch_line(start, len - 1);
    }
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn fetch_line(start: *const i8, offset: usize) {
    use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
    // SAFETY: the instruction reads nothing and fails at no address.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(offset)) };
}

#[cfg(not(target_arch = "x86_64"))]
#[inline]
fn fetch_line(_start: *const i8, _offset: usize) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_any_size_stays_as_it_was() {
        let bytes: Vec<u8> = (0..=255).collect();
        for len in 0..256 {
            prefetch(&bytes[..len]);
        }
        prefetch(&bytes);
        assert!(bytes.iter().copied().eq(0..=255));
    }
}
