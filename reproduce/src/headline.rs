//! The result in one table: the paper's numbers, ours, the difference, and whether they agree.

use crate::block::Block;
use crate::row::Row;
use crate::table::{difference, shown};

/// What an agreement means.
#[derive(Clone, Copy)]
enum Claim {
    /// Our value is the published one, or at most [`CLOSE`] from it.
    Equal,
    /// Our value is at least the published one.
    AtLeast,
    /// Our value is at most the published one.
    AtMost,
}
use Claim::{AtLeast, AtMost, Equal};

/// Largest relative difference of values that agree.
const CLOSE: f64 = 0.05;

/// The published quantities that carry the paper's argument, in its order. S2 is the geometry closest to the published numbers.
const ROWS: [(&str, Claim); 16] = [
    ("R1.S2.time", Equal),
    ("R1.S2.split", Equal),
    ("R2.S2.split", Equal),
    ("R3.S2.time", Equal),
    ("R3.S2.split", Equal),
    ("R4.S2.congestion-aware-paper", Equal),
    ("R4.S2.shortest-path", Equal),
    ("R4.S2.ratio.total", Equal),
    ("R5.detection.1", Equal),
    ("R5.peak", Equal),
    ("R5.disturbance", Equal),
    ("R5.detection.2", Equal),
    ("R5.groups", Equal),
    ("R5.reformation", Equal),
    ("R5.separation", AtLeast),
    ("R6", AtMost),
];

/// The rows of the result that exist, each with its verdict.
fn chosen(rows: &[Row]) -> impl Iterator<Item = (&Row, &'static str)> {
    ROWS.iter().filter_map(|(id, claim)| {
        let row = rows.iter().find(|row| row.id == *id)?;
        Some((row, verdict(row, *claim)))
    })
}

fn verdict(row: &Row, claim: Claim) -> &'static str {
    let agrees = match (row.published.as_f64(), row.ours.as_f64(), claim) {
        _ if row.ours.is_null() => return "not measured",
        (Some(published), Some(ours), Equal) => (ours - published).abs() <= CLOSE * published.abs(),
        (Some(published), Some(ours), AtLeast) => ours >= published,
        (Some(published), Some(ours), AtMost) => ours <= published,
        _ => row.published == row.ours,
    };
    if agrees { "agrees" } else { "differs" }
}

/// The table for the report.
pub(crate) fn table(rows: &[Row]) -> Block {
    let line = |(row, verdict): (&Row, &str)| {
        let quantity =
            if row.unit.is_empty() { row.quantity.clone() } else { format!("{} ({})", row.quantity, row.unit) };
        vec![quantity, shown(&row.published), shown(&row.ours), difference(row), verdict.to_owned(), row.id.clone()]
    };
    let head = ["quantity", "paper", "ours", "difference", "verdict", "row"].map(str::to_owned).to_vec();
    Block::Table { head, lines: chosen(rows).map(line).collect() }
}

/// What the verdicts mean.
pub(crate) const MEANING: &str = "A number agrees if it is within 5 % of the published one; the least separation, if it is at least the \
    safe distance; the error, if it is not above the published one. The geometry was fitted to the published times, so an \
    agreement shows that the paper's rule can give its numbers, and not that the authors flew this geometry.";

/// The same as text: one line a row.
#[must_use]
pub fn text(rows: &[Row]) -> String {
    let mut text =
        format!("{:<30} {:>16} {:>16} {:>19}  {:<4} verdict\n", "row", "paper", "ours", "difference", "unit");
    for (row, verdict) in chosen(rows) {
        let (published, ours, off) = (shown(&row.published), shown(&row.ours), difference(row));
        text += &format!("{:<30} {published:>16} {ours:>16} {off:>19}  {:<4} {verdict}\n", row.id, row.unit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn row(id: &str, published: Value, ours: Value) -> Row {
        let (quantity, command) = ("time".to_owned(), String::new());
        Row { id: id.to_owned(), quantity, published, ours, unit: "s", interval: None, command }
    }

    #[test]
    fn verdicts_follow_what_the_paper_claims() {
        let rows = [
            row("R1.S2.time", json!(28.0), json!(29.3)),
            row("R3.S2.time", json!(32.0), json!(30.0)),
            row("R3.S2.split", json!("2/6"), json!("2/6")),
            row("R5.separation", json!(25.0), json!(31.0)),
            row("R6", json!(0.8), json!(0.1)),
            row("R5.peak", json!(43.0), Value::Null),
            row("E1.other", json!(1.0), json!(1.0)),
        ];
        let found: Vec<_> = chosen(&rows).map(|(row, verdict)| (row.id.as_str(), verdict)).collect();
        let wanted = [
            ("R1.S2.time", "agrees"),
            ("R3.S2.time", "differs"),
            ("R3.S2.split", "agrees"),
            ("R5.peak", "not measured"),
            ("R5.separation", "agrees"),
            ("R6", "agrees"),
        ];
        assert_eq!(found, wanted);
        assert_eq!(text(&rows).lines().count(), 7);
        let Block::Table { lines, .. } = table(&rows) else { panic!("no table") };
        assert_eq!(lines[0], ["time (s)", "28", "29.3", "+1.300 (+4.6 %)", "agrees", "R1.S2.time"]);
    }
}
