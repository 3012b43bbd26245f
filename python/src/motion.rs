//! What a step returns in Python.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use skein_pilot::Command;

macro_rules! motion {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[pyclass(frozen, eq, skip_from_py_object, module = "skein")]
        #[derive(Clone, Copy, PartialEq)]
        pub(crate) struct $name {
            /// East.
            #[pyo3(get)]
            x: f64,
            /// North.
            #[pyo3(get)]
            y: f64,
            /// Up.
            #[pyo3(get)]
            z: f64,
        }

        #[pymethods]
        impl $name {
            #[new]
            #[pyo3(signature = (x, y, z = 0.0))]
            fn new(x: f64, y: f64, z: f64) -> Self {
                Self { x, y, z }
            }

            fn __repr__(&self) -> String {
                format!(concat!(stringify!($name), "({:?}, {:?}, {:?})"), self.x, self.y, self.z)
            }
        }
    };
}

motion! {
    /// Accelerate: world frame (x east, y north, z up), m/s². The drone does at most its greatest acceleration in this direction.
    Acceleration
}

motion! {
    /// Reach this velocity and keep it: world frame (x east, y north, z up), m/s. An inner loop of the runtime holds it: in each
    /// tick it accelerates by the difference to the sensed velocity times `guidance.velocity_gain_per_s`.
    Velocity
}

/// What a step has returned.
pub(crate) fn command(returned: &Bound<'_, PyAny>) -> PyResult<Command> {
    if let Ok(motion) = returned.cast::<Acceleration>() {
        let Acceleration { x, y, z } = *motion.get();
        return Ok(Command::acceleration([x, y, z]));
    }
    if let Ok(motion) = returned.cast::<Velocity>() {
        let Velocity { x, y, z } = *motion.get();
        return Ok(Command::velocity([x, y, z]));
    }
    let kind = returned.get_type();
    Err(PyTypeError::new_err(format!("step returned {kind}, expected skein.Acceleration or skein.Velocity")))
}
