//! Rows as tables for people.

use super::content::Block;
use super::rows::Row;
use serde_json::Value;

/// A number as short as it can be said, a text as it is, a dash for what is not.
pub fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.as_f64().map_or_else(String::new, |number| number.to_string()),
        _ => "–".to_owned(),
    }
}

/// Ours less the published, and what part of it that is.
fn difference(row: &Row) -> String {
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

/// The rows whose id begins with one of these.
pub fn table(rows: &[Row], prefixes: &[&str]) -> Block {
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
    fn differences_are_ours_less_the_published() {
        assert_eq!(difference(&row(json!(32.0), json!(30.4))), "-1.600 (-5.0 %)");
        assert_eq!(difference(&row(json!("4/4"), json!("4/4"))), "equal");
        assert_eq!(difference(&row(json!("6/2"), json!("2/6"))), "differs");
        assert_eq!(difference(&row(Value::Null, json!(1.0))), "–");
    }

    #[test]
    fn tables_hold_the_rows_asked_for() {
        let rows = [row(json!(32.0), Value::Null), Row { id: "R2.S1".to_owned(), ..row(json!(1.0), json!(2.5)) }];
        let Block::Table { lines, .. } = table(&rows, &["R2"]) else { panic!("no table") };
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0], ["R2.S1", "", "s", "1", "2.5", "+1.500 (+150.0 %)", "`a` and `b`"]);
    }
}
