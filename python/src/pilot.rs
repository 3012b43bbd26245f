//! A pilot in Python, as the runtime flies it.

use crate::birth::PyBirth;
use crate::inbox::PyInbox;
use crate::motion;
use crate::out::PyOut;
use crate::senses::PySenses;
use pyo3::prelude::*;
use pyo3::types::PyString;
use skein_pilot::{Birth, Command, Inbox, Out, Pilot, PilotError, Senses};
use std::fmt::Write as _;
use std::path::PathBuf;

/// The variable of the environment in which a run's processes find its folder.
pub(crate) const RUN_DIR: &str = "SKEIN_RUN_DIR";

/// A pilot in Python, and what it is shown in each step.
pub(crate) struct PyPilot {
    drone: u32,
    /// The method `step` of the object.
    step: Py<PyAny>,
    senses: Py<PySenses>,
    inbox: Py<PyInbox>,
    out: Py<PyOut>,
}

impl PyPilot {
    /// Calls a class, or any function that makes a pilot, with a birth.
    ///
    /// # Errors
    /// The exception that it raised, in words.
    pub(crate) fn new(py: Python<'_>, class: &Py<PyAny>, birth: &Birth) -> Result<Self, PilotError> {
        let make = || {
            let object = class.bind(py).call1((PyBirth::new(birth),))?;
            Ok(Self {
                drone: birth.drone,
                step: object.getattr("step")?.unbind(),
                senses: Py::new(py, PySenses::new())?,
                inbox: Py::new(py, PyInbox::new())?,
                out: Py::new(py, PyOut::new())?,
            })
        };
        make().map_err(|error| refused(py, birth.drone, &error))
    }

    fn call(&self, py: Python<'_>, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> PyResult<Command> {
        let _senses = self.senses.get().lend(senses);
        let _inbox = self.inbox.get().lend(inbox);
        let _out = self.out.get().lend(out);
        motion::command(&self.step.bind(py).call1((&self.senses, &self.inbox, &self.out))?)
    }
}

impl Pilot for PyPilot {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        Python::attach(|py| match self.call(py, senses, inbox, out) {
            Ok(command) => command,
            Err(error) => {
                keep_traceback(py, self.drone, &error);
                out.fail(in_words(py, &error));
                Command::default()
            }
        })
    }
}

/// An exception of a constructor. One with a `key`, such as `skein.ParamError`, blames that parameter.
fn refused(py: Python<'_>, drone: u32, error: &PyErr) -> PilotError {
    let value = error.value(py);
    let text = |name| value.getattr(name).and_then(|found| found.extract::<String>()).ok();
    match (text("key"), text("problem")) {
        (Some(key), Some(problem)) => PilotError::of_param(key, problem),
        _ => {
            keep_traceback(py, drone, error);
            PilotError::new(in_words(py, error))
        }
    }
}

/// An exception in one line: its type, its message, and the place of the innermost frame in the traceback.
fn in_words(py: Python<'_>, error: &PyErr) -> String {
    let kind = error.get_type(py).name().map_or_else(|_| "exception".to_owned(), |name| name.to_string());
    let message = error.value(py).str().map(|text| text.to_string()).unwrap_or_default();
    let mut words = if message.is_empty() { kind } else { format!("{kind}: {message}") };
    if let Some((file, line)) = place(py, error) {
        let file = file.rsplit('/').next().unwrap_or_default();
        // Writing to a string does not fail.
        let _ = write!(words, " ({file}, line {line})");
    }
    words
}

fn place(py: Python<'_>, error: &PyErr) -> Option<(String, u64)> {
    let mut innermost = error.traceback(py)?.into_any();
    while let Ok(next) = innermost.getattr("tb_next")
        && !next.is_none()
    {
        innermost = next;
    }
    let line = innermost.getattr("tb_lineno").ok()?.extract().ok()?;
    let code = innermost.getattr("tb_frame").ok()?.getattr("f_code").ok()?;
    Some((code.getattr("co_filename").ok()?.extract().ok()?, line))
}

/// Appends the traceback to `failures/drone-N.txt` in the run's folder; without one, prints it to stderr.
fn keep_traceback(py: Python<'_>, drone: u32, error: &PyErr) {
    let formatted = || -> PyResult<String> {
        let lines = py
            .import("traceback")?
            .call_method1("format_exception", (error.get_type(py), error.value(py), error.traceback(py)))?;
        PyString::new(py, "").call_method1("join", (lines,))?.extract()
    };
    let text = formatted().unwrap_or_else(|_| in_words(py, error) + "\n");
    let Some(folder) = std::env::var_os(RUN_DIR) else {
        eprint!("drone {drone}: {text}");
        return;
    };
    let folder = PathBuf::from(folder).join("failures");
    let path = folder.join(format!("drone-{drone}.txt"));
    let write = || {
        std::fs::create_dir_all(&folder)?;
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(&path)?;
        std::io::Write::write_all(&mut file, text.as_bytes())
    };
    if let Err(problem) = write() {
        eprint!("{}: {problem}\ndrone {drone}: {text}", path.display());
    }
}
