//! The command `reproduce`.

use super::args::ReproduceArgs;
use super::content::{Block, TITLE, content};
use super::figures::figures;
use super::flights::flights;
use super::forest::Forest;
use super::gain;
use super::page::{html, markdown};
use super::results::Results;
use super::rows::{Row, rows};
use super::table::shown;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use skein_report::RunFolder;
use std::io::Write;
use std::path::Path;

/// The recorded mission in a report's folder, by which that is known.
const FOREST: &str = "forest";
/// What the figures' file names begin with.
const FIGURES: [&str; 8] = ["f1-", "f2-", "f3-", "f4-", "f5-", "f6-", "e6-", "gain-"];

/// Flies the paper's missions and writes the report.
pub fn reproduce(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let out = args.out.as_path();
    check_folder(out, args.force)?;
    let interrupt = Interrupt::watch()?;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let flown = Results::fly(&flights(args.quick), args.jobs.unwrap_or(cores), args.quiet, &interrupt)?;
    let interrupted = || Exit::Interrupted(interrupt.signal().unwrap_or_default());
    let Some(results) = flown else { return Ok(interrupted()) };
    clear_figures(&out.join("figures"))?;
    let forest = Forest::record(&out.join(FOREST), &interrupt)?;
    if interrupt.signal().is_some() {
        return Ok(interrupted());
    }
    let rows = rows(&results, &forest, args.quick);
    let figures = figures(&results, &forest).map_err(Failure::environment)?;
    let blocks = content(&results, &forest, &rows, figures, args.quick);
    for block in &blocks {
        if let Block::Figure(figure) = block {
            write(out, &format!("figures/{}", figure.file), &figure.svg)?;
        }
    }
    write(out, "report.md", &markdown(TITLE, &blocks))?;
    write(out, "report.html", &html(TITLE, &blocks))?;
    write(out, "results.csv", &results.csv())?;
    write(out, "gain.csv", &gain::csv(&results, args.quick))?;
    write(out, "reproduction.json", &(serde_json::to_string_pretty(&rows).map_err(Failure::environment)? + "\n"))?;
    if !args.quiet {
        print(out, &rows);
    }
    Ok(Exit::Reached)
}

/// An existing folder is refused, unless it is a report's, or empty, and may be replaced.
fn check_folder(out: &Path, force: bool) -> Result<(), Failure> {
    if !out.exists() {
        return Ok(());
    }
    let shown = out.display();
    if !force {
        return Err(Failure::usage(format!("{shown}: exists already; name another --out, or use --force")));
    }
    let empty = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_none());
    match empty || RunFolder::open(&out.join(FOREST)).is_ok() {
        true => Ok(()),
        false => Err(Failure::usage(format!("{shown}: is no folder of a report; --force would not replace it"))),
    }
}

/// Makes the folder, or removes an earlier report's figures from it: this one may have fewer.
fn clear_figures(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(trouble(folder))?;
    for entry in std::fs::read_dir(folder).map_err(trouble(folder))? {
        let path = entry.map_err(trouble(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if FIGURES.iter().any(|figure| name.starts_with(figure)) && name.ends_with(".svg") {
            std::fs::remove_file(&path).map_err(trouble(&path))?;
        }
    }
    Ok(())
}

fn write(out: &Path, name: &str, text: &str) -> Result<(), Failure> {
    let path = out.join(name);
    std::fs::write(&path, text).map_err(trouble(&path))
}

fn trouble(path: &Path) -> impl Fn(std::io::Error) -> Failure {
    move |error| Failure::environment(format!("{}: {error}", path.display()))
}

fn print(out: &Path, rows: &[Row]) {
    let mut text = format!("{:<34} {:>12} {:>12} unit\n", "row", "paper", "ours");
    for row in rows {
        text += &format!("{:<34} {:>12} {:>12} {}\n", row.id, shown(&row.published), shown(&row.ours), row.unit);
    }
    // A closed pipe is the reader's choice.
    let _ = writeln!(std::io::stdout().lock(), "{text}report  {}", out.join("report.html").display());
}
