//! The page of a run: report.html with the recording in it, and the live view. The page uses neither a framework nor the
//! network.

mod data;
mod figures;
mod tables;

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::{PAGE, PLOTS};
use crate::folder::{Manifest, RunFolder};
use crate::interruption::Interrupted;
use crate::markup::escaped;
use crate::plot::{self, Plot};
use crate::summary::Summary;
use crate::text;
use std::path::PathBuf;

pub use data::{event_line, facts_line, sample_line, status_line};

/// The page, with places to be filled in as `{{name}}`.
const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: [&str; 6] = [
    include_str!("scene.js"),
    include_str!("side.js"),
    include_str!("story.js"),
    include_str!("panels.js"),
    include_str!("key.js"),
    include_str!("main.js"),
];

/// The page of the live view. It connects to the WebSocket `/socket` of the server that it came from, on this port of this
/// machine. Over the socket it receives lines of [`facts_line`], [`sample_line`], [`event_line`] and [`status_line`]. It
/// sends the drone that is selected, `{"select": 3}` or `{"select": null}`.
#[must_use]
pub fn live(port: u16) -> String {
    let connect = format!("'self' ws://127.0.0.1:{port} ws://localhost:{port}");
    fill(&[
        ("connect", &connect),
        ("title", "skein view"),
        ("status", "waiting for a swarm"),
        ("report", ""),
        ("data", ""),
    ])
}

/// The page of a recorded run. Writes nothing.
///
/// # Errors
/// [`ReportError`] if a file of the recording is missing or invalid, or a plot cannot be drawn; [`ReportError::Interrupted`].
pub fn report(
    folder: &RunFolder,
    manifest: &Manifest,
    summary: &Summary,
    interrupted: &Interrupted<'_>,
) -> Result<String, ReportError> {
    let draw = || plot::draw(folder, &manifest.facts, interrupted, std::io::sink());
    let (plots, data) = beside(draw, || data::packed(folder, &manifest.facts, interrupted));
    Ok(recorded(manifest, summary, &plots?, &data?))
}

/// Writes report.html and the plots of a recorded run, and returns their paths, report.html first.
///
/// # Errors
/// Those of [`report`], and [`ReportError::Io`].
pub fn write(
    folder: &RunFolder,
    manifest: &Manifest,
    summary: &Summary,
    interrupted: &Interrupted<'_>,
) -> Result<Vec<PathBuf>, ReportError> {
    let draw = || plot::draw_and_write(folder, &manifest.facts, interrupted);
    let (plots, data) = beside(draw, || data::packed(folder, &manifest.facts, interrupted));
    let plots = plots?;
    folder.files().write(PAGE, recorded(manifest, summary, &plots, &data?).as_bytes())?;
    let paths = plots.iter().map(|plot| folder.path().join(PLOTS).join(plot.file));
    Ok(std::iter::once(folder.path().join(PAGE)).chain(paths).collect())
}

/// Does both at the same time, the second one in another thread.
fn beside<A, B: Send>(first: impl FnOnce() -> A, second: impl FnOnce() -> B + Send) -> (A, B) {
    std::thread::scope(|scope| {
        let second = scope.spawn(second);
        (first(), second.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}

/// The page of a run with its plots and its packed recording.
fn recorded(manifest: &Manifest, summary: &Summary, plots: &[Plot], data: &str) -> String {
    let facts = &manifest.facts;
    let title = format!("{}: {} drones, {}, seed {}", facts.scenario, facts.drones, facts.strategy, facts.seed);
    let outcome = tables::outcome(summary);
    let outcome_line = format!("<span class=\"outcome {outcome}\">{}</span>", escaped(&text::outcome(summary)));
    let body = format!("{}{}", tables::all(summary), figures::all(plots));
    let data = format!("<script id=\"data\" type=\"text/plain\">{data}</script>");
    fill(&[
        ("connect", "'none'"),
        ("title", &escaped(&title)),
        ("status", &outcome_line),
        ("report", &format!("<section class=\"report\">{body}</section>")),
        ("data", &data),
    ])
}

/// The page with its places filled in. Places in the inserted text are not filled in.
fn fill(parts: &[(&str, &str)]) -> String {
    let script = SCRIPT.concat();
    let mut page = String::new();
    let mut rest = TEMPLATE;
    while let Some((before, after)) = rest.split_once("{{") {
        page.push_str(before);
        let Some((name, after)) = after.split_once("}}") else { break };
        let given = parts.iter().find(|part| part.0 == name).map(|part| part.1);
        page.push_str(match name {
            "style" => STYLE,
            "script" => &script,
            _ => given.unwrap_or_default(),
        });
        rest = after;
    }
    page.push_str(rest);
    page
}

/// The status line of the live view for a run with these facts.
#[must_use]
pub fn live_status(facts: &RunFacts) -> String {
    format!("live: {}, {} drones, {}, seed {}", facts.scenario, facts.drones, facts.strategy, facts.seed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_live_page_connects_only_to_its_own_server() {
        let page = live(4321);
        assert!(page.contains("ws://127.0.0.1:4321") && page.contains("<canvas"));
        assert!(!page.contains("{{") && !page.contains("id=\"data\""), "{page}");
        let addresses = page.matches("://").count();
        // Two addresses in the policy, one in the script, no others.
        assert_eq!(addresses, 3, "{page}");
    }

    #[test]
    fn markup_in_a_name_is_escaped() {
        let page = fill(&[("title", &escaped("<b>{{data}}</b>")), ("data", "secret")]);
        assert!(page.contains("<title>&lt;b&gt;{{data}}&lt;/b&gt;</title>"));
        assert_eq!(page.matches("secret").count(), 1);
    }
}
