//! A part of the report, from which both Markdown and HTML are made.

use crate::figures::Figure;

/// A part of the report.
pub(crate) enum Block {
    /// Heading of a section.
    Heading(String),
    /// The list of all headings.
    Contents,
    /// A paragraph. Code stands between backticks.
    Text(String),
    /// A table.
    Table {
        /// Headings of the columns.
        head: Vec<String>,
        /// Lines of cells, each as long as the head.
        lines: Vec<Vec<String>>,
    },
    /// A drawing.
    Figure(Figure),
}
