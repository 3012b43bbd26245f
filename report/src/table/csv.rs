//! Tables as CSV (RFC 4180): fields with commas, quotes or line feeds are quoted. An empty cell is an empty field.

use super::column::{Cell, Column};
use std::borrow::Cow;
use std::io::{self, BufRead, Write};

/// Writes a table as CSV. Reuses its buffers, so that a row costs no allocation.
pub struct CsvWriter<W: Write> {
    out: W,
    line: Vec<u8>,
    number: zmij::Buffer,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the header.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(mut out: W, columns: &[Column]) -> io::Result<Self> {
        let names: Vec<Cow<'_, str>> = columns.iter().map(|column| quoted(&column.name)).collect();
        writeln!(out, "{}", names.join(","))?;
        Ok(Self { out, line: Vec::new(), number: zmij::Buffer::new() })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn row(&mut self, cells: &[Cell<'_>]) -> io::Result<()> {
        self.line.clear();
        for (place, cell) in cells.iter().enumerate() {
            if place > 0 {
                self.line.push(b',');
            }
            match cell {
                Cell::Empty => {}
                Cell::Number(value) => self.line.extend_from_slice(self.number.format(*value).as_bytes()),
                Cell::Whole(value) => write!(self.line, "{value}")?,
                Cell::Flag(value) => self.line.push(if *value { b'1' } else { b'0' }),
                Cell::Text(text) => self.line.extend_from_slice(quoted(text).as_bytes()),
            }
        }
        self.line.push(b'\n');
        self.out.write_all(&self.line)
    }

    /// Writes what is still buffered, and returns the writer.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// The text as a field of CSV.
#[must_use]
pub fn quoted(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}

/// Reads CSV row by row.
pub(crate) struct CsvReader<R> {
    input: R,
    line: String,
    /// Number of the last line that was read, from 1.
    number: usize,
}

impl<R: BufRead> CsvReader<R> {
    /// Reads from the beginning of `input`.
    pub(crate) fn new(input: R) -> Self {
        Self { input, line: String::new(), number: 0 }
    }

    /// Number of the line that was read last, from 1.
    pub(crate) fn line_number(&self) -> usize {
        self.number
    }

    /// The line that was read last, without its end.
    pub(crate) fn line(&self) -> &str {
        self.line.trim_end_matches(['\n', '\r'])
    }

    /// Reads the next row into `fields`. Returns false at the end.
    ///
    /// # Errors
    /// Those of the input.
    pub(crate) fn read(&mut self, fields: &mut Vec<String>) -> io::Result<bool> {
        self.line.clear();
        fields.clear();
        if self.input.read_line(&mut self.line)? == 0 {
            return Ok(false);
        }
        self.number += 1;
        // A field in quotes may contain line feeds: then the quotes of the line are not in pairs.
        while self.line.matches('"').count() % 2 == 1 && self.input.read_line(&mut self.line)? > 0 {
            self.number += 1;
        }
        split(self.line(), fields);
        Ok(true)
    }
}

/// Splits a row into its fields.
fn split(line: &str, fields: &mut Vec<String>) {
    let (mut field, mut is_quoted) = (String::new(), false);
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if is_quoted && letters.peek() == Some(&'"') => field.extend(letters.next()),
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => fields.push(std::mem::take(&mut field)),
            other => field.push(other),
        }
    }
    fields.push(field);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::ColumnKind;
    use proptest::prelude::*;

    #[test]
    fn cells_are_written_by_kind() {
        let columns = ["t_s", "drone", "alive", "says"].map(|name| Column::new(name, ColumnKind::Text));
        let mut writer = CsvWriter::new(Vec::new(), &columns).unwrap();
        writer.row(&[Cell::from(0.1), Cell::from(3u32), Cell::from(true), Cell::from("a, \"b\"")]).unwrap();
        writer.row(&[Cell::from(f64::NAN), Cell::Empty, Cell::from(false), Cell::from("")]).unwrap();
        let text = String::from_utf8(writer.finish().unwrap()).unwrap();
        assert_eq!(text, "t_s,drone,alive,says\n0.1,3,1,\"a, \"\"b\"\"\"\n,,0,\n");
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(rows in prop::collection::vec(prop::collection::vec("[a,\"\n;é]{0,6}", 3), 0..5)) {
            let columns = ["a", "b", "c"].map(|name| Column::new(name, ColumnKind::Text));
            let mut writer = CsvWriter::new(Vec::new(), &columns).unwrap();
            for row in &rows {
                let cells: Vec<Cell<'_>> = row.iter().map(|text| Cell::Text(text)).collect();
                writer.row(&cells).unwrap();
            }
            let bytes = writer.finish().unwrap();
            let (mut reader, mut fields, mut read) = (CsvReader::new(&bytes[..]), Vec::new(), Vec::new());
            while reader.read(&mut fields).unwrap() {
                read.push(fields.clone());
            }
            prop_assert_eq!(&read[0], &["a", "b", "c"]);
            prop_assert_eq!(&read[1..], &rows);
        }
    }
}
