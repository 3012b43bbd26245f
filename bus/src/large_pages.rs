//! Large pages for the heap of this process. A swarm of hundreds of drones in one process reads some of the memory of each drone in each tick.
//! With pages of 4 KiB, the processor has to look up where most of these reads lead to; with pages of 2 MiB, it knows.
#![allow(unsafe_code)]

use rustix::mm::{Advice, madvise};
use std::fs;
use std::ops::Range;

/// Size of a large page, bytes.
const LARGE_PAGE: usize = 2 << 20;

/// After this number of ticks, the heap is looked at again. Chosen by hand: a look takes less than a thousandth of the time of so many ticks
/// of a large swarm.
const TICKS: u64 = 256;

/// The heap of this process, whose pages become large.
#[derive(Debug, Default)]
pub struct LargePages {
    ticks: u64,
}

impl LargePages {
    /// Call once per tick. The heap grows most at the beginning of a mission, so this looks at it in ticks 1, 2, 4, 8 and so on, and later
    /// every so often. It does nothing where the kernel has no large pages: memory has the same contents either way.
    pub fn tick(&mut self) {
        self.ticks += 1;
        if self.ticks.is_power_of_two() || self.ticks.is_multiple_of(TICKS) {
            fs::read_to_string("/proc/self/maps").iter().flat_map(|maps| heap(maps)).for_each(enlarge);
        }
    }
}

/// The parts of the heap in a list of the mappings of a process, as `/proc/PID/maps` gives it.
fn heap(maps: &str) -> impl Iterator<Item = Range<usize>> {
    maps.lines().filter(|line| line.ends_with("[heap]")).filter_map(range)
}

/// The addresses of a mapping, by its line in such a list.
fn range(line: &str) -> Option<Range<usize>> {
    let (from, to) = line.split_whitespace().next()?.split_once('-')?;
    Some(usize::from_str_radix(from, 16).ok()?..usize::from_str_radix(to, 16).ok()?)
}

/// Makes the pages of this part of the heap large, and those that the kernel maps there later.
fn enlarge(part: Range<usize>) {
    let from = part.start.next_multiple_of(LARGE_PAGE);
    let Some(len) = (part.end / LARGE_PAGE * LARGE_PAGE).checked_sub(from).filter(|len| *len > 0) else { return };
    let start = std::ptr::with_exposed_provenance_mut(from);
    // A kernel that refuses the advice leaves all as it was.
    // SAFETY: the advice changes in which pages memory is kept, and not what it holds. So it may be in use.
    let _ = unsafe { madvise(start, len, Advice::LinuxHugepage) };
    // SAFETY: as above. Without this, the kernel takes minutes for memory that is in use.
    let _ = unsafe { libc::madvise(start, len, libc::MADV_COLLAPSE) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::mm::{MapFlags, ProtFlags, mmap_anonymous};

    #[test]
    fn the_parts_of_the_heap_are_found() {
        let maps = "5581aa000000-5581aa021000 rw-p 00000000 00:00 0                          [heap]\n\
                    5581aa021000-5581aa400000 rw-p 00000000 00:00 0                          [heap]\n\
                    7f0000000000-7f0000021000 rw-p 00000000 00:00 0 \n\
                    7ffd00000000-7ffd00021000 rw-p 00000000 00:00 0                          [stack]\n";
        let expected = [0x5581_aa00_0000..0x5581_aa02_1000, 0x5581_aa02_1000..0x5581_aa40_0000];
        assert_eq!(heap(maps).collect::<Vec<_>>(), expected);
    }

    /// Whether large pages are asked for at this address, as `/proc/self/smaps` tells.
    fn is_advised(address: usize) -> bool {
        let smaps = fs::read_to_string("/proc/self/smaps").unwrap();
        let mut own = smaps.lines().skip_while(|line| !range(line).is_some_and(|range| range.contains(&address)));
        own.find_map(|line| line.strip_prefix("VmFlags:")).unwrap().contains(" hg")
    }

    #[test]
    fn whole_large_pages_are_asked_for_and_memory_keeps_its_contents() {
        let len = 4 * LARGE_PAGE;
        // SAFETY: a new mapping at an address that the kernel chooses overlaps no other memory.
        let mapped =
            unsafe { mmap_anonymous(std::ptr::null_mut(), len, ProtFlags::READ | ProtFlags::WRITE, MapFlags::PRIVATE) };
        let start: *mut u8 = mapped.unwrap().cast();
        // SAFETY: the mapping is that long, and nothing else uses it.
        let bytes = unsafe { std::slice::from_raw_parts_mut(start, len) };
        bytes.iter_mut().zip(0_usize..).for_each(|(byte, place)| *byte = (place / 4096 % 251) as u8);
        // Neither end is at a large page.
        let (from, to) = (start.addr() + 4096, start.addr() + len - 4096);
        enlarge(from..to);
        assert!(bytes.iter().zip(0_usize..).all(|(byte, place)| *byte == (place / 4096 % 251) as u8));
        if fs::exists("/sys/kernel/mm/transparent_hugepage").unwrap() {
            let (first, last) = (from.next_multiple_of(LARGE_PAGE), to / LARGE_PAGE * LARGE_PAGE);
            assert_eq!([first - 1, first, last - 1, last].map(is_advised), [false, true, true, false]);
        }
        enlarge(from..from + 4096);
    }
}
