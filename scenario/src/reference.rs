//! The JSON schema, and the key reference made from it.

use crate::keys::Scenario;
use crate::node::number;
use crate::schema_tree::{is_free, kind, present, range, tag, unit, words};
use serde_json::Value as Json;
use std::collections::BTreeMap;
// Writing to a string cannot fail, so its result is dropped below.
use std::fmt::Write as _;

/// The description of one key of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KeyDoc {
    /// Its path, such as `time.dt_s`. A key of an obstacle has the shape in its path: `obstacle.rectangle.centre_m`.
    pub path: String,
    /// Its unit, from the ending of its name; empty without a unit.
    pub unit: &'static str,
    /// The values it allows.
    pub range: String,
    /// Its default; `required` if it must be written.
    pub default: String,
    /// What it means.
    pub meaning: String,
}

impl KeyDoc {
    /// The key's own name.
    pub(crate) fn leaf(&self) -> &str {
        self.path.rsplit('.').next().unwrap_or_default()
    }
}

/// Where each key's own name belongs, in words: `in `[drone]``, or `at the top level of the file`.
pub(crate) fn homes(schema: &Json) -> BTreeMap<String, String> {
    let mut homes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for key in keys_of(schema) {
        let home = match key.path.rsplit_once('.') {
            Some((table, _)) => format!("in {}", titled(schema, table).0),
            None => "at the top level of the file".to_owned(),
        };
        homes.entry(key.leaf().to_owned()).or_default().push(home);
    }
    homes.into_iter().map(|(name, homes)| (name, homes.join(" or "))).collect()
}

/// The JSON schema of a scenario (draft 2020-12), made from the types of [`Scenario`].
#[must_use]
pub fn schema() -> Json {
    let settings = schemars::generate::SchemaSettings::draft2020_12().with(|s| s.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<Scenario>().into()
}

/// Every key of a scenario, in the order of its tables.
#[must_use]
pub fn keys() -> Vec<KeyDoc> {
    keys_of(&schema())
}

pub(crate) fn keys_of(schema: &Json) -> Vec<KeyDoc> {
    let mut keys = Vec::new();
    collect(schema, "", &mut keys);
    keys
}

fn collect(table: &Json, path: &str, keys: &mut Vec<KeyDoc>) {
    let properties = table["properties"].as_object().into_iter().flatten();
    for (name, schema) in properties {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        let variants = schema["items"]["oneOf"].as_array().into_iter().flatten();
        let before = keys.len();
        for (variant, word) in variants.filter_map(|v| Some((v, tag(v)?.1))) {
            collect(variant, &format!("{path}.{word}"), keys);
        }
        let here = present(schema);
        match kind(here) {
            _ if keys.len() > before => {}
            "object" if is_free(here) => keys.push(key(path, schema, is_required(table, name))),
            "object" => collect(here, &path, keys),
            "array" if kind(&here["items"]) == "object" => collect(&here["items"], &path, keys),
            _ => keys.push(key(path, schema, is_required(table, name))),
        }
    }
}

fn is_required(table: &Json, name: &str) -> bool {
    table["required"].as_array().is_some_and(|required| required.iter().any(|r| r == name))
}

fn key(path: String, schema: &Json, required: bool) -> KeyDoc {
    let default = match &schema["default"] {
        _ if required => "required".to_owned(),
        Json::Null => "absent".to_owned(),
        Json::String(text) if text.is_empty() => "the file's name".to_owned(),
        Json::Number(n) => n.as_f64().map(number).unwrap_or_default(),
        other => other.to_string(),
    };
    let mut meaning = if schema["const"].is_string() { "The shape of the obstacle.".to_owned() } else { text(schema) };
    for word in present(schema)["oneOf"].as_array().into_iter().flatten() {
        let _ = write!(meaning, " {}: {}", word["const"], text(word));
    }
    KeyDoc { unit: unit(&path).unwrap_or_default(), range: values(schema), default, meaning, path }
}

/// The values that a key allows, in words.
fn values(schema: &Json) -> String {
    let schema = present(schema);
    if let Some(words) = words(schema) {
        return words.iter().map(|w| format!("`\"{w}\"`")).collect::<Vec<_>>().join(", ");
    }
    if schema["format"] == "sides" {
        return format!("`\"halves\"`, or {}", array_values(&schema["anyOf"][1]));
    }
    if let Some(word) = schema["const"].as_str() {
        return format!("`\"{word}\"`");
    }
    match kind(schema) {
        "boolean" => "`true`, `false`".to_owned(),
        "integer" | "number" => range(schema),
        "array" => array_values(schema),
        "object" => "any table".to_owned(),
        _ => "a string".to_owned(),
    }
}

fn array_values(schema: &Json) -> String {
    let (min, max) = (&schema["minItems"], &schema["maxItems"]);
    let count = if min == max { min.to_string() } else { format!("{min} to {max}") };
    let items = present(&schema["items"]);
    match kind(items) {
        "array" => format!("{count} × [{}]", array_values(items)),
        "integer" => format!("{count} whole numbers {}", range(items)),
        _ if words(items).is_some() => format!("{count} of {}", values(items)),
        "string" => format!("{count} strings"),
        _ => format!("{count} numbers {}", range(items)),
    }
}

/// The key reference as Markdown, for `docs/scenario.md`.
#[must_use]
pub fn markdown() -> String {
    let schema = schema();
    let mut page = String::from(HEAD);
    let mut table = None;
    for key in keys_of(&schema) {
        let here = key.path.rsplit_once('.').map_or("", |(table, _)| table).to_owned();
        if table.as_ref() != Some(&here) {
            heading(&mut page, &schema, &here);
            table = Some(here);
        }
        let KeyDoc { unit, range, default, meaning, .. } = &key;
        let _ = writeln!(page, "| `{}` | {unit} | {range} | {default} | {meaning} |", key.leaf());
    }
    page
}

const HEAD: &str = "# Scenario files

This page is generated from the types of the crate `scenario`. A test keeps it up to date. `skein schema scenario` prints
the same as a JSON schema. `skein check FILE` checks a file without flying it.

A scenario is a TOML file. Quantities are in SI units, angles in radians. In the world frame, x is east and
y is north; a mission flies along +x unless its goal lies elsewhere (`mission.goal_m`). Only the table `[formation]` is required, and it may be empty.

Any key can be set on the command line: `--set radio.delay_s=0.2`, `--set obstacle.0.centre_m=[150,20]`. The value is
TOML; a value that is not valid TOML is taken as a string.
";

fn heading(page: &mut String, schema: &Json, table: &str) {
    let (title, about) = if table.is_empty() { ("Top level".to_owned(), String::new()) } else { titled(schema, table) };
    let about = if about.is_empty() { about } else { format!("{about}\n\n") };
    let _ = write!(page, "\n## {title}\n\n{about}| key | unit | values | default | meaning |\n|---|---|---|---|---|\n");
}

/// The heading of a table and its description: `[time]`, `[[radio.rule]]`, `[[obstacle]]` with its shape.
fn titled(schema: &Json, table: &str) -> (String, String) {
    let (mut at, mut about, mut name) = (schema, String::new(), Vec::new());
    for step in table.split('.') {
        let variants = at["items"]["oneOf"].as_array().into_iter().flatten();
        if let Some((variant, (key, word))) = variants.filter_map(|v| Some((v, tag(v)?))).find(|(_, (_, w))| *w == step)
        {
            return (format!("`[[{}]]` with {key} = \"{word}\"", name.join(".")), text(variant));
        }
        let inner = if kind(at) == "array" { &at["items"] } else { at };
        about = text(&inner["properties"][step]);
        at = present(&inner["properties"][step]);
        name.push(step);
    }
    let name = name.join(".");
    (if kind(at) == "array" { format!("`[[{name}]]`") } else { format!("`[{name}]`") }, about)
}

fn text(schema: &Json) -> String {
    schema["description"].as_str().unwrap_or_default().replace('\n', " ")
}
