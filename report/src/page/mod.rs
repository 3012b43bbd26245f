//! One page, without a framework or the network: a flown run's report.html with the recording in it, and the live view.

mod data;
mod figures;
mod tables;

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::{Manifest, RunFolder};
use crate::plot;
use crate::summary::Summary;
use crate::text;
use std::path::PathBuf;

pub use data::{event_line, facts_line, sample_line, status_line};

/// Name of the report in a run's folder.
const FILE: &str = "report.html";
const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: [&str; 4] =
    [include_str!("scene.js"), include_str!("story.js"), include_str!("panels.js"), include_str!("main.js")];

/// The page that listens to `/socket` of the server it came from, which is on this port of this machine. What comes
/// over the socket: lines of [`facts_line`], [`sample_line`], [`event_line`] and [`status_line`]. What it sends: which
/// drone is selected, `{"select": 3}` or `{"select": null}`.
#[must_use]
pub fn live(port: u16) -> String {
    let connect = format!("'self' ws://127.0.0.1:{port} ws://localhost:{port}");
    fill(&[
        ("connect", &connect),
        ("title", "skein view"),
        ("verdict", "waiting for a swarm"),
        ("report", ""),
        ("data", ""),
    ])
}

/// The report of a recorded run.
///
/// # Errors
/// [`ReportError`] if the folder lacks a part of the recording, or a plot cannot be drawn.
pub fn report(folder: &RunFolder, manifest: &Manifest, summary: &Summary) -> Result<String, ReportError> {
    let facts = &manifest.facts;
    // The recording is packed on another core meanwhile.
    let (plots, data) = std::thread::scope(|scope| {
        let data = scope.spawn(|| data::packed(folder, facts));
        (plot::write(folder, facts), data.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    });
    let plots = plots?;
    let title = format!("{}: {} drones, {}, seed {}", facts.scenario, facts.drones, facts.strategy, facts.seed);
    let outcome = tables::outcome(summary);
    let verdict = format!("<span class=\"verdict {outcome}\">{}</span>", escaped(&text::verdict(summary, false)));
    let body = format!("{}{}", tables::all(summary), figures::all(&plots)?);
    let data = format!("<script id=\"data\" type=\"text/plain\">{}</script>", data?);
    Ok(fill(&[
        ("connect", "'none'"),
        ("title", &escaped(&title)),
        ("verdict", &verdict),
        ("report", &format!("<section class=\"report\">{body}</section>")),
        ("data", &data),
    ]))
}

/// Writes report.html and the plots of a recorded run; what was written, report.html first.
///
/// # Errors
/// As [`report`]; [`ReportError::Io`].
pub fn write(folder: &RunFolder, manifest: &Manifest, summary: &Summary) -> Result<Vec<PathBuf>, ReportError> {
    let path = folder.path().join(FILE);
    std::fs::write(&path, report(folder, manifest, summary)?).map_err(ReportError::io(&path))?;
    let plots = plot::FILES.iter().map(|name| folder.path().join("plots").join(name)).filter(|path| path.exists());
    Ok(std::iter::once(path.clone()).chain(plots).collect())
}

/// The page with its places filled, each once: what is filled in is not looked through again.
fn fill(parts: &[(&str, &str)]) -> String {
    let script = SCRIPT.concat();
    let mut page = String::new();
    let mut rest = PAGE;
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

/// Text of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The title of a live run.
#[must_use]
pub fn live_status(facts: &RunFacts) -> String {
    format!("live: {}, {} drones, {}, seed {}", facts.scenario, facts.drones, facts.strategy, facts.seed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_live_page_names_its_own_server_and_nothing_else() {
        let page = live(4321);
        assert!(page.contains("ws://127.0.0.1:4321") && page.contains("<canvas"));
        assert!(!page.contains("{{") && !page.contains("id=\"data\""), "{page}");
        let addresses = page.matches("://").count();
        // Three in the policy and the script, no other address at all.
        assert_eq!(addresses, 3, "{page}");
    }

    #[test]
    fn markup_in_a_name_stays_text() {
        let page = fill(&[("title", &escaped("<b>{{data}}</b>")), ("data", "secret")]);
        assert!(page.contains("<title>&lt;b&gt;{{data}}&lt;/b&gt;</title>"));
        assert_eq!(page.matches("secret").count(), 1);
    }
}
