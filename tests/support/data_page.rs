//! Reads the tables of docs/data.md.

use std::path::{Path, PathBuf};

/// Where the page is.
pub(crate) fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("docs/data.md")
}

/// The rows of the table under a heading, without backticks. Its head is left out.
pub(crate) fn rows(heading: &str) -> Vec<Vec<String>> {
    let page = std::fs::read_to_string(path()).unwrap();
    let section = page.split("\n#").find(|section| section.lines().next().unwrap().trim_matches(['#', ' ']) == heading);
    let section = section.unwrap_or_else(|| panic!("docs/data.md has no heading {heading}"));
    let lines = section.lines().filter(|line| line.starts_with('|')).skip(2);
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().replace('`', "")).collect();
    lines.map(cells).collect()
}

/// The names in the first column of the table under a heading.
pub(crate) fn documented(heading: &str) -> Vec<String> {
    rows(heading).into_iter().map(|mut row| row.swap_remove(0)).collect()
}
