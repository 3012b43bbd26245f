//! What a drone heard, in Python.

use crate::lent::{Lending, Lent};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};
use skein_pilot::Inbox;
use skein_protocol::{MessageRef, UserMessage};

/// The messages that a drone received since its step before, in the order of their arrival.
#[pyclass(frozen, name = "Inbox", module = "skein")]
pub(crate) struct PyInbox(Lent<Inbox<'static>>);

impl PyInbox {
    pub(crate) fn new() -> Self {
        Self(Lent::new("the inbox"))
    }

    /// Lends the inbox to Python until the guard is dropped.
    pub(crate) fn lend<'l>(&'l self, inbox: &'l Inbox<'_>) -> Lending<'l, Inbox<'static>> {
        // SAFETY: the guard borrows the inbox, which is only read. Its lifetime is the shortest of all in `read`.
        unsafe { self.0.lend(std::ptr::from_ref(inbox).cast_mut().cast()) }
    }

    /// The messages of pilots' own, as `choose` chooses them.
    fn read<'py>(&self, py: Python<'py>, choose: impl Fn(&UserMessage) -> bool) -> PyResult<Bound<'py, PyList>> {
        // SAFETY: lent for the length of the step, and nothing of it is kept: the bytes are copied.
        let inbox: &Inbox<'_> = unsafe { self.0.get()?.as_ref() };
        let list = PyList::empty(py);
        for heard in inbox.heard() {
            if let MessageRef::User(message) = heard.message
                && choose(message)
            {
                let topic = message.topic().as_str().to_owned();
                let data = PyBytes::new(py, message.bytes()).unbind();
                list.append(PyMessage { source: heard.source.0, topic, data })?;
            }
        }
        Ok(list)
    }
}

#[pymethods]
impl PyInbox {
    /// The messages of a topic.
    fn of<'py>(&self, py: Python<'py>, topic: &str) -> PyResult<Bound<'py, PyList>> {
        self.read(py, |message| message.topic().as_str() == topic)
    }

    /// The messages of all topics that pilots define.
    fn all<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.read(py, |_| true)
    }
}

/// A message received by radio.
#[pyclass(frozen, name = "Message", module = "skein")]
pub(crate) struct PyMessage {
    /// Number of the drone that sent it.
    #[pyo3(get)]
    source: u32,
    /// Its topic.
    #[pyo3(get)]
    topic: String,
    /// What it says.
    #[pyo3(get)]
    data: Py<PyBytes>,
}

#[pymethods]
impl PyMessage {
    fn __repr__(&self, py: Python<'_>) -> String {
        let bytes = self.data.bind(py).as_bytes().len();
        format!("Message(source={}, topic={:?}, {bytes} bytes)", self.source, self.topic)
    }
}
