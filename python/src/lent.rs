//! A value that is lent to Python for the length of a call.

use pyo3::PyResult;
use pyo3::exceptions::PyRuntimeError;
use std::ptr;
use std::sync::atomic::{AtomicPtr, Ordering};

/// Holds a value of the caller's for the length of a call. Whoever keeps the holder for longer gets an exception instead of the
/// value. All access happens with the interpreter's lock held.
pub(crate) struct Lent<T> {
    value: AtomicPtr<T>,
    name: &'static str,
}

impl<T> Lent<T> {
    /// A holder of nothing. `name` names it in exceptions.
    pub(crate) fn new(name: &'static str) -> Self {
        Self { value: AtomicPtr::new(ptr::null_mut()), name }
    }

    /// Holds the value until the guard is dropped.
    ///
    /// # Safety
    /// The value must live, and not be used by anyone else, until the guard is dropped.
    pub(crate) unsafe fn lend(&self, value: *mut T) -> Lending<'_, T> {
        self.value.store(value, Ordering::Relaxed);
        Lending(self)
    }

    /// The value.
    ///
    /// # Errors
    /// RuntimeError after the call.
    pub(crate) fn get(&self) -> PyResult<ptr::NonNull<T>> {
        let value = ptr::NonNull::new(self.value.load(Ordering::Relaxed));
        value.ok_or_else(|| PyRuntimeError::new_err(format!("{} can be used during its step only", self.name)))
    }
}

/// Ends the lending when it is dropped.
pub(crate) struct Lending<'l, T>(&'l Lent<T>);

impl<T> Drop for Lending<'_, T> {
    fn drop(&mut self) {
        self.0.value.store(ptr::null_mut(), Ordering::Relaxed);
    }
}
