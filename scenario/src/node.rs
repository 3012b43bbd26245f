//! A scenario's text as a tree in which every value has its place. The file and its overrides are checked in the same
//! way, and their errors are reported in the same way.

use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::ops::Range;
use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where a value comes from.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    /// Bytes of the file.
    File(Range<usize>),
    /// The override with this number, from 0.
    Set(usize),
}

/// A value and its place.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub(crate) place: Place,
    pub(crate) data: Data,
}

/// A value, of TOML or of JSON.
#[derive(Clone, Debug)]
pub(crate) enum Data {
    Bool(bool),
    Integer(i128),
    Float(f64),
    Text(String),
    List(Vec<Node>),
    Table(BTreeMap<String, Entry>),
    /// A value that no key allows, in words.
    Other(&'static str),
}

/// The place of a key, and its value.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub(crate) key: Place,
    pub(crate) node: Node,
}

/// The most steps of an override's path. Readers of TOML and JSON refuse what is nested deeper than 80 and 128 levels, and the manifest of
/// a run holds this path with a value of TOML at its end.
const MAX_STEPS: usize = 32;

/// Why an override has no place in the scenario.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub(crate) enum OverrideError {
    /// The path has an empty step.
    #[error("expected a key's path such as time.dt_s, found {0:?}")]
    Path(String),
    /// The path has too many steps.
    #[error("expected a key's path of at most {MAX_STEPS} steps, found {0}")]
    Deep(usize),
    /// The index is no number, or it is behind the end of the list.
    #[error("found index {index:?}, expected a number up to {len}: {list} has {len} entries, and {len} adds one")]
    Index {
        /// The index that was found.
        index: String,
        /// The path of the list.
        list: String,
        /// The length of the list.
        len: usize,
    },
    /// The path goes on below a single value.
    #[error("{path} is a single value: expected no key or index {step:?} below it")]
    Value {
        /// The path of the value.
        path: String,
        /// The step below it.
        step: String,
    },
}

impl Node {
    /// Makes a tree from a parsed file. `place` turns a span into a place.
    pub(crate) fn from_table(table: &DeTable<'_>, place: &dyn Fn(Range<usize>) -> Place) -> Data {
        let entry = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
            let key: &Spanned<std::borrow::Cow<'_, str>> = key;
            (key.get_ref().to_string(), Entry { key: place(key.span()), node: Self::from_toml(value, place) })
        };
        Data::Table(table.iter().map(entry).collect())
    }

    /// Makes a node from a parsed value. `place` turns a span into a place.
    pub(crate) fn from_toml(value: &Spanned<DeValue<'_>>, place: &dyn Fn(Range<usize>) -> Place) -> Self {
        let data = match value.get_ref() {
            DeValue::String(text) => Data::Text(text.to_string()),
            DeValue::Boolean(flag) => Data::Bool(*flag),
            DeValue::Integer(digits) => i128::from_str_radix(digits.as_str(), digits.radix())
                .map_or(Data::Other("an integer of too many digits"), Data::Integer),
            DeValue::Float(digits) => {
                digits.as_str().parse().map_or(Data::Other("a number that cannot be read"), Data::Float)
            }
            DeValue::Datetime(_) => Data::Other("a date or time"),
            DeValue::Array(items) => Data::List(items.iter().map(|item| Self::from_toml(item, place)).collect()),
            DeValue::Table(table) => Self::from_table(table, place),
        };
        Self { place: place(value.span()), data }
    }

    /// Makes a tree from JSON, which has no places. Keys whose value is null are left out.
    pub(crate) fn from_json(value: &Json) -> Self {
        let data = match value {
            Json::Null => Data::Other("null"),
            Json::Bool(flag) => Data::Bool(*flag),
            Json::Number(number) => match (number.as_i128(), number.as_f64()) {
                (Some(integer), _) => Data::Integer(integer),
                (None, Some(float)) => Data::Float(float),
                (None, None) => Data::Other("a number that cannot be read"),
            },
            Json::String(text) => Data::Text(text.clone()),
            Json::Array(items) => Data::List(items.iter().map(Self::from_json).collect()),
            Json::Object(map) => {
                let entry = |(key, value): (&String, &Json)| {
                    (key.clone(), Entry { key: nowhere(), node: Self::from_json(value) })
                };
                Data::Table(map.iter().filter(|(_, value)| !value.is_null()).map(entry).collect())
            }
        };
        Self { place: nowhere(), data }
    }

    /// The node at this path, such as `obstacle.0.centre_m`, if it exists.
    pub(crate) fn find(&self, path: &str) -> Option<&Self> {
        path.split('.').try_fold(self, |node, step| match &node.data {
            Data::Table(entries) => entries.get(step).map(|entry| &entry.node),
            Data::List(items) => step.parse().ok().and_then(|i: usize| items.get(i)),
            _ => None,
        })
    }

    /// The deepest node on the way to this path.
    pub(crate) fn nearest(&self, path: &str) -> &Self {
        let mut end = path.len();
        loop {
            match (self.find(&path[..end]), path[..end].rfind('.')) {
                (Some(node), _) => return node,
                (None, Some(dot)) => end = dot,
                (None, None) => return self,
            }
        }
    }

    /// Puts the override with this number at `path` and makes the tables on the way. The value is TOML; a value that is not
    /// valid TOML is taken as a string.
    ///
    /// # Errors
    /// [`OverrideError`] if there is no place for the path.
    pub(crate) fn set(&mut self, path: &str, value: &str, number: usize) -> Result<(), OverrideError> {
        let place = |_| Place::Set(number);
        let new = DeValue::parse(value).map_or_else(
            |_| Self { place: Place::Set(number), data: Data::Text(value.to_owned()) },
            |parsed| Self::from_toml(&parsed, &place),
        );
        *self.make(path, number)? = new;
        Ok(())
    }

    /// The node at `path`. A node that is missing in a table, or is the next one of a list, is made.
    fn make(&mut self, path: &str, number: usize) -> Result<&mut Self, OverrideError> {
        let depth = path.split('.').count();
        if depth > MAX_STEPS {
            return Err(OverrideError::Deep(depth));
        }
        let mut node = self;
        let mut steps = path.split('.').peekable();
        let mut at = String::new();
        while let Some(step) = steps.next() {
            if step.is_empty() {
                return Err(OverrideError::Path(path.to_owned()));
            }
            let needs_list = steps.peek().is_some_and(|next| next.bytes().all(|b| b.is_ascii_digit()));
            node = match &mut node.data {
                Data::Table(entries) => {
                    let fresh = || Entry { key: Place::Set(number), node: Self::empty(number, needs_list) };
                    &mut entries.entry(step.to_owned()).or_insert_with(fresh).node
                }
                Data::List(items) => {
                    let (len, index) = (items.len(), step.parse::<usize>().ok());
                    if index == Some(len) {
                        items.push(Self::empty(number, needs_list));
                    }
                    let error = || OverrideError::Index { index: step.to_owned(), list: at.clone(), len };
                    index.and_then(|index| items.get_mut(index)).ok_or_else(error)?
                }
                _ => return Err(OverrideError::Value { path: at, step: step.to_owned() }),
            };
            at = if at.is_empty() { step.to_owned() } else { format!("{at}.{step}") };
        }
        Ok(node)
    }

    fn empty(number: usize, list: bool) -> Self {
        let data = if list { Data::List(Vec::new()) } else { Data::Table(BTreeMap::new()) };
        Self { place: Place::Set(number), data }
    }

    /// The value, for a message.
    pub(crate) fn found(&self) -> String {
        match &self.data {
            Data::Bool(flag) => flag.to_string(),
            Data::Integer(integer) => integer.to_string(),
            // With its point: a whole number may be what was expected.
            Data::Float(float) if float.fract() == 0.0 && float.abs() < 1e15 => format!("{float:.1}"),
            Data::Float(float) => number(*float),
            Data::Text(text) if text.chars().count() > 60 => {
                format!("{:?}…", text.chars().take(60).collect::<String>())
            }
            Data::Text(text) => format!("{text:?}"),
            Data::List(items) => format!("an array of {}", items.len()),
            Data::Table(_) => "a table".to_owned(),
            Data::Other(what) => (*what).to_owned(),
        }
    }
}

fn nowhere() -> Place {
    Place::File(0..0)
}

/// The shortest text of a number.
pub(crate) fn number(value: f64) -> String {
    if value != 0.0 && (value.abs() >= 1e15 || value.abs() < 1e-6) { format!("{value:e}") } else { format!("{value}") }
}
