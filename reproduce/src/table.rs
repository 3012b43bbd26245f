//! Rows and studies as tables.

use crate::block::Block;
use crate::results::{Results, split};
use crate::row::{CONVENTIONS, Row};
use crate::study::{Study, StudyCase};
use serde_json::Value;
use skein_protocol::record::Outcome;

/// A number in its shortest form, a text as it is, and a dash for null.
pub(crate) fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(String::new, |number| number.to_string()),
        _ => "–".to_owned(),
    }
}

/// Our value minus the published one, also relative to it.
pub(crate) fn difference(row: &Row) -> String {
    match (row.published.as_f64(), row.ours.as_f64()) {
        (Some(published), Some(ours)) if published != 0.0 => {
            let off = ours - published;
            format!("{off:+.3} ({:+.1} %)", off / published * 100.0)
        }
        _ if row.published.is_null() || row.ours.is_null() => "–".to_owned(),
        _ if row.published == row.ours => "equal".to_owned(),
        _ => "differs".to_owned(),
    }
}

/// The table of the rows whose id begins with one of the prefixes.
pub(crate) fn table(rows: &[Row], prefixes: &[&str]) -> Block {
    let wanted = rows.iter().filter(|row| prefixes.iter().any(|prefix| row.id.starts_with(prefix)));
    let line = |row: &Row| {
        let interval = row.interval.map(|[low, high]| format!(" [{low}, {high}]")).unwrap_or_default();
        let ours = format!("{}{interval}", shown(&row.ours));
        let command = row.command.split("; ").map(|command| format!("`{command}`")).collect::<Vec<_>>().join(" and ");
        vec![
            row.id.clone(),
            row.quantity.clone(),
            row.unit.to_owned(),
            shown(&row.published),
            ours,
            difference(row),
            command,
        ]
    };
    let head = ["row", "quantity", "unit", "paper", "ours", "difference", "command"].map(str::to_owned).to_vec();
    Block::Table { head, lines: wanted.map(line).collect() }
}

/// The flights of a study side by side. A flight that did not reach its goal shows its outcome and no energy.
pub(crate) fn study(study: &Study, results: &Results) -> Block {
    let columns = ["split, left to right", "time to pass (s)", "mission (s)"].map(str::to_owned).into_iter();
    let energies = CONVENTIONS.iter().map(|convention| format!("{} (kJ)", convention.words));
    let last = ["least separation (m)", "command"].map(str::to_owned);
    let head = study.labels.iter().map(|&label| label.to_owned()).chain(columns).chain(energies).chain(last);
    Block::Table { head: head.collect(), lines: study.cases.iter().map(|case| study_line(case, results)).collect() }
}

fn study_line(StudyCase { labels, flight, .. }: &StudyCase, results: &Results) -> Vec<String> {
    let number = |value: Option<f64>, digits: usize| value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}"));
    let mut cells = labels.clone();
    let summary = results.get(flight).filter(|summary| summary.outcome != Outcome::Aborted);
    let stages = |of: fn(&skein_report::Stage) -> Option<String>| {
        let parts = summary.iter().flat_map(|summary| &summary.stages).filter_map(of);
        parts.collect::<Vec<String>>().join(", ")
    };
    cells.push(stages(|stage| stage.split.as_deref().map(|drones| split(Some(drones)))));
    cells.push(stages(|stage| Some(format!("{:.2}", stage.pass_time_s?))));
    let reached = results.reached(flight);
    cells.push(match (reached, summary) {
        (Some(summary), _) => number(Some(summary.mission_s), 2),
        (None, Some(summary)) => format!("{:?}", summary.outcome).to_lowercase(),
        (None, None) => "–".to_owned(),
    });
    let energies = CONVENTIONS.iter().map(|convention| {
        let joules = reached.and_then(convention.energy_j);
        number(joules.map(|joules| joules / 1e3), 3)
    });
    cells.extend(energies);
    cells.push(number(summary.and_then(|summary| summary.min_separation_m), 2));
    cells.push(format!("`{}`", flight.command()));
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(published: Value, ours: Value) -> Row {
        Row {
            id: "R1".to_owned(),
            quantity: String::new(),
            published,
            ours,
            unit: "s",
            interval: None,
            command: "a; b".to_owned(),
        }
    }

    #[test]
    fn differences_are_ours_minus_the_published() {
        assert_eq!(difference(&row(json!(32.0), json!(30.4))), "-1.600 (-5.0 %)");
        assert_eq!(difference(&row(json!("4/4"), json!("4/4"))), "equal");
        assert_eq!(difference(&row(json!("6/2"), json!("2/6"))), "differs");
        assert_eq!(difference(&row(Value::Null, json!(1.0))), "–");
    }

    #[test]
    fn tables_hold_the_chosen_rows() {
        let rows = [row(json!(32.0), Value::Null), Row { id: "R2.S1".to_owned(), ..row(json!(1.0), json!(2.5)) }];
        let Block::Table { lines, .. } = table(&rows, &["R2"]) else { panic!("no table") };
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0], ["R2.S1", "", "s", "1", "2.5", "+1.500 (+150.0 %)", "`a` and `b`"]);
    }
}
