//! What a pilot says in a tick, in Python.

use crate::lent::{Lending, Lent};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyString};
use skein_pilot::Out;
use skein_protocol::{Message, MetricName, TopicName, UserMessage};

/// Takes what a pilot says in a tick.
#[pyclass(frozen, name = "Out", module = "skein")]
pub(crate) struct PyOut(Lent<Out>);

impl PyOut {
    pub(crate) fn new() -> Self {
        Self(Lent::new("out"))
    }

    /// Lends it to Python until the guard is dropped.
    pub(crate) fn lend<'l>(&'l self, out: &'l mut Out) -> Lending<'l, Out> {
        // SAFETY: the guard borrows it.
        unsafe { self.0.lend(out) }
    }

    fn with<R>(&self, work: impl FnOnce(&mut Out) -> R) -> PyResult<R> {
        // SAFETY: lent for the length of the step and used by this call alone: no `work` calls Python, and the interpreter's lock
        // is held.
        Ok(work(unsafe { self.0.get()?.as_mut() }))
    }
}

#[pymethods]
impl PyOut {
    /// Broadcasts bytes under a topic: 1 to 31 characters from a-z 0-9 _ - . /, and at most 272 bytes. `data` is bytes, a
    /// bytearray, a str (as UTF-8), or anything that gives its bytes, such as a numpy array.
    fn say(&self, topic: &str, data: &Bound<'_, PyAny>) -> PyResult<()> {
        let topic = TopicName::new(topic).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let said = with_bytes(data, |bytes| UserMessage::new(topic, bytes))?;
        let message = said.map_err(|error| PyValueError::new_err(error.to_string()))?;
        self.with(|out| out.message(Message::User(message)))
    }

    /// Reports a figure. It is recorded, and not sent to other drones. The name has 1 to 31 characters from a-z A-Z 0-9 _ - . /;
    /// a value that is not finite is not recorded. If one name comes twice in a tick, the last value counts.
    fn metric(&self, name: &str, value: f64) -> PyResult<()> {
        MetricName::new(name).map_err(|error| PyValueError::new_err(error.to_string()))?;
        self.with(|out| out.metric(name, value))
    }

    /// Shows a point until the next step: world frame, m.
    fn mark(&self, label: &str, point_m: [f64; 3]) -> PyResult<()> {
        self.with(|out| out.mark(label, point_m))
    }

    /// Shows a line until the next step: world frame, m.
    fn line(&self, label: &str, from_m: [f64; 3], to_m: [f64; 3]) -> PyResult<()> {
        self.with(|out| out.line(label, from_m, to_m))
    }

    /// Says whether the mission is done, as far as this drone is concerned. It holds for this tick. With
    /// `mission.end = "pilots"`, the mission ends once all living drones say so in the same tick.
    #[pyo3(signature = (done = true))]
    fn done(&self, done: bool) -> PyResult<()> {
        self.with(|out| out.done(done))
    }
}

/// Calls `read` with the bytes of a value.
fn with_bytes<R>(data: &Bound<'_, PyAny>, read: impl FnOnce(&[u8]) -> R) -> PyResult<R> {
    if let Ok(bytes) = data.cast::<PyBytes>() {
        return Ok(read(bytes.as_bytes()));
    }
    if let Ok(text) = data.cast::<PyString>() {
        return Ok(read(text.to_cow()?.as_bytes()));
    }
    if let Ok(bytes) = data.cast::<PyByteArray>() {
        return Ok(read(&bytes.to_vec()));
    }
    // A number would be taken as a length.
    let bytes = if data.hasattr("__int__")? && !data.hasattr("__len__")? {
        Err(PyTypeError::new_err(""))
    } else {
        data.py().get_type::<PyBytes>().call1((data,))
    };
    let kind = data.get_type();
    let bytes =
        bytes.map_err(|_| PyTypeError::new_err(format!("found {kind}, expected bytes such as struct.pack gives")))?;
    Ok(read(bytes.cast::<PyBytes>()?.as_bytes()))
}
