//! The errors of a scenario, each with its place.

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::fmt;
use std::ops::Range;

/// This number of errors is shown. The others are counted.
const SHOWN: usize = 50;

/// One error. Its text is `place: key: message`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issue {
    /// `file:line:column` (from 1, columns in characters), or `--set key=value`.
    pub place: String,
    /// The key's path, such as `obstacle.0.centre_m`; empty if the file cannot be read as TOML.
    pub key: String,
    /// What was found and what was expected.
    pub message: String,
    /// The bytes of the file that are wrong; `None` for an error in an override.
    pub span: Option<Range<usize>>,
}

impl fmt::Display for Issue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let key = if self.key.is_empty() { String::new() } else { format!("{}: ", self.key) };
        let line = format!("{}: {key}{}", self.place, self.message);
        // Control characters of a file must not reach the terminal.
        for c in line.chars() {
            match c {
                '\n' => f.write_str("; ")?,
                c if c.is_control() => write!(f, "{}", c.escape_default())?,
                c => write!(f, "{c}")?,
            }
        }
        Ok(())
    }
}

/// All errors of a scenario, in the order of the file, then of the overrides. Its text has one line per error. As a
/// [`Diagnostic`] it also shows the places in the file.
#[derive(Debug)]
pub struct ScenarioErrors {
    source: NamedSource<String>,
    issues: Vec<Issue>,
}

impl ScenarioErrors {
    /// `text` is the file, shown around the errors. Each control character is replaced by one of the same length in bytes.
    pub(crate) fn new(name: &str, text: &str, mut issues: Vec<Issue>) -> Self {
        let shown = text.chars().map(|c| match c {
            '\n' | '\t' => c,
            c if c.is_control() && c.len_utf8() == 1 => ' ',
            c if c.is_control() => '\u{a0}',
            c => c,
        });
        issues.sort_by_key(|issue| issue.span.as_ref().map_or(usize::MAX, |span| span.start));
        issues.dedup();
        Self { source: NamedSource::new(name, shown.collect()), issues }
    }

    /// Names places otherwise: `place` gives another text for a place, or `None`.
    #[must_use]
    pub fn with_places(mut self, place: impl Fn(&str) -> Option<String>) -> Self {
        for issue in &mut self.issues {
            if let Some(other) = place(&issue.place) {
                issue.place = other;
            }
        }
        self
    }

    /// The errors. There is at least one.
    #[must_use]
    pub fn issues(&self) -> &[Issue] {
        &self.issues
    }
}

impl fmt::Display for ScenarioErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, issue) in self.issues.iter().take(SHOWN).enumerate() {
            write!(f, "{}{issue}", if i > 0 { "\n" } else { "" })?;
        }
        match self.issues.len().saturating_sub(SHOWN) {
            0 => Ok(()),
            more => write!(f, "\n… and {more} more errors"),
        }
    }
}

impl std::error::Error for ScenarioErrors {}

impl Diagnostic for ScenarioErrors {
    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = |issue: &Issue| {
            let span = issue.span.clone()?;
            let text = if issue.key.is_empty() { "here".to_owned() } else { issue.key.escape_debug().to_string() };
            Some(LabeledSpan::at(span, text))
        };
        Some(Box::new(self.issues.iter().take(SHOWN).filter_map(label)))
    }
}

/// The starts of the lines of a text: finds the line of a byte fast, even for many errors in a long file.
pub(crate) struct Lines<'a> {
    text: &'a str,
    starts: Vec<usize>,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        let starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        Self { text, starts }
    }

    /// The line and the column of a byte of the text, from 1. Columns count characters.
    pub(crate) fn line_column(&self, byte: usize) -> (usize, usize) {
        let line = self.starts.partition_point(|&start| start <= byte);
        let start = self.starts.get(line.wrapping_sub(1)).copied().unwrap_or(0);
        (line, self.text.get(start..byte).map_or(0, |before| before.chars().count()) + 1)
    }
}
