//! The Python module `skein`: pilots, missions and environments. The package in `python/skein` wraps what is here.
//!
//! A pilot in Python is an object with a method `step`. [`PyPilot`](pilot) makes a pilot of the runtime of it, and so a Python
//! pilot flies in both runtimes like one in Rust. [`swarm`] steps a swarm whose commands come from a batch of numbers.

mod app;
mod array;
mod birth;
mod inbox;
mod json;
mod lent;
mod motion;
mod out;
mod pilot;
mod senses;
mod swarm;

use pyo3::prelude::*;

/// The machinery of the package `skein`.
#[pymodule]
fn _skein(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<birth::PyBirth>()?;
    module.add_class::<senses::PySenses>()?;
    module.add_class::<senses::PyNeighbour>()?;
    module.add_class::<senses::PyObstacle>()?;
    module.add_class::<inbox::PyInbox>()?;
    module.add_class::<inbox::PyMessage>()?;
    module.add_class::<out::PyOut>()?;
    module.add_class::<motion::Acceleration>()?;
    module.add_class::<motion::Velocity>()?;
    module.add_class::<swarm::PySwarm>()?;
    module.add_function(wrap_pyfunction!(app::answer, module)?)?;
    module.add_function(wrap_pyfunction!(app::messages, module)?)?;
    Ok(())
}
