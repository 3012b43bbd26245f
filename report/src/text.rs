//! The summary as text for a terminal: the outcome first, then the details.

use crate::number_text::{brief, fixed};
use crate::summary::{FailureEntry, OwnMetric, Stage, StageGroup, Summary};
use skein_protocol::record::{Outcome, Percentiles};
use std::borrow::Cow;
use std::fmt::Write;

/// The summary of a run in several lines. `colour` prints the outcome with ANSI colours.
#[must_use]
pub fn summary(summary: &Summary, colour: bool) -> String {
    let plain = outcome(summary);
    let mut text = printable(&plain).into_owned();
    if colour {
        let word = text.find(' ').unwrap_or(text.len());
        text.replace_range(..word, &format!("\x1b[1;{}m{}\x1b[0m", shade(summary.outcome), &text[..word]));
    }
    text.push_str("\n\n");
    for (label, line) in lines(summary) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {label:<14}{}", printable(&line));
    }
    text
}

/// The text with its control characters replaced, except for line feeds and tabs. A text from a file may hold sequences that
/// steer a terminal.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    let steers = |c: char| c.is_control() && c != '\n' && c != '\t';
    if text.contains(steers) { text.replace(steers, "\u{fffd}").into() } else { text.into() }
}

/// A split as the option `fixed:L/R` has it: the number of drones on each route, from the leftmost route to the rightmost,
/// such as `6/2`. `drones` begins with the rightmost route, as [`Stage::split`] does.
#[must_use]
pub fn split(drones: &[u32]) -> String {
    drones.iter().rev().map(u32::to_string).collect::<Vec<_>>().join("/")
}

/// The pilot that flies unless a scenario names another one. It needs no line.
const DEFAULT_PILOT: &str = "paper";
/// The reason that the world gives for the end of a mission whose formation is closed.
const FORMATION_CLOSED: &str = "the end condition is met";

/// The ANSI colour of an outcome.
fn shade(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Reached => 32,
        Outcome::Timeout | Outcome::Stuck => 33,
        Outcome::Unsafe | Outcome::Aborted => 31,
    }
}

/// The outcome in one line.
pub(crate) fn outcome(summary: &Summary) -> String {
    let (word, why) = match summary.outcome {
        Outcome::Reached => ("reached", reached(summary)),
        Outcome::Timeout => ("timeout", "the goal was not reached".to_owned()),
        Outcome::Stuck => ("stuck", "some drones cannot reach the goal".to_owned()),
        Outcome::Unsafe => ("unsafe", violations(summary)),
        Outcome::Aborted => ("aborted", "the mission did not reach its end".to_owned()),
    };
    let reason = summary.reason.as_ref().filter(|reason| summary.outcome != Outcome::Reached && !reason.is_empty());
    let reason = reason.map_or(String::new(), |reason| format!(" ({reason})"));
    format!("{word} after {:.2} s: {why}{reason}", summary.mission_s)
}

/// What was reached. Missions that end with a formation have one reason; others say their own.
fn reached(summary: &Summary) -> String {
    let closed = summary.reason.as_deref().is_none_or(|reason| reason.is_empty() || reason == FORMATION_CLOSED);
    let what = if closed { "the formation is closed" } else { summary.reason.as_deref().unwrap_or_default() };
    format!("{what} and every invariant held")
}

fn violations(summary: &Summary) -> String {
    let count = summary.violations.len();
    let first = summary.violations.first().map(|violation| {
        let kind = serde_json::to_value(violation.kind).ok();
        let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or("violation").replace('-', " ");
        let distance = violation.kind.is_distance();
        let value = if distance { format!(", {} m", fixed(violation.value_m, 2)) } else { String::new() };
        format!(", first at {:.2} s: {kind} of drones {}{value}", violation.t_s, list(&violation.drones))
    });
    let number = if count == 1 {
        "an invariant was violated".to_owned()
    } else {
        format!("invariants were violated {count} times")
    };
    number + &first.unwrap_or_default()
}

/// The details: labels and lines.
pub(crate) fn lines(summary: &Summary) -> Vec<(String, String)> {
    let mut lines = vec![("run".to_owned(), run(summary))];
    for (number, stage) in summary.stages.iter().enumerate() {
        lines.push((format!("stage {}", number + 1), passed(stage)));
        lines.extend(stage.groups.iter().flatten().map(|group| {
            let (name, route, drones) = (&group.name, group.route, list(&group.drones));
            (String::new(), format!("{name:<5} route {route}: drones {drones}{}", led_by(stage, group)))
        }));
    }
    let mut line = |label: &str, text: Option<String>| lines.extend(text.map(|text| (label.to_owned(), text)));
    line("reformation", reformation(summary));
    line(
        "formation",
        summary.formation_error_m.map(|worst| {
            let rmse = summary.formation_rmse_m.unwrap_or(worst);
            format!("largest slot error {worst:.2} m, root mean square {rmse:.2} m")
        }),
    );
    line("energy", Some(energy(summary)));
    line("distances", distances(summary));
    line("leadership", Some(leadership(summary)));
    line("messages", Some(messages(summary)));
    for pilot in summary.pilots.iter().filter(|pilot| pilot.name != DEFAULT_PILOT) {
        line("pilot", Some(format!("{} flies drones {}", pilot.name, list(&pilot.drones))));
    }
    for (name, figure) in &summary.metrics_own {
        let OwnMetric { mean, last, min, max } = figure;
        let shown = [mean, last, min, max].map(|&value| brief(value, min.abs().max(max.abs())));
        let [mean, last, min, max] = shown;
        line("figure", Some(format!("{name}: mean {mean}, last {last}, from {min} to {max}")));
    }
    for failure in &summary.failures {
        let FailureEntry { t_s, drone, pilot, reason } = failure;
        line("failure", Some(format!("{t_s:.2} s: pilot {pilot} of drone {drone}: {reason}")));
    }
    for fault in &summary.faults {
        let by = if fault.scheduled { "scheduled" } else { "not scheduled" };
        let kind = serde_json::to_value(fault.kind).ok();
        let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or("fault");
        let target = fault.target.map_or_else(|| "the swarm".to_owned(), |drone| format!("drone {drone}"));
        line("fault", Some(format!("{:.2} s: {kind}, {target} ({by}; {})", fault.t_s, fault.detail)));
    }
    line("speed", speed(summary));
    line("digest", summary.digest.clone());
    lines
}

fn run(summary: &Summary) -> String {
    let Summary { scenario, drones, strategy, seed, runtime, clock, .. } = summary;
    format!("{scenario}: {drones} drones, {strategy}, seed {seed}, {runtime}, {clock}")
}

fn passed(stage: &Stage) -> String {
    let Some(detected) = stage.detected_s else { return "not detected".to_owned() };
    let time = stage.pass_time_s.map_or("not passed by all drones".to_owned(), |time| format!("passed in {time:.2} s"));
    let mut text = format!("{time} from {detected:.2} s");
    text.extend(stage.split.as_deref().map(|drones| format!("; split {}, left to right", split(drones))));
    text.extend(stage.predicted_s.map(|predicted_s| format!("; predicted {predicted_s:.2} s")));
    let simulated = stage.candidates_rehearsed.filter(|&count| count > 0);
    text.extend(simulated.map(|count| format!(", {count} groupings simulated")));
    text
}

/// Who led a group. A leader that passed in another group is named with it.
fn led_by(stage: &Stage, group: &StageGroup) -> String {
    let Some(leader) = group.leader else { return ", led by no drone".to_owned() };
    if group.drones.contains(&leader) {
        return format!(", led by {leader}");
    }
    let own = stage.groups.iter().flatten().find(|group| group.drones.contains(&leader));
    match own {
        Some(own) => format!(", led by {leader} of {} on route {}", own.name, own.route),
        None => format!(", led by {leader}, which did not pass"),
    }
}

fn reformation(summary: &Summary) -> Option<String> {
    let start = summary.reform_start_s?;
    let end = summary.reform_end_s.map_or("not closed".to_owned(), |end| format!("closed at {end:.2} s"));
    Some(format!("from {start:.2} s, {end}"))
}

fn energy(summary: &Summary) -> String {
    let mut text = format!("{:.3} kJ", summary.energy_j.total / 1e3);
    text.extend(
        summary
            .energy_j
            .until_passed
            .map(|joule| format!("; {:.3} kJ until the last obstacle was passed", joule / 1e3)),
    );
    text.extend(
        summary
            .energy_j
            .detection_to_pass
            .map(|joule| format!(", {:.3} kJ of it since the first detection", joule / 1e3)),
    );
    text
}

fn distances(summary: &Summary) -> Option<String> {
    let separation = summary.min_separation_m.map(|m| format!("{m:.2} m between drones"));
    let clearance = summary.min_clearance_m.map(|m| format!("{} m to obstacles", fixed(m, 2)));
    let both: Vec<String> = separation.into_iter().chain(clearance).collect();
    (!both.is_empty()).then(|| format!("minimum: {}", both.join(", ")))
}

fn leadership(summary: &Summary) -> String {
    let mut text = match summary.elections {
        1 => "1 election".to_owned(),
        count => format!("{count} elections"),
    };
    if summary.split_brain_s > 0.0 {
        let _ = write!(text, ", two leaders of a group in contact for {:.2} s", summary.split_brain_s);
    }
    let failovers =
        summary.failover_s.iter().map(|time| time.map_or("until the end".to_owned(), |s| format!("{s:.2} s")));
    let failovers: Vec<String> = failovers.collect();
    if !failovers.is_empty() {
        let _ = write!(text, "; time without a leader after a leader's death or freeze: {}", failovers.join(", "));
    }
    text
}

fn messages(summary: &Summary) -> String {
    let messages = &summary.messages;
    let mut text = format!("{} sent, {} received", messages.sent, messages.delivered);
    text.extend(messages.duplicates.filter(|&count| count > 0).map(|count| format!(", {count} duplicates")));
    let dropped = &messages.dropped;
    let reasons = [
        ("loss", dropped.loss),
        ("burst", dropped.burst),
        ("range", dropped.range),
        ("partition", dropped.partition),
        ("deaf", dropped.deaf),
        ("malformed", dropped.malformed),
        ("queue", dropped.queue),
    ];
    for (reason, count) in reasons {
        text.extend(count.filter(|&count| count > 0).map(|count| format!(", {count} dropped ({reason})")));
    }
    if let Percentiles { p50: Some(p50), p99: Some(p99), .. } = messages.delay_s {
        let _ = write!(text, "; delay: median {:.0} ms, p99 {:.0} ms", p50 * 1e3, p99 * 1e3);
    }
    text
}

fn speed(summary: &Summary) -> Option<String> {
    let (wall, factor) = (summary.wall_s?, summary.realtime_factor?);
    let mut text = format!("{:.2} s of wall time, {factor:.1} × real time", wall);
    text.extend(
        summary
            .step_us
            .as_ref()
            .map(|step| format!("; step of a drone: median {:.0} µs, p99 {:.0} µs", step.p50, step.p99)),
    );
    if summary.deadline_misses > 0 {
        let _ = write!(text, "; {} deadlines missed", summary.deadline_misses);
    }
    Some(text)
}

fn list(drones: &[u32]) -> String {
    drones.iter().map(u32::to_string).collect::<Vec<_>>().join(" ")
}
