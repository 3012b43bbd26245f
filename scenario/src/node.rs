//! A scenario's text as a tree in which every value knows its place, so that the file and its overrides are checked,
//! and blamed, alike.

use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where a value comes from.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    /// Bytes of the file.
    File(Range<usize>),
    /// The override of this number.
    Set(usize),
}

/// A value and its place.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub place: Place,
    pub data: Data,
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
    /// What no key takes, described.
    Other(&'static str),
}

/// A key's place and its value.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: Place,
    pub node: Node,
}

impl Node {
    /// From a parsed file; `place` makes a place of a span.
    pub fn from_table(table: &DeTable<'_>, place: &dyn Fn(Range<usize>) -> Place) -> Data {
        let entry = |(key, value): (&Spanned<_>, &Spanned<DeValue<'_>>)| {
            let key: &Spanned<std::borrow::Cow<'_, str>> = key;
            (key.get_ref().to_string(), Entry { key: place(key.span()), node: Self::from_toml(value, place) })
        };
        Data::Table(table.iter().map(entry).collect())
    }

    /// From a parsed value; `place` makes a place of a span.
    pub fn from_toml(value: &Spanned<DeValue<'_>>, place: &dyn Fn(Range<usize>) -> Place) -> Self {
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

    /// From JSON, which has no places; keys with null are left out.
    pub fn from_json(value: &Json) -> Self {
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

    /// The node at this path, such as `obstacle.0.centre_m`, if it is there.
    pub fn find(&self, path: &str) -> Option<&Self> {
        path.split('.').try_fold(self, |node, step| match &node.data {
            Data::Table(entries) => entries.get(step).map(|entry| &entry.node),
            Data::List(items) => step.parse().ok().and_then(|i: usize| items.get(i)),
            _ => None,
        })
    }

    /// The deepest node on the way to this path.
    pub fn nearest(&self, path: &str) -> &Self {
        let mut end = path.len();
        loop {
            match (self.find(&path[..end]), path[..end].rfind('.')) {
                (Some(node), _) => return node,
                (None, Some(dot)) => end = dot,
                (None, None) => return self,
            }
        }
    }

    /// Puts override `number` at `path`, making tables on the way; the value is TOML, or else a string.
    pub fn set(&mut self, path: &str, value: &str, number: usize) -> Result<(), String> {
        let place = |_| Place::Set(number);
        let new = DeValue::parse(value).map_or_else(
            |_| Self { place: Place::Set(number), data: Data::Text(value.to_owned()) },
            |parsed| Self::from_toml(&parsed, &place),
        );
        *self.make(path, number)? = new;
        Ok(())
    }

    /// The node at `path`, made if it is missing in a table.
    fn make(&mut self, path: &str, number: usize) -> Result<&mut Self, String> {
        let mut node = self;
        let mut steps = path.split('.').peekable();
        let mut at = String::new();
        while let Some(step) = steps.next() {
            if step.is_empty() {
                return Err(format!("expected a key's path such as time.dt_s, found {path:?}"));
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
                    index.and_then(|index| items.get_mut(index)).ok_or_else(|| {
                        format!(
                            "found index {step:?}, expected {len} at most: {at} has {len} entries, one more is made"
                        )
                    })?
                }
                _ => return Err(format!("{at} is one value: expected no key or index {step:?} below it")),
            };
            at = if at.is_empty() { step.to_owned() } else { format!("{at}.{step}") };
        }
        Ok(node)
    }

    fn empty(number: usize, list: bool) -> Self {
        let data = if list { Data::List(Vec::new()) } else { Data::Table(BTreeMap::new()) };
        Self { place: Place::Set(number), data }
    }

    /// The value as it is shown in a message.
    pub fn found(&self) -> String {
        match &self.data {
            Data::Bool(flag) => flag.to_string(),
            Data::Integer(integer) => integer.to_string(),
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

/// A number as short as can be.
pub(crate) fn number(value: f64) -> String {
    if value != 0.0 && (value.abs() >= 1e15 || value.abs() < 1e-6) { format!("{value:e}") } else { format!("{value}") }
}
