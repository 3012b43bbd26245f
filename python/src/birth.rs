//! What a pilot is made from, in Python.

use crate::json;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;
use skein_pilot::Birth;

/// What a pilot is made from. A restarted drone gets a new pilot that knows nothing but this.
#[pyclass(frozen, name = "Birth", module = "skein")]
pub(crate) struct PyBirth {
    birth: Birth,
    params: PyOnceLock<Py<PyDict>>,
    scenario: PyOnceLock<Py<PyAny>>,
}

impl PyBirth {
    pub(crate) fn new(birth: &Birth) -> Self {
        Self { birth: birth.clone(), params: PyOnceLock::new(), scenario: PyOnceLock::new() }
    }
}

#[pymethods]
impl PyBirth {
    /// Number of the drone, from 0.
    #[getter]
    fn drone(&self) -> u32 {
        self.birth.drone
    }

    /// Number of drones in the swarm.
    #[getter]
    fn drones(&self) -> u32 {
        self.birth.drones
    }

    /// Counts the starts of this drone, from 1. A restart makes it one more.
    #[getter]
    fn incarnation(&self) -> u32 {
        self.birth.incarnation
    }

    /// Simulated time of the pilot's first step, s.
    #[getter]
    fn start_s(&self) -> f64 {
        self.birth.start_s
    }

    /// Length of a tick, s.
    #[getter]
    fn dt_s(&self) -> f64 {
        self.birth.dt_s
    }

    /// Seed of the mission. A pilot that needs randomness derives it from this, its drone and its incarnation.
    #[getter]
    fn seed(&self) -> u64 {
        self.birth.seed
    }

    /// Name of the pilot.
    #[getter]
    fn pilot(&self) -> &str {
        &self.birth.pilot
    }

    /// The table `params` of the pilot in the scenario.
    #[getter]
    fn params(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        let read = || {
            let dict = PyDict::new(py);
            for key in self.birth.params.keys() {
                if let Some(found) = self.birth.params.get(key) {
                    dict.set_item(key, json::value(py, found)?)?;
                }
            }
            Ok::<_, PyErr>(dict.unbind())
        };
        Ok(self.params.get_or_try_init(py, read)?.clone_ref(py))
    }

    /// The whole scenario as resolved, with all defaults.
    #[getter]
    fn scenario(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.scenario.get_or_try_init(py, || json::value(py, &self.birth.scenario))?.clone_ref(py))
    }

    fn __repr__(&self) -> String {
        let Birth { drone, drones, incarnation, pilot, .. } = &self.birth;
        format!("Birth(drone={drone}, drones={drones}, incarnation={incarnation}, pilot={pilot:?})")
    }
}
