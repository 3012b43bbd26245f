//! A numpy array that Rust writes.

use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

/// A type of number that numpy knows.
///
/// # Safety
/// [`Number::DTYPE`] must have this type's size and layout, and all bytes must be valid.
pub(crate) unsafe trait Number: Copy {
    /// Its name in numpy.
    const DTYPE: &'static str;
}

// SAFETY: the names are those of numpy.
unsafe impl Number for f32 {
    const DTYPE: &'static str = "float32";
}

// SAFETY: the names are those of numpy.
unsafe impl Number for f64 {
    const DTYPE: &'static str = "float64";
}

// SAFETY: numpy's bool is one byte of 0 or 1. Any other byte counts as true.
unsafe impl Number for u8 {
    const DTYPE: &'static str = "bool";
}

/// A numpy array of fixed size, whose numbers Rust and Python share. Python sees each change at once.
pub(crate) struct Array<T> {
    object: Py<PyAny>,
    numbers: *mut T,
    len: usize,
}

// SAFETY: numpy's memory belongs to the object, not to a thread, and it is used with the interpreter's lock held.
unsafe impl<T: Number> Send for Array<T> {}

impl<T: Number> Array<T> {
    /// An array of zeros.
    pub(crate) fn zeros(py: Python<'_>, shape: &[usize]) -> PyResult<Self> {
        let options: Bound<'_, PyDict> = [("dtype", T::DTYPE)].into_py_dict(py)?;
        let object = py.import("numpy")?.call_method("zeros", (shape.to_vec(),), Some(&options))?;
        let interface = object.getattr("__array_interface__")?;
        let (address, _): (usize, bool) = interface.get_item("data")?.extract()?;
        Ok(Self { object: object.unbind(), numbers: address as *mut T, len: shape.iter().product() })
    }

    /// The array, for Python.
    pub(crate) fn object(&self, py: Python<'_>) -> Py<PyAny> {
        self.object.clone_ref(py)
    }

    /// The numbers, row by row.
    pub(crate) fn numbers(&mut self) -> &mut [T] {
        if self.len == 0 {
            return &mut [];
        }
        // SAFETY: numpy allocated so many numbers there, zeroed and aligned, in C order. They live as long as `object`, which numpy
        // does not resize while there is another reference to it.
        unsafe { std::slice::from_raw_parts_mut(self.numbers, self.len) }
    }
}
