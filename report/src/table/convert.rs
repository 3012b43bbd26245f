//! From CSV to Parquet.

use super::column::{Cell, ColumnKind};
use super::csv::CsvReader;
use std::io::{self, BufRead, Write};
use thiserror::Error;

/// Why a CSV table cannot be converted.
#[derive(Debug, Error)]
pub enum TableError {
    /// This program cannot write Parquet.
    #[error(
        "this program cannot write Parquet; build it with the feature \"parquet\": \
         `cargo install --path skein --features parquet`"
    )]
    NotBuilt,
    /// Reading or writing failed.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A field is not of its column's kind.
    #[error("line {line}: column {column}: expected a {kind:?}, found {found:?}")]
    Field {
        /// Number of the line, from 1.
        line: usize,
        /// Name of the column.
        column: String,
        /// What the column holds.
        kind: ColumnKind,
        /// The field.
        found: String,
    },
}

/// Whether [`csv_to_parquet`] works: it needs the cargo feature `parquet`.
///
/// # Errors
/// [`TableError::NotBuilt`].
pub fn check_parquet() -> Result<(), TableError> {
    if cfg!(feature = "parquet") { Ok(()) } else { Err(TableError::NotBuilt) }
}

/// Converts a CSV table with a header into Parquet. `kind` says what the column of a name holds.
///
/// # Errors
/// [`TableError`].
#[cfg(feature = "parquet")]
pub fn csv_to_parquet<W: Write + Send>(
    csv: impl BufRead,
    out: W,
    kind: impl Fn(&str) -> ColumnKind,
) -> Result<W, TableError> {
    let (mut reader, mut fields) = (CsvReader::new(csv), Vec::new());
    reader.read(&mut fields)?;
    let column = |name: String| super::Column { kind: kind(&name), name: name.into() };
    let columns: Vec<super::Column> = fields.drain(..).map(column).collect();
    let mut writer = super::ParquetWriter::new(out, &columns)?;
    while reader.read(&mut fields)? {
        let mut cells = Vec::with_capacity(fields.len());
        for (column, field) in columns.iter().zip(&fields) {
            let wrong = || TableError::Field {
                line: reader.line_number(),
                column: column.name.to_string(),
                kind: column.kind,
                found: field.clone(),
            };
            cells.push(cell(column.kind, field).ok_or_else(wrong)?);
        }
        writer.row(&cells)?;
    }
    Ok(writer.finish()?)
}

/// Says that this program cannot write Parquet.
///
/// # Errors
/// [`TableError::NotBuilt`].
#[cfg(not(feature = "parquet"))]
pub fn csv_to_parquet<W: Write + Send>(
    _csv: impl BufRead,
    _out: W,
    _kind: impl Fn(&str) -> ColumnKind,
) -> Result<W, TableError> {
    Err(TableError::NotBuilt)
}

/// What the column of a name holds, judged by all of its fields in this table: numbers if each that is not empty is one.
pub fn inferred(csv: &[u8]) -> impl Fn(&str) -> ColumnKind {
    let (mut reader, mut fields) = (CsvReader::new(csv), Vec::new());
    let mut read = |fields: &mut Vec<String>| reader.read(fields).unwrap_or(false);
    read(&mut fields);
    let mut columns: Vec<(String, Vec<ColumnKind>)> =
        fields.drain(..).map(|name| (name, vec![ColumnKind::Whole, ColumnKind::Number])).collect();
    while read(&mut fields) {
        for ((_, kinds), field) in columns.iter_mut().zip(&fields) {
            kinds.retain(|&kind| cell(kind, field).is_some());
        }
    }
    move |name| {
        let found = columns.iter().find(|column| column.0 == name).and_then(|column| column.1.first());
        found.copied().unwrap_or(ColumnKind::Text)
    }
}

/// A field as a cell of a column of this kind; `None` if it is of another kind.
fn cell(kind: ColumnKind, field: &str) -> Option<Cell<'_>> {
    if field.is_empty() {
        return Some(Cell::Empty);
    }
    match kind {
        ColumnKind::Number => field.parse().ok().map(Cell::Number),
        ColumnKind::Whole => field.parse().ok().map(Cell::Whole),
        ColumnKind::Flag => ["0", "1"].iter().position(|word| *word == field).map(|place| Cell::Flag(place == 1)),
        ColumnKind::Text => Some(Cell::Text(field)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CSV: &[u8] = b"name,seed,loss,digest\na,1,0.5,00ff\n,2,,12\n";

    #[test]
    fn kinds_are_inferred() {
        let kinds = ["name", "seed", "loss", "digest"].map(inferred(CSV));
        assert_eq!(kinds, [ColumnKind::Text, ColumnKind::Whole, ColumnKind::Number, ColumnKind::Text]);
    }

    #[cfg(feature = "parquet")]
    #[test]
    fn a_table_is_converted_and_a_wrong_field_is_named() {
        use ::parquet::file::reader::{FileReader, SerializedFileReader};
        let file = csv_to_parquet(CSV, tempfile::tempfile().unwrap(), inferred(CSV)).unwrap();
        let file = SerializedFileReader::new(file).unwrap();
        let rows: Vec<String> = file.get_row_iter(None).unwrap().map(|row| row.unwrap().to_string()).collect();
        assert_eq!(rows.len(), 2);
        assert!(rows[0].contains("seed: 1") && rows[0].contains("loss: 0.5"), "{rows:?}");
        assert!(rows[1].contains("name: null") && rows[1].contains("loss: null"), "{rows:?}");
        let error = csv_to_parquet(CSV, Vec::new(), |_| ColumnKind::Whole).unwrap_err().to_string();
        assert!(error.contains("line 2: column name") && error.contains("\"a\""), "{error}");
    }

    #[cfg(not(feature = "parquet"))]
    #[test]
    fn a_program_without_parquet_says_how_to_build_one() {
        let error = csv_to_parquet(CSV, Vec::new(), inferred(CSV)).unwrap_err().to_string();
        assert!(error.contains("--features parquet"), "{error}");
        assert_eq!(check_parquet().unwrap_err().to_string(), error);
    }
}
