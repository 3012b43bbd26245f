//! Flies the paper's missions and writes the report.

use crate::block::Block;
use crate::content::{TITLE, content};
use crate::error::ReproduceError;
use crate::figures::figures;
use crate::flights::flights;
use crate::forest::Forest;
use crate::gain;
use crate::page::{html, markdown};
use crate::results::Results;
use crate::row::Row;
use crate::rows::rows;
use crate::table::shown;
use skein_report::RunFolder;
use skein_sweep::{Interrupted, Progress};
use std::path::{Path, PathBuf};

/// Name of the recorded mission in a report's folder. A folder that holds it is recognised as a report's.
const FOREST: &str = "forest";
/// Prefixes of the figures' file names.
const FIGURES: [&str; 8] = ["f1-", "f2-", "f3-", "f4-", "f5-", "f6-", "e6-", "gain-"];

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
        let flown = Results::fly(&flights(self.quick), self.workers, progress, interrupted)?;
        let Some(results) = flown else { return Ok(None) };
        clear_figures(&self.folder.join("figures"))?;
        let forest = Forest::record(&self.folder.join(FOREST), interrupted)?;
        if interrupted().is_some() {
            return Ok(None);
        }
        let rows = rows(&results, &forest, self.quick);
        self.write_all(&results, &forest, &rows)?;
        Ok(Some(rows))
    }

    fn write_all(&self, results: &Results, forest: &Forest, rows: &[Row]) -> Result<(), ReproduceError> {
        let figures = figures(results, forest)?;
        let blocks = content(results, forest, rows, figures, self.quick);
        for block in &blocks {
            if let Block::Figure(figure) = block {
                self.write(&format!("figures/{}", figure.file), &figure.svg)?;
            }
        }
        self.write("report.md", &markdown(TITLE, &blocks))?;
        self.write("report.html", &html(TITLE, &blocks))?;
        self.write("results.csv", &results.csv())?;
        self.write("gain.csv", &gain::csv(results, self.quick))?;
        self.write("reproduction.json", &(serde_json::to_string_pretty(rows)? + "\n"))
    }

    fn write(&self, name: &str, text: &str) -> Result<(), ReproduceError> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).map_err(ReproduceError::io(&path))
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

/// Makes the folder, or removes an earlier report's figures from it, because this report may have fewer.
fn clear_figures(folder: &Path) -> Result<(), ReproduceError> {
    let io = ReproduceError::io(folder);
    std::fs::create_dir_all(folder).map_err(&io)?;
    for entry in std::fs::read_dir(folder).map_err(&io)? {
        let path = entry.map_err(&io)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if FIGURES.iter().any(|figure| name.starts_with(figure)) && name.ends_with(".svg") {
            std::fs::remove_file(&path).map_err(ReproduceError::io(&path))?;
        }
    }
    Ok(())
}

/// The rows as a text table: published numbers beside ours.
#[must_use]
pub fn table(rows: &[Row]) -> String {
    let mut text = format!("{:<34} {:>12} {:>12} unit\n", "row", "paper", "ours");
    for row in rows {
        text += &format!("{:<34} {:>12} {:>12} {}\n", row.id, shown(&row.published), shown(&row.ours), row.unit);
    }
    text
}
