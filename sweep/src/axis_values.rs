//! The values of a key of the grid, as the experiment file writes them.

use crate::error::Problem;
use crate::item_problem::ItemProblem;
use crate::limits::MAX_VALUES;

/// The values of one key, not written out yet: a range of three numbers may stand for a million of them.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AxisValues<'a> {
    /// `{ from, to, steps }`.
    Range(&'a toml::Table),
    /// A list.
    List(&'a [toml::Value]),
    /// One value.
    One(&'a toml::Value),
}

impl AxisValues<'_> {
    /// Number of values; at least 1.
    pub(crate) fn count(self) -> u64 {
        let count = match self {
            Self::Range(range) => range.get("steps").and_then(toml::Value::as_integer).unwrap_or(0).unsigned_abs(),
            Self::List(values) => values.len() as u64,
            Self::One(_) => 1,
        };
        count.max(1)
    }

    /// The values as TOML. `key`: path of the key.
    pub(crate) fn written(self, key: &str) -> Result<Vec<String>, ItemProblem> {
        match self {
            Self::Range(range) => steps(range).ok_or_else(|| Problem::Range(key.to_owned()).into()),
            Self::List([]) => {
                Err(Problem::EmptyList { key: format!("grid: {key}"), expected: "at least one value" }.into())
            }
            Self::List(values) => {
                let values: Vec<String> = values.iter().map(ToString::to_string).collect();
                ItemProblem::unless_unique(&format!("grid: {key}"), &values)?;
                Ok(values)
            }
            Self::One(value) => Ok(vec![value.to_string()]),
        }
    }
}

/// The values of `{ from, to, steps }`: evenly spaced, both ends included. `None` if the range is incomplete.
fn steps(range: &toml::Table) -> Option<Vec<String>> {
    let number = |name: &str| {
        let value = range.get(name)?;
        value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64)).filter(|v| v.is_finite())
    };
    let (from, to) = (number("from")?, number("to")?);
    let count = range.get("steps")?.as_integer()?;
    let complete = range.len() == 3 && (2..=MAX_VALUES as i64).contains(&count) && from != to;
    // Rounded at the twelfth digit: 0.3, not 0.30000000000000004.
    let at = |i: i64| from + (to - from) * i as f64 / (count - 1) as f64;
    complete.then(|| (0..count).map(|i| ((at(i) * 1e12).round() / 1e12).to_string()).collect())
}
