//! From text to a checked scenario.

use crate::broken_rule::BrokenRule;
use crate::check::{Complaint, check};
use crate::error::{Issue, Lines, ScenarioErrors};
use crate::keys::Scenario;
use crate::name::is_name_char;
use crate::node::{Data, Node, Place};
use crate::radio;
use crate::reference::schema;
use crate::rules;
use std::ops::Range;
use toml::de::DeTable;

/// The name of a scenario's text, for messages and for the scenario's default name.
#[derive(Clone, Copy, Debug)]
pub struct ScenarioSource<'a> {
    /// The path of the file, for messages.
    pub name: &'a str,
    /// The file's name without its ending. It is the scenario's name if the text has no key `name`. Characters that are
    /// not allowed in a name become `-`.
    pub stem: &'a str,
}

/// See [`Scenario::parse`].
pub(crate) fn parse(
    text: &str,
    source: ScenarioSource<'_>,
    overrides: &[(String, String)],
) -> Result<Scenario, ScenarioErrors> {
    let text_of = Text::new(text, source, overrides);
    let (table, errors) = DeTable::parse_recoverable(text);
    if !errors.is_empty() {
        let issue = |error: &toml::de::Error| {
            let place = Place::File(error.span().unwrap_or(0..0));
            text_of.issue(&place, "", &format!("TOML syntax: {}", error.message()))
        };
        return Err(text_of.errors(errors.iter().map(issue).collect()));
    }
    let data = Node::from_table(table.get_ref(), &Place::File);
    let mut root = Node { place: Place::File(0..0), data };
    let mut issues = Vec::new();
    for (number, (path, value)) in overrides.iter().enumerate() {
        if let Err(error) = root.set(path, value, number) {
            issues.push(text_of.issue(&Place::Set(number), path, &error.to_string()));
        }
    }
    text_of.finish(&root, issues)
}

/// See [`Scenario::parse_bytes`].
pub(crate) fn parse_bytes(
    bytes: &[u8],
    source: ScenarioSource<'_>,
    overrides: &[(String, String)],
) -> Result<Scenario, ScenarioErrors> {
    let error = match std::str::from_utf8(bytes) {
        Ok(text) => return parse(text, source, overrides),
        Err(error) => error,
    };
    let text = String::from_utf8_lossy(bytes);
    let at = error.valid_up_to();
    let found = bytes.get(at).copied().unwrap_or_default();
    let message = format!("found byte 0x{found:02x}, expected UTF-8 text");
    let text_of = Text::new(&text, source, overrides);
    Err(text_of.errors(vec![text_of.issue(&Place::File(at..at), "", &message)]))
}

/// See [`Scenario::from_json`].
pub(crate) fn from_json(json: &serde_json::Value, source: ScenarioSource<'_>) -> Result<Scenario, ScenarioErrors> {
    Text::new("", source, &[]).finish(&Node::from_json(json), Vec::new())
}

/// See [`Scenario::blame`].
pub(crate) fn blame(
    text: &str,
    source: ScenarioSource<'_>,
    overrides: &[(String, String)],
    keys: &[String],
    message: &str,
) -> ScenarioErrors {
    let text_of = Text::new(text, source, overrides);
    let (table, _) = DeTable::parse_recoverable(text);
    let mut root = Node { place: Place::File(0..0), data: Node::from_table(table.get_ref(), &Place::File) };
    for (number, (path, value)) in overrides.iter().enumerate() {
        // The same override was good before.
        let _ = root.set(path, value, number);
    }
    let broken = BrokenRule { keys: keys.to_vec(), message: message.to_owned() };
    text_of.errors(vec![text_of.blame(&root, &broken)])
}

/// The text, and what is needed to give the place of an error in it.
struct Text<'a> {
    text: &'a str,
    lines: Lines<'a>,
    source: ScenarioSource<'a>,
    overrides: &'a [(String, String)],
}

impl<'a> Text<'a> {
    fn new(text: &'a str, source: ScenarioSource<'a>, overrides: &'a [(String, String)]) -> Self {
        Self { text, lines: Lines::new(text), source, overrides }
    }

    fn finish(&self, root: &Node, mut issues: Vec<Issue>) -> Result<Scenario, ScenarioErrors> {
        let (mut json, complaints) = check(root, &schema());
        issues.extend(complaints.iter().map(|c: &Complaint| self.issue(&c.place, &c.key, &c.message)));
        if !issues.is_empty() {
            return Err(self.errors(issues));
        }
        radio::fill_preset(&mut json);
        let mut scenario: Scenario = serde_json::from_value(json)
            .map_err(|error| self.errors(vec![self.issue(&root.place, "", &error.to_string())]))?;
        issues.extend(self.resolve(root, &mut scenario));
        if issues.is_empty() {
            issues.extend(rules::broken(&scenario).iter().map(|broken| self.blame(root, broken)));
        }
        if issues.is_empty() { Ok(scenario) } else { Err(self.errors(issues)) }
    }

    /// Fills in what follows from other keys: the name, and with `offsets_m` the number of drones and no shape.
    fn resolve(&self, root: &Node, scenario: &mut Scenario) -> Vec<Issue> {
        if root.find("name").is_none() {
            scenario.name = name_of(self.source.stem);
        }
        let mut issues = Vec::new();
        let formation = &mut scenario.formation;
        let Some(offsets) = formation.offsets_m.as_ref().map(Vec::len) else { return issues };
        match root.find("formation.shape") {
            None => formation.shape = None,
            Some(node) => {
                issues.push(self.issue(
                    &node.place,
                    "formation.shape",
                    "found both this key and offsets_m, expected one of them",
                ));
            }
        }
        match root.find("formation.drones") {
            Some(node) if formation.drones as usize != offsets => {
                let message = format!("found {}, expected {offsets}: the number of offsets_m", formation.drones);
                issues.push(self.issue(&node.place, "formation.drones", &message));
            }
            // The schema limits the number of offsets to far less than a u32 holds.
            _ => formation.drones = u32::try_from(offsets).unwrap_or(u32::MAX),
        }
        issues
    }

    /// Blames a broken rule on the first override among its keys, or else on the first key that the file writes.
    fn blame(&self, root: &Node, broken: &BrokenRule) -> Issue {
        let written: Vec<&Node> = broken.keys.iter().filter_map(|key| root.find(key)).collect();
        let set = written.iter().find(|node| has_override(node));
        let node = match (set, written.first(), broken.keys.first()) {
            (Some(node), _, _) | (None, Some(node), _) => *node,
            (None, None, Some(key)) => root.nearest(key),
            (None, None, None) => root,
        };
        let place = overridden(node).unwrap_or(&node.place);
        self.issue(place, broken.keys.first().map_or("", String::as_str), &broken.message)
    }

    fn issue(&self, place: &Place, key: &str, message: &str) -> Issue {
        let (place, span) = match place {
            Place::Set(number) => {
                let (path, value) = &self.overrides[*number];
                (format!("--set {path}={value}"), None)
            }
            Place::File(span) => {
                let span = self.clamp(span);
                let (line, column) = self.lines.line_column(span.start);
                (format!("{}:{line}:{column}", self.source.name), Some(span))
            }
        };
        Issue { place, key: key.to_owned(), message: message.to_owned(), span }
    }

    fn clamp(&self, span: &Range<usize>) -> Range<usize> {
        let end = self.text.len();
        span.start.min(end)..span.end.min(end)
    }

    fn errors(&self, issues: Vec<Issue>) -> ScenarioErrors {
        ScenarioErrors::new(self.source.name, self.text, issues)
    }
}

fn has_override(node: &Node) -> bool {
    overridden(node).is_some()
}

/// The place of the first override in this node.
fn overridden(node: &Node) -> Option<&Place> {
    match (&node.place, &node.data) {
        (place @ Place::Set(_), _) => Some(place),
        (_, Data::List(items)) => items.iter().find_map(overridden),
        (_, Data::Table(entries)) => entries.values().find_map(|entry| overridden(&entry.node)),
        _ => None,
    }
}

/// A scenario's name, made from the name of its file without the ending.
fn name_of(stem: &str) -> String {
    let name: String = stem.chars().take(64).map(|c| if is_name_char(c) { c } else { '-' }).collect();
    let name = name.trim_start_matches(['.', '-']);
    if name.is_empty() { "scenario".to_owned() } else { name.to_owned() }
}
