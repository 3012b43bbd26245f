//! Flies the paper's missions and writes the report.

use crate::block::Block;
use crate::content::{TITLE, content};
use crate::distribution;
use crate::error::ReproduceError;
use crate::figures::{Figure, figures};
use crate::flights::flights;
use crate::forest::Forest;
use crate::gain;
use crate::page::{html, markdown};
use crate::results::Results;
use crate::row::Row;
use crate::rows::rows;
use skein_report::{RunFolder, WorkFolder};
use skein_sweep::{Interrupted, Progress};
use std::path::PathBuf;

/// Name of the recorded mission in a report's folder. A folder that holds it is recognised as a report's.
const FOREST: &str = "forest";
/// Name of the folder of the two recorded missions that the paper's Fig. 2 compares.
const DISTRIBUTION: &str = "distribution";
/// Prefixes of the figures' file names.
const FIGURES: [&str; 9] = ["distribution-", "f1-", "f2-", "f3-", "f4-", "f5-", "f6-", "e6-", "gain-"];

/// The settings of a reproduction.
#[derive(Clone, Debug)]
pub struct Reproduction {
    /// Folder of the report.
    pub folder: PathBuf,
    /// Whether a report in an existing folder is replaced.
    pub force: bool,
    /// Flies 8 instead of 30 seeds, and the time against the split in one geometry instead of three.
    pub quick: bool,
    /// Flights side by side.
    pub workers: usize,
}

impl Reproduction {
    /// Flies the paper's missions, writes the report and returns its rows. `None` if interrupted.
    ///
    /// # Errors
    /// [`ReproduceError`]. If it is a usage error, nothing was flown.
    pub fn run(
        &self,
        progress: impl FnMut(Progress),
        interrupted: &Interrupted<'_>,
    ) -> Result<Option<Vec<Row>>, ReproduceError> {
        self.check_folder()?;
        let (folder, new) = WorkFolder::make(&self.folder).map_err(ReproduceError::Folder)?;
        let flown = Results::fly(&flights(self.quick), self.workers, progress, interrupted)?;
        let Some(results) = flown else {
            if new {
                // It is still empty. What remains does no harm.
                let _ = std::fs::remove_dir(&self.folder);
            }
            return Ok(None);
        };
        let figures = folder.subfolder("figures")?;
        clear(&figures)?;
        let forest = Forest::record(&self.folder.join(FOREST), interrupted)?;
        let distribution = distribution::figures(&self.folder.join(DISTRIBUTION), interrupted)?;
        if interrupted().is_some() {
            return Ok(None);
        }
        let rows = rows(&results, &forest, self.quick);
        self.write_all(&results, (&forest, distribution), &rows, [&folder, &figures])?;
        Ok(Some(rows))
    }

    fn write_all(
        &self,
        results: &Results,
        (forest, mut all): (&Forest, Vec<Figure>),
        rows: &[Row],
        [folder, drawings]: [&WorkFolder; 2],
    ) -> Result<(), ReproduceError> {
        all.extend(figures(results, forest)?);
        let blocks = content(results, forest, rows, all, self.quick);
        for block in &blocks {
            if let Block::Figure(figure) = block {
                drawings.write(&figure.file, figure.svg.as_bytes())?;
            }
        }
        folder.write("report.md", markdown(TITLE, &blocks).as_bytes())?;
        folder.write("report.html", html(TITLE, &blocks).as_bytes())?;
        folder.write("results.csv", results.csv().as_bytes())?;
        folder.write("gain.csv", gain::csv(results, self.quick).as_bytes())?;
        Ok(folder.write("reproduction.json", (serde_json::to_string_pretty(rows)? + "\n").as_bytes())?)
    }

    /// Refuses an existing folder, unless it is empty or a report's and may be replaced.
    fn check_folder(&self) -> Result<(), ReproduceError> {
        if !self.folder.exists() {
            return Ok(());
        }
        if !self.force {
            return Err(ReproduceError::Exists(self.folder.clone()));
        }
        let empty = std::fs::read_dir(&self.folder).is_ok_and(|mut entries| entries.next().is_none());
        if empty || RunFolder::open(&self.folder.join(FOREST)).is_ok() {
            Ok(())
        } else {
            Err(ReproduceError::NotAReport(self.folder.clone()))
        }
    }
}

/// Removes an earlier report's figures from a folder, because this report may have fewer.
fn clear(folder: &WorkFolder) -> Result<(), ReproduceError> {
    for name in folder.names()? {
        if FIGURES.iter().any(|figure| name.starts_with(figure)) && name.ends_with(".svg") {
            folder.remove(&name)?;
        }
    }
    Ok(())
}
