//! Tables as Apache Parquet, compressed by Snappy. Every column may be empty.

use super::column::{Cell, Column, ColumnKind};
use ::parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use ::parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use ::parquet::errors::ParquetError;
use ::parquet::file::properties::WriterProperties;
use ::parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use ::parquet::schema::types::Type;
use std::io::{self, Write};
use std::sync::Arc;

/// Rows of a row group. They are in memory until it is written.
const GROUP_ROWS: usize = 1 << 16;

/// Writes a table as Parquet.
pub struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    /// The values of the current row group, by column.
    values: Vec<Values>,
    /// Rows in the current row group.
    pending: usize,
}

/// The values of a column in a row group.
struct Values {
    /// For each row, 1 if it has a value, else 0.
    levels: Vec<i16>,
    data: Data,
}

/// The values that are not empty.
enum Data {
    Numbers(Vec<f64>),
    Wholes(Vec<i64>),
    Flags(Vec<bool>),
    Texts(Vec<ByteArray>),
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// Those of `out`, and of columns that cannot be in one table.
    pub fn new(out: W, columns: &[Column]) -> io::Result<Self> {
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(concat!("skein ", env!("CARGO_PKG_VERSION")).to_owned())
            .build();
        let schema = schema(columns).map_err(io::Error::other)?;
        let file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties)).map_err(io::Error::other)?;
        let values = columns.iter().map(|column| Values::empty(column.kind)).collect();
        Ok(Self { file, values, pending: 0 })
    }

    /// Adds a row. A cell that is not of its column's kind counts as empty, as do missing cells.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn row(&mut self, cells: &[Cell<'_>]) -> io::Result<()> {
        let cells = cells.iter().copied().chain(std::iter::repeat(Cell::Empty));
        for (values, cell) in self.values.iter_mut().zip(cells) {
            values.push(cell);
        }
        self.pending += 1;
        if self.pending == GROUP_ROWS { self.close_group().map_err(io::Error::other) } else { Ok(()) }
    }

    /// Completes the file, and returns the writer.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn finish(mut self) -> io::Result<W> {
        if self.pending > 0 {
            self.close_group().map_err(io::Error::other)?;
        }
        let mut out = self.file.into_inner().map_err(io::Error::other)?;
        out.flush()?;
        Ok(out)
    }

    fn close_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.file.next_row_group()?;
        for values in &mut self.values {
            if let Some(mut column) = group.next_column()? {
                values.write(&mut column)?;
                column.close()?;
            }
            values.clear();
        }
        group.close()?;
        self.pending = 0;
        Ok(())
    }
}

impl Values {
    fn empty(kind: ColumnKind) -> Self {
        let data = match kind {
            ColumnKind::Number => Data::Numbers(Vec::new()),
            ColumnKind::Whole => Data::Wholes(Vec::new()),
            ColumnKind::Flag => Data::Flags(Vec::new()),
            ColumnKind::Text => Data::Texts(Vec::new()),
        };
        Self { levels: Vec::new(), data }
    }

    fn push(&mut self, cell: Cell<'_>) {
        match (&mut self.data, cell) {
            (Data::Numbers(values), Cell::Number(value)) => values.push(value),
            (Data::Numbers(values), Cell::Whole(value)) => values.push(value as f64),
            (Data::Wholes(values), Cell::Whole(value)) => values.push(value),
            (Data::Flags(values), Cell::Flag(value)) => values.push(value),
            (Data::Texts(values), Cell::Text(text)) => values.push(text.into()),
            _ => return self.levels.push(0),
        }
        self.levels.push(1);
    }

    fn write(&self, column: &mut SerializedColumnWriter<'_>) -> Result<usize, ParquetError> {
        let levels = Some(&self.levels[..]);
        match &self.data {
            Data::Numbers(values) => column.typed::<DoubleType>().write_batch(values, levels, None),
            Data::Wholes(values) => column.typed::<Int64Type>().write_batch(values, levels, None),
            Data::Flags(values) => column.typed::<BoolType>().write_batch(values, levels, None),
            Data::Texts(values) => column.typed::<ByteArrayType>().write_batch(values, levels, None),
        }
    }

    fn clear(&mut self) {
        self.levels.clear();
        match &mut self.data {
            Data::Numbers(values) => values.clear(),
            Data::Wholes(values) => values.clear(),
            Data::Flags(values) => values.clear(),
            Data::Texts(values) => values.clear(),
        }
    }
}

fn schema(columns: &[Column]) -> Result<Type, ParquetError> {
    let field = |column: &Column| {
        let (physical, logical) = match column.kind {
            ColumnKind::Number => (Physical::DOUBLE, None),
            ColumnKind::Whole => (Physical::INT64, None),
            ColumnKind::Flag => (Physical::BOOLEAN, None),
            ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = Type::primitive_type_builder(&column.name, physical).with_logical_type(logical);
        field.with_repetition(Repetition::OPTIONAL).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<_, _>>()?;
    Type::group_type_builder("table").with_fields(fields).build()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::Field;
    use proptest::prelude::*;

    const COLUMNS: [Column; 4] = [
        Column::new("t_s", ColumnKind::Number),
        Column::new("drone", ColumnKind::Whole),
        Column::new("alive", ColumnKind::Flag),
        Column::new("group", ColumnKind::Text),
    ];

    fn write(rows: impl IntoIterator<Item = Vec<Field>>) -> Vec<Vec<Field>> {
        let mut writer = ParquetWriter::new(tempfile::tempfile().unwrap(), &COLUMNS).unwrap();
        for row in rows {
            writer.row(&row.iter().map(cell).collect::<Vec<_>>()).unwrap();
        }
        let file = SerializedFileReader::new(writer.finish().unwrap()).unwrap();
        let names = file.metadata().file_metadata().schema().get_fields().iter().map(|field| field.name().to_owned());
        assert_eq!(names.collect::<Vec<_>>(), ["t_s", "drone", "alive", "group"]);
        let rows = file.get_row_iter(None).unwrap();
        rows.map(|row| row.unwrap().get_column_iter().map(|(_, field)| field.clone()).collect()).collect()
    }

    fn cell(field: &Field) -> Cell<'_> {
        match field {
            Field::Double(value) => Cell::Number(*value),
            Field::Long(value) => Cell::Whole(*value),
            Field::Bool(value) => Cell::Flag(*value),
            Field::Str(text) => Cell::Text(text),
            _ => Cell::Empty,
        }
    }

    fn optional<T: std::fmt::Debug + 'static>(
        values: impl Strategy<Value = T> + 'static,
        field: fn(T) -> Field,
    ) -> impl Strategy<Value = Field> {
        prop::option::of(values).prop_map(move |value| value.map_or(Field::Null, field))
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(
            rows in prop::collection::vec(
                (
                    optional(-1e9..1e9, Field::Double), optional(any::<i64>(), Field::Long),
                    optional(any::<bool>(), Field::Bool), optional(any::<String>(), Field::Str),
                ).prop_map(|(number, whole, flag, text)| vec![number, whole, flag, text]),
                0..40,
            ),
        ) {
            prop_assert_eq!(write(rows.clone()), rows);
        }
    }

    #[test]
    fn a_long_table_has_several_row_groups() {
        let count = GROUP_ROWS as i64 + 3;
        let row = |drone: i64| vec![Field::Null, Field::Long(drone), Field::Bool(drone % 3 == 0)];
        let rows = write((0..count).map(row));
        assert_eq!(rows.len() as i64, count);
        for (drone, found) in (0..).zip(rows) {
            assert_eq!((&found[..3], &found[3]), (&row(drone)[..], &Field::Null));
        }
    }
}
