//! What a drone senses, in Python.

use crate::lent::{Lending, Lent};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyList, PyTuple};
use skein_pilot::Senses;

/// What a drone senses in a tick, and when. World frame: x east, y north, z up.
#[pyclass(frozen, name = "Senses", module = "skein")]
pub(crate) struct PySenses(Lent<Senses<'static>>);

impl PySenses {
    pub(crate) fn new() -> Self {
        Self(Lent::new("the senses"))
    }

    /// Lends the senses to Python until the guard is dropped.
    pub(crate) fn lend<'l>(&'l self, senses: &'l Senses<'_>) -> Lending<'l, Senses<'static>> {
        // SAFETY: the guard borrows the senses, which are only read. Their lifetime is the shortest of all in `with`.
        unsafe { self.0.lend(std::ptr::from_ref(senses).cast_mut().cast()) }
    }

    fn with<R>(&self, read: impl for<'a> FnOnce(&'a Senses<'a>) -> R) -> PyResult<R> {
        // SAFETY: lent for the length of the step. `read` can keep nothing of it.
        Ok(read(unsafe { self.0.get()?.as_ref() }))
    }
}

#[pymethods]
impl PySenses {
    /// Simulated time at which the tick begins, s.
    #[getter]
    fn now_s(&self) -> PyResult<f64> {
        self.with(|senses| senses.now_s)
    }

    /// Number of the tick.
    #[getter]
    fn tick(&self) -> PyResult<u64> {
        self.with(|senses| senses.tick)
    }

    /// The drone's position as its sensors report it, m.
    #[getter]
    fn position_m(&self) -> PyResult<(f64, f64, f64)> {
        self.with(|senses| senses.position_m.into())
    }

    /// The drone's velocity as its sensors report it, m/s.
    #[getter]
    fn velocity_mps(&self) -> PyResult<(f64, f64, f64)> {
        self.with(|senses| senses.velocity_mps.into())
    }

    /// Time that faults add to the drone's reaction time, s.
    #[getter]
    fn extra_reaction_s(&self) -> PyResult<f64> {
        self.with(|senses| senses.extra_reaction_s)
    }

    /// The drones within ranging distance.
    #[getter]
    fn neighbours<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.with(|senses| {
            let neighbours = senses.neighbours.iter().map(|sensed| PyNeighbour {
                drone: sensed.drone.0,
                position_m: sensed.position_m,
                velocity_mps: sensed.velocity_mps,
            });
            list(py, neighbours)
        })?
    }

    /// The obstacles that are at least partly in detection range.
    #[getter]
    fn obstacles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.with(|senses| {
            let obstacles = senses.obstacles.iter().map(|sensed| {
                let shape = senses.shape(sensed);
                PyObstacle {
                    obstacle: shape.map_or(u32::MAX, |sensed| sensed.id.0),
                    nearest_m: sensed.nearest_m,
                    distance_m: sensed.distance_m,
                    outline_m: shape.map_or_else(Vec::new, |sensed| {
                        sensed.shape.vertices().map(|point| (point.x, point.y)).collect()
                    }),
                    radius_m: shape.map_or(0.0, |sensed| sensed.shape.radius_m),
                    floor_m: shape.map_or(f64::NEG_INFINITY, |sensed| sensed.shape.floor_m),
                    top_m: shape.map_or(f64::INFINITY, |sensed| sensed.shape.top_m),
                }
            });
            list(py, obstacles)
        })?
    }

    /// The neighbours as a numpy array with the fields `position_m`, `velocity_mps` and `drone`, for arithmetic over all of them.
    /// It may be kept after the step.
    fn neighbours_array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        static DTYPE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let numpy = py.import("numpy")?;
        let make = || {
            let fields = PyList::new(py, [("position_m", "<f8", 3), ("velocity_mps", "<f8", 3)])?;
            fields.append(("drone", "<u4"))?;
            fields.append(("reserved", "<u4"))?;
            Ok::<_, PyErr>(numpy.getattr("dtype")?.call1((fields,))?.unbind())
        };
        let dtype = DTYPE.get_or_try_init(py, make)?;
        let bytes = self.with(|senses| PyBytes::new(py, bytemuck::cast_slice(senses.neighbours)))?;
        numpy.getattr("frombuffer")?.call1((bytes, dtype))
    }

    fn __repr__(&self) -> PyResult<String> {
        self.with(|senses| {
            let Senses { now_s, position_m, velocity_mps, neighbours, obstacles, .. } = senses;
            let (near, around) = (neighbours.len(), obstacles.len());
            format!(
                "Senses(now_s={now_s}, position_m={position_m:?}, velocity_mps={velocity_mps:?}, {near} neighbours, \
                 {around} obstacles)"
            )
        })
    }
}

fn list<'py, T>(py: Python<'py>, entries: impl Iterator<Item = T>) -> PyResult<Bound<'py, PyList>>
where
    T: pyo3::PyClass + Into<pyo3::PyClassInitializer<T>>,
{
    let list = PyList::empty(py);
    for entry in entries {
        list.append(Bound::new(py, entry)?)?;
    }
    Ok(list)
}

/// Another drone within ranging distance.
#[pyclass(frozen, name = "Neighbour", module = "skein")]
pub(crate) struct PyNeighbour {
    /// Its number.
    #[pyo3(get)]
    drone: u32,
    position_m: [f64; 3],
    velocity_mps: [f64; 3],
}

#[pymethods]
impl PyNeighbour {
    /// Its position relative to the sensing drone, m.
    #[getter]
    fn position_m(&self) -> (f64, f64, f64) {
        self.position_m.into()
    }

    /// Its velocity relative to the sensing drone, m/s.
    #[getter]
    fn velocity_mps(&self) -> (f64, f64, f64) {
        self.velocity_mps.into()
    }

    fn __repr__(&self) -> String {
        let Self { drone, position_m, velocity_mps } = self;
        format!("Neighbour(drone={drone}, position_m={position_m:?}, velocity_mps={velocity_mps:?})")
    }
}

/// An obstacle that is at least partly in detection range.
#[pyclass(frozen, name = "Obstacle", module = "skein")]
pub(crate) struct PyObstacle {
    /// Its number.
    #[pyo3(get)]
    obstacle: u32,
    nearest_m: [f64; 3],
    /// Distance from the drone to the nearest point, m; negative if the drone is inside the obstacle.
    #[pyo3(get)]
    distance_m: f64,
    outline_m: Vec<(f64, f64)>,
    /// How far the obstacle reaches beyond its outline, m: the radius of a circle, whose outline is its centre.
    #[pyo3(get)]
    radius_m: f64,
    /// Altitude of its lower face, m; minus infinity if it has none.
    #[pyo3(get)]
    floor_m: f64,
    /// Altitude of its upper face, m; infinity if it has none.
    #[pyo3(get)]
    top_m: f64,
}

#[pymethods]
impl PyObstacle {
    /// Point of its surface that is nearest to the drone, world frame, m.
    #[getter]
    fn nearest_m(&self) -> (f64, f64, f64) {
        self.nearest_m.into()
    }

    /// The corners of its outline seen from above, counterclockwise, world frame, m; the centre of a circle.
    #[getter]
    fn outline_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.outline_m)
    }

    fn __repr__(&self) -> String {
        let Self { obstacle, nearest_m, distance_m, floor_m, top_m, .. } = self;
        format!(
            "Obstacle(obstacle={obstacle}, nearest_m={nearest_m:?}, distance_m={distance_m}, floor_m={floor_m}, \
             top_m={top_m})"
        )
    }
}
