//! Where something stands in the text of an experiment.

use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// What of a key is looked for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Spot {
    /// Its name.
    Key,
    /// Its value.
    Value,
    /// An item of its list, by number. The value, if it is no list.
    Item(usize),
}

impl From<Option<usize>> for Spot {
    /// An item, or the value.
    fn from(item: Option<usize>) -> Self {
        item.map_or(Self::Value, Self::Item)
    }
}

/// Where the key with this path stands, such as `grid.radio.loss`. A key of the file may have points in its name.
pub(crate) fn span_of(table: &DeTable<'_>, path: &str, spot: Spot) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| {
        let rest = path.strip_prefix(&**name.get_ref())?;
        match (rest, value.get_ref(), spot) {
            ("", _, Spot::Key) => Some(name.span()),
            ("", DeValue::Array(items), Spot::Item(number)) => Some(items.get(number)?.span()),
            ("", _, _) => Some(value.span()),
            (_, DeValue::Table(inner), _) => span_of(inner, rest.strip_prefix('.')?, spot),
            _ => None,
        }
    })
}

/// Line and column of a byte of the text, from 1. Columns count characters.
pub(crate) fn line_column(text: &str, byte: usize) -> (usize, usize) {
    let before = text.get(..byte).unwrap_or(text);
    let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
    (before.matches('\n').count() + 1, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_values_and_items_are_found() {
        let text = "[grid]\n\"a.b\" = [1, 22]\na.c = 3\n";
        let table = DeTable::parse(text).unwrap();
        let found = |path: &str, spot| span_of(table.get_ref(), path, spot).map(|span| &text[span]);
        assert_eq!(found("grid.a.b", Spot::Item(1)), Some("22"));
        assert_eq!(found("grid.a.b", Spot::Key), Some("\"a.b\""));
        assert_eq!(found("grid.a.c", Spot::Item(0)), Some("3"));
        assert_eq!((found("grid.a.d", Spot::Value), found("gri", Spot::Value)), (None, None));
        assert_eq!(line_column(text, text.find("22").unwrap()), (2, 13));
    }
}
