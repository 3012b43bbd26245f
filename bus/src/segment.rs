//! Memory that several processes map, and typed views of its parts.
#![allow(unsafe_code)]

use crate::error::BusError;
use rustix::fs::{MemfdFlags, fstat, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::fs::{File, OpenOptions};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd, RawFd};
use std::path::PathBuf;
use std::ptr::NonNull;
use std::sync::Arc;

/// A mapping of a memfd, unmapped when dropped.
#[derive(Debug)]
pub(crate) struct Segment {
    base: NonNull<u8>,
    len: usize,
}

// SAFETY: the mapping does not depend on the thread that made it and stays until drop. `Segment` itself reads and writes
// nothing in it; code that uses a pointer into it states why that is sound.
unsafe impl Send for Segment {}
// SAFETY: as for `Send`; a shared `Segment` hands out pointers only.
unsafe impl Sync for Segment {}

impl Segment {
    /// Makes a memfd of `len` zero bytes and maps it. Children can inherit the descriptor.
    ///
    /// # Errors
    /// [`BusError::System`].
    pub(crate) fn create(name: &str, len: usize) -> Result<(Self, OwnedFd), BusError> {
        let memfd = memfd_create(name, MemfdFlags::empty()).map_err(BusError::system("make a shared segment"))?;
        ftruncate(&memfd, len as u64).map_err(BusError::system("size a shared segment"))?;
        let segment = Self::map(memfd.as_fd(), len)?;
        Ok((segment, memfd))
    }

    /// Maps the first `len` bytes of a memfd that is at least that long.
    ///
    /// # Errors
    /// [`BusError::System`], [`BusError::Control`].
    pub(crate) fn map(fd: BorrowedFd<'_>, len: usize) -> Result<Self, BusError> {
        // SAFETY: a new mapping at an address that the kernel chooses overlaps no other memory.
        let base =
            unsafe { mmap(std::ptr::null_mut(), len, ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED, fd, 0) };
        let base = base.map_err(BusError::system("map a shared segment"))?;
        let base = NonNull::new(base.cast()).ok_or_else(|| BusError::Control("was mapped at address 0".to_owned()))?;
        Ok(Self { base, len })
    }

    /// The array of `count` values at byte `start`.
    ///
    /// # Panics
    /// If the array is not within the segment or not aligned: a mistake in the layout.
    pub(crate) fn array<T>(self: &Arc<Self>, start: usize, count: usize) -> SharedArray<T> {
        let fits = count.checked_mul(size_of::<T>()).and_then(|bytes| bytes.checked_add(start));
        assert!(
            fits.is_some_and(|end| end <= self.len),
            "{count} values at byte {start} are not in {} bytes",
            self.len
        );
        // SAFETY: `start` is at most `len`, so that the pointer stays within the mapping or one past its end.
        let first = unsafe { self.base.byte_add(start) }.cast::<T>();
        assert!(first.is_aligned(), "byte {start} is not aligned for the values there");
        SharedArray { first, count, _segment: Arc::clone(self) }
    }
}

impl Drop for Segment {
    fn drop(&mut self) {
        // SAFETY: `map` made this mapping with this length. Every `SharedArray` keeps the segment alive, so that no pointer
        // into it is left. The call can fail only for an address or length that is not a mapping's; so its result is ignored.
        let _ = unsafe { munmap(self.base.as_ptr().cast(), self.len) };
    }
}

/// Opens an inherited descriptor by its number; the file and its size in bytes.
///
/// # Errors
/// [`BusError::Io`] if there is no such descriptor, [`BusError::System`].
pub(crate) fn open_inherited(fd: RawFd) -> Result<(File, usize), BusError> {
    let path = PathBuf::from(format!("/proc/self/fd/{fd}"));
    let file = OpenOptions::new().read(true).write(true).open(&path).map_err(BusError::io("open", &path))?;
    let size = fstat(&file).map_err(BusError::system("look at a shared segment"))?.st_size as usize;
    Ok((file, size))
}

/// A type that other processes may write while this one holds a reference to it.
///
/// # Safety
/// The type consists of atomics, or of structs of them, that are valid for all bit patterns and are changed only
/// atomically while processes share them.
pub(crate) unsafe trait Atomics {}

// SAFETY: an atomic.
unsafe impl Atomics for std::sync::atomic::AtomicU64 {}

/// An array in a [`Segment`], which it keeps mapped.
#[derive(Debug)]
pub(crate) struct SharedArray<T> {
    first: NonNull<T>,
    count: usize,
    _segment: Arc<Segment>,
}

// SAFETY: the pointer is into the mapping that `_segment` keeps, which any thread may use. References are given to
// `Atomics` only; code that uses other pointers states why that is sound.
unsafe impl<T> Send for SharedArray<T> {}
// SAFETY: as for `Send`.
unsafe impl<T> Sync for SharedArray<T> {}

impl<T> SharedArray<T> {
    /// Number of values.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Pointer to value `index`: aligned, and valid as long as the array is.
    ///
    /// # Panics
    /// If `index` is out of range.
    #[inline]
    pub(crate) fn pointer(&self, index: usize) -> NonNull<T> {
        assert!(index < self.count, "number {index} is not below {}", self.count);
        // SAFETY: `Segment::array` checked that `count` values from `first` on are within the mapping.
        unsafe { self.first.add(index) }
    }

    /// Value `index`.
    ///
    /// # Panics
    /// If `index` is out of range.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> &T
    where
        T: Atomics,
    {
        // SAFETY: the pointer is aligned and into the mapping, which `self` keeps; by `Atomics`, every bit pattern is a
        // value, and other processes change it only atomically.
        unsafe { self.pointer(index).as_ref() }
    }
}
