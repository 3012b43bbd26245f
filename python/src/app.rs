//! The application: the commands of Skein with pilots in Python.

use crate::pilot::{PyPilot, RUN_DIR};
use mcap::MessageStream;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use skein::{App, Pilot};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Does what the arguments say, such as `["run", "scenario.toml"]`, and returns the exit code. `program`: the words that start
/// this program in another process. `pilots`: names, and what makes a pilot of a birth. `topics`: names of topics, and their JSON
/// schemas as text.
#[pyfunction]
pub(crate) fn answer(
    py: Python<'_>,
    arguments: Vec<OsString>,
    program: Vec<OsString>,
    pilots: Vec<(String, Py<PyAny>)>,
    topics: Vec<(String, String)>,
) -> u8 {
    let add = |app: App, (name, class): (String, Py<PyAny>)| {
        app.try_pilot(&name, move |birth| {
            Python::attach(|py| PyPilot::new(py, &class, birth)).map(|pilot| Box::new(pilot) as Box<dyn Pilot>)
        })
    };
    let app = pilots.into_iter().fold(App::new().program(program).on_folder(tell_folder), add);
    let app = topics.iter().fold(app, |app, (topic, schema)| app.json_topic(topic, schema));
    py.detach(|| app.run(arguments))
}

/// A message in a recording: time, s, sender, topic, bytes.
type Said = (f64, u32, String, Py<PyBytes>);

/// What pilots said under topics of their own, in the recording of a run.
#[pyfunction]
pub(crate) fn messages(py: Python<'_>, folder: PathBuf) -> PyResult<Vec<Said>> {
    let path = folder.join("run.mcap");
    let bytes = std::fs::read(&path).map_err(|error| PyOSError::new_err(format!("{}: {error}", path.display())))?;
    let wrong = |error| PyValueError::new_err(format!("{}: {error}", path.display()));
    let mut said = Vec::new();
    for message in MessageStream::new(&bytes).map_err(wrong)? {
        let message = message.map_err(wrong)?;
        if let Some((source, topic, data)) = said_by_pilot(&message) {
            let data = PyBytes::new(py, data).unbind();
            said.push((message.log_time as f64 * 1e-9, source, topic.to_owned(), data));
        }
    }
    Ok(said)
}

/// Sender, topic and bytes of a message of a pilot; `None` for any other message.
fn said_by_pilot<'m>(message: &'m mcap::Message<'_>) -> Option<(u32, &'m str, &'m [u8])> {
    let topic = message.channel.topic.strip_prefix("/pilots/")?;
    if message.channel.schema.is_some() {
        // A topic with a schema has a channel for each drone.
        let (topic, source) = topic.rsplit_once('/')?;
        return Some((source.parse().ok()?, topic, &message.data));
    }
    // Four bytes of each other message are the number of its sender.
    let (source, data) = message.data.split_first_chunk()?;
    Some((u32::from_le_bytes(*source), topic, data))
}

/// Tells this process and its children where the run's folder is. Without it, tracebacks go to stderr.
fn tell_folder(folder: &Path) {
    Python::attach(|py| {
        let told = py.import("os").and_then(|os| os.getattr("environ")).and_then(|environment| {
            environment.set_item(RUN_DIR, std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned()).as_os_str())
        });
        drop(told);
    });
}
