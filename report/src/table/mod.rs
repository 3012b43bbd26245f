//! Tables of data: columns with names, kinds and units, written as CSV or as Parquet.

mod column;
mod convert;
mod csv;
#[cfg(feature = "parquet")]
mod parquet;

pub use column::{Cell, Column, ColumnKind};
pub use convert::{TableError, check_parquet, csv_to_parquet, inferred};
pub(crate) use csv::CsvReader;
pub use csv::{CsvWriter, quoted};
#[cfg(feature = "parquet")]
pub use parquet::ParquetWriter;
