//! Checks a tree of values against the generated schema: keys, types, words and ranges. Each error has its place.

use crate::faults::FaultTarget;
use crate::node::{Data, Entry, Node, Place};
use crate::reference;
use crate::schema_tree::{is_free, kind, lengths, present, range, tag, unit, words};
use crate::strategy::Strategy;
use crate::suggestion::did_you_mean;
use serde_json::{Map, Value as Json};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// An error whose place is not a text yet.
#[derive(Debug)]
pub(crate) struct Complaint {
    pub(crate) place: Place,
    pub(crate) key: String,
    pub(crate) message: String,
}

/// Checks the tree. Gives it back as JSON, without the keys that were left out, and all errors.
pub(crate) fn check(root: &Node, schema: &Json) -> (Json, Vec<Complaint>) {
    let mut walk = Walk { schema, homes: OnceCell::new(), complaints: Vec::new() };
    let json = walk.value(root, schema, "");
    (json, walk.complaints)
}

struct Walk<'a> {
    /// The schema of the whole scenario.
    schema: &'a Json,
    /// Every key's own name, with the tables that have it, in words.
    homes: OnceCell<BTreeMap<String, String>>,
    complaints: Vec<Complaint>,
}

impl Walk<'_> {
    fn complain(&mut self, place: &Place, key: &str, message: String) -> Json {
        self.complaints.push(Complaint { place: place.clone(), key: key.to_owned(), message });
        Json::Null
    }

    fn wrong(&mut self, node: &Node, key: &str, expected: &str) -> Json {
        self.complain(&node.place, key, format!("found {}, expected {expected}", node.found()))
    }

    fn value(&mut self, node: &Node, schema: &Json, key: &str) -> Json {
        let schema = present(schema);
        if schema["format"] == "sides" {
            return self.sides(node, &schema["anyOf"][1], key);
        }
        if let Some(words) = words(schema) {
            return self.word(node, &words, key);
        }
        if let Some(variants) = schema["oneOf"].as_array() {
            return self.variant(node, variants, key);
        }
        match kind(schema) {
            "object" if is_free(schema) => self.free(node, key),
            "object" => self.table(node, schema, key),
            "array" => self.list(node, schema, key),
            "integer" => self.integer(node, schema, key),
            "number" => self.number(node, schema, key),
            "boolean" => match node.data {
                Data::Bool(flag) => flag.into(),
                _ => self.wrong(node, key, "true or false"),
            },
            _ if schema["format"] == "strategy" => self.strategy(node, key),
            _ if schema["format"] == "fault-target" => self.target(node, key),
            _ => match &node.data {
                Data::Text(text) => text.clone().into(),
                _ => self.wrong(node, key, "a string"),
            },
        }
    }

    fn word(&mut self, node: &Node, words: &[&str], key: &str) -> Json {
        let list = words.iter().map(|w| format!("{w:?}")).collect::<Vec<_>>().join(", ");
        match &node.data {
            Data::Text(text) if words.contains(&text.as_str()) => text.clone().into(),
            Data::Text(text) => {
                let hint = did_you_mean(text, words.iter().copied());
                self.wrong(node, key, &format!("one of {list}{hint}"))
            }
            _ => self.wrong(node, key, &format!("one of {list}")),
        }
    }

    fn strategy(&mut self, node: &Node, key: &str) -> Json {
        let Data::Text(text) = &node.data else { return self.wrong(node, key, "a strategy's name") };
        match text.parse::<Strategy>() {
            Ok(strategy) => strategy.to_string().into(),
            Err(error) => {
                let hint = did_you_mean(text, Strategy::WORDS.iter().map(|(word, _)| *word));
                self.complain(&node.place, key, format!("{error}{hint}"))
            }
        }
    }

    fn target(&mut self, node: &Node, key: &str) -> Json {
        let text = if let Data::Text(text) = &node.data { text.clone() } else { node.found() };
        match text.parse::<FaultTarget>() {
            Ok(target) => target.to_string().into(),
            Err(error) => self.complain(&node.place, key, error.to_string()),
        }
    }

    /// The word `halves`, or lists of drones.
    fn sides(&mut self, node: &Node, lists: &Json, key: &str) -> Json {
        match &node.data {
            Data::List(_) => self.list(node, lists, key),
            Data::Text(text) if text == "halves" => text.clone().into(),
            _ => self.wrong(node, key, &format!("\"halves\" or an array {}", lengths(lists))),
        }
    }

    fn integer(&mut self, node: &Node, schema: &Json, key: &str) -> Json {
        let expected = || format!("a whole number {}", range(schema));
        let Data::Integer(integer) = node.data else { return self.wrong(node, key, &expected()) };
        let limit = |name: &str| schema[name].as_number().and_then(serde_json::Number::as_i128);
        let above = limit("minimum").is_none_or(|min| integer >= min);
        let below = limit("maximum").is_none_or(|max| integer <= max);
        match u64::try_from(integer) {
            Ok(value) if above && below => value.into(),
            _ => self.wrong(node, key, &expected()),
        }
    }

    fn number(&mut self, node: &Node, schema: &Json, key: &str) -> Json {
        let value = match node.data {
            Data::Integer(integer) => integer as f64,
            Data::Float(float) => float,
            _ => f64::NAN,
        };
        let limit = |name: &str| schema[name].as_f64();
        let inside = limit("minimum").is_none_or(|min| value >= min)
            && limit("exclusiveMinimum").is_none_or(|min| value > min)
            && limit("maximum").is_none_or(|max| value <= max);
        if value.is_finite() && inside {
            return value.into();
        }
        let unit = unit(key).map(|unit| format!(" ({unit})")).unwrap_or_default();
        self.wrong(node, key, &format!("a number {}{unit}", range(schema)))
    }

    fn list(&mut self, node: &Node, schema: &Json, key: &str) -> Json {
        let Data::List(items) = &node.data else {
            return self.wrong(node, key, &format!("an array {}", lengths(schema)));
        };
        let length = items.len() as u64;
        let fits = schema["minItems"].as_u64().is_none_or(|min| length >= min)
            && schema["maxItems"].as_u64().is_none_or(|max| length <= max);
        if !fits {
            return self.wrong(node, key, &format!("an array {}", lengths(schema)));
        }
        let items = items.iter().enumerate();
        items.map(|(i, item)| self.value(item, &schema["items"], &join(key, &i.to_string()))).collect()
    }

    /// One of several tables. A key that all of them have, each with another word, says which.
    fn variant(&mut self, node: &Node, variants: &[Json], key: &str) -> Json {
        let Data::Table(entries) = &node.data else { return self.wrong(node, key, "a table") };
        let Some((key_of_word, _)) = variants.first().and_then(tag) else { return Json::Null };
        let words: Vec<&str> = variants.iter().filter_map(tag).map(|(_, word)| word).collect();
        let Some(entry) = entries.get(key_of_word) else {
            let list = words.iter().map(|w| format!("{w:?}")).collect::<Vec<_>>().join(", ");
            return self.complain(&node.place, &join(key, key_of_word), format!("is missing: expected one of {list}"));
        };
        let word = self.word(&entry.node, &words, &join(key, key_of_word));
        let chosen = variants.iter().find(|v| tag(v).is_some_and(|(_, w)| word == w));
        chosen.map_or(Json::Null, |schema| self.table(node, schema, key))
    }

    fn table(&mut self, node: &Node, schema: &Json, key: &str) -> Json {
        let Data::Table(entries) = &node.data else { return self.wrong(node, key, "a table") };
        let empty = Map::new();
        let properties = schema["properties"].as_object().unwrap_or(&empty);
        for name in entries.keys().filter(|name| !properties.contains_key(*name)) {
            self.unknown(name, &entries[name], properties, key);
        }
        for name in schema["required"].as_array().into_iter().flatten().filter_map(Json::as_str) {
            if !entries.contains_key(name) {
                let what = if kind(&properties[name]) == "object" { "table" } else { "key" };
                let message = format!("is missing: this {what} is required");
                self.complain(&node.place, &join(key, name), message);
            }
        }
        let known = properties.iter().filter_map(|(name, schema)| Some((name, schema, entries.get(name)?)));
        known.map(|(name, schema, entry)| (name.clone(), self.value(&entry.node, schema, &join(key, name)))).collect()
    }

    /// A table that may hold any keys.
    fn free(&mut self, node: &Node, key: &str) -> Json {
        match &node.data {
            Data::Table(_) => self.any(node, key),
            _ => self.wrong(node, key, "a table"),
        }
    }

    /// Any value that JSON can hold.
    fn any(&mut self, node: &Node, key: &str) -> Json {
        let number = |float: f64| serde_json::Number::from_f64(float).map(Json::Number);
        match &node.data {
            Data::Bool(flag) => (*flag).into(),
            Data::Text(text) => text.clone().into(),
            Data::Integer(integer) => match i64::try_from(*integer) {
                Ok(integer) => integer.into(),
                Err(_) => self.wrong(node, key, "a whole number of 64 bits"),
            },
            Data::Float(float) => number(*float).unwrap_or_else(|| self.wrong(node, key, "a number that is finite")),
            Data::List(items) => {
                let items = items.iter().enumerate();
                items.map(|(i, item)| self.any(item, &join(key, &i.to_string()))).collect()
            }
            Data::Table(entries) => {
                let any = |(name, entry): (&String, &Entry)| (name.clone(), self.any(&entry.node, &join(key, name)));
                entries.iter().map(any).collect()
            }
            Data::Other(_) => self.wrong(node, key, "a number, a text, true, false, an array or a table"),
        }
    }

    fn unknown(&mut self, name: &str, entry: &Entry, properties: &Map<String, Json>, table: &str) {
        let hint = match self.homes.get_or_init(|| reference::homes(self.schema)).get(name) {
            Some(home) => format!("; it belongs {home}"),
            None => did_you_mean(name, properties.keys().map(String::as_str)),
        };
        let known = properties.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        let message = format!("unknown {}, expected one of {known}{hint}", what(&entry.node));
        self.complain(&entry.key, &join(table, name), message);
    }
}

fn what(node: &Node) -> &'static str {
    match node.data {
        Data::Table(_) => "table",
        _ => "key",
    }
}

fn join(key: &str, name: &str) -> String {
    if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") }
}
