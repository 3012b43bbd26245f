//! Values of a scenario as Python objects.

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::{Map, Value};

/// A value as None, bool, int, float, str, list or dict.
pub(crate) fn value(py: Python<'_>, value: &Value) -> PyResult<Py<PyAny>> {
    match value {
        Value::Null => Ok(py.None()),
        Value::Bool(truth) => truth.into_py_any(py),
        Value::Number(number) => match (number.as_i64(), number.as_u64()) {
            (Some(whole), _) => whole.into_py_any(py),
            (None, Some(whole)) => whole.into_py_any(py),
            (None, None) => number.as_f64().unwrap_or(f64::NAN).into_py_any(py),
        },
        Value::String(text) => text.into_py_any(py),
        Value::Array(values) => {
            let list = PyList::empty(py);
            for entry in values {
                list.append(self::value(py, entry)?)?;
            }
            Ok(list.into_any().unbind())
        }
        Value::Object(map) => Ok(table(py, map)?.into_any()),
    }
}

/// A table as a dict.
pub(crate) fn table(py: Python<'_>, map: &Map<String, Value>) -> PyResult<Py<PyDict>> {
    let dict = PyDict::new(py);
    for (key, entry) in map {
        dict.set_item(key, value(py, entry)?)?;
    }
    Ok(dict.unbind())
}
