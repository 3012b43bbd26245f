//! Data files of a run that are written on demand.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::{MESSAGES, MESSAGES_PARQUET, TRACE, TRACE_PARQUET};
use crate::folder::RunFolder;
use crate::interruption::Interrupted;
use crate::messages;
use crate::scene::MAX_LISTED_DRONES;
use crate::table::{ColumnKind, TableError, check_parquet, csv_to_parquet};
use crate::trace;
use std::io::{BufReader, BufWriter};
use std::num::NonZero;
use std::path::PathBuf;

/// Which data files of a run are wanted beside the usual ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DataFiles {
    /// Leaves only every so many ticks in trace.csv, and the last one.
    pub every: Option<NonZero<u64>>,
    /// Writes every table as Parquet as well.
    pub parquet: bool,
    /// Writes the messages as a table.
    pub messages: bool,
}

impl DataFiles {
    /// Refuses what this run or this program cannot give.
    ///
    /// # Errors
    /// [`ReportError::NotListed`] for the messages of a large swarm, [`ReportError::NoParquet`] if this program was built without
    /// the cargo feature `parquet`.
    pub fn check(&self, facts: &RunFacts) -> Result<(), ReportError> {
        if self.parquet {
            check_parquet().map_err(ReportError::NoParquet)?;
        }
        if self.messages && facts.drones as usize > MAX_LISTED_DRONES {
            return Err(ReportError::NotListed { drones: facts.drones, most: MAX_LISTED_DRONES });
        }
        Ok(())
    }

    /// Writes the files. The plots must be drawn before: they show all ticks. Returns the paths of the new files.
    ///
    /// # Errors
    /// [`ReportError`]; those of [`DataFiles::check`].
    pub fn write(
        &self,
        folder: &RunFolder,
        facts: &RunFacts,
        interrupted: &Interrupted<'_>,
    ) -> Result<Vec<PathBuf>, ReportError> {
        self.check(facts)?;
        let mut written = Vec::new();
        if let Some(every) = self.every {
            trace::thin(folder, every.get(), interrupted)?;
        }
        if self.parquet {
            to_parquet(folder, [TRACE, TRACE_PARQUET], trace::kind)?;
            written.push(TRACE_PARQUET);
        }
        if self.messages {
            messages::write(folder, interrupted)?;
            written.push(MESSAGES);
        }
        if self.messages && self.parquet {
            to_parquet(folder, [MESSAGES, MESSAGES_PARQUET], messages::kind)?;
            written.push(MESSAGES_PARQUET);
        }
        Ok(written.into_iter().map(|name| folder.path().join(name)).collect())
    }
}

/// Writes the table of a CSV file as Parquet.
fn to_parquet(
    folder: &RunFolder,
    [csv, parquet]: [&'static str; 2],
    kind: fn(&str) -> ColumnKind,
) -> Result<(), ReportError> {
    let input = BufReader::new(folder.files().read(csv)?);
    let out = BufWriter::new(folder.files().begin(parquet)?);
    let converted = csv_to_parquet(input, out, kind).map_err(|error| match error {
        TableError::Io(source) => ReportError::io(&folder.path().join(parquet))(source),
        field @ TableError::Field { .. } => {
            let (path, found) = (folder.path().join(csv), field.to_string());
            ReportError::Content { path, expected: "a table by this version of Skein", found }
        }
        TableError::NotBuilt => ReportError::NoParquet(TableError::NotBuilt),
    });
    match converted {
        Ok(_) => folder.files().keep(parquet),
        Err(error) => {
            folder.files().give_up(parquet);
            Err(error)
        }
    }
}
