//! A summary for people: the verdict first, then what they ask next.

use crate::summary::{Stage, Summary};
use skein_protocol::record::{Outcome, Percentiles};
use std::fmt::Write;

/// What came of the run, in lines of at most some hundred characters. `colour` sets the verdict in the terminal's
/// colours.
#[must_use]
pub fn summary(summary: &Summary, colour: bool) -> String {
    let mut text = verdict(summary, colour);
    text.push_str("\n\n");
    for (label, line) in lines(summary) {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "  {label:<14}{line}");
    }
    text
}

/// The outcome in a line.
pub(crate) fn verdict(summary: &Summary, colour: bool) -> String {
    let (word, shade, why) = match summary.outcome {
        Outcome::Reached => ("reached", 32, "the formation is closed and every invariant held".to_owned()),
        Outcome::Timeout => ("timeout", 33, "the goal was not reached".to_owned()),
        Outcome::Unsafe => ("unsafe", 31, broken(summary)),
        Outcome::Aborted => ("aborted", 31, "the mission did not come to its end".to_owned()),
    };
    let word = if colour { format!("\x1b[1;{shade}m{word}\x1b[0m") } else { word.to_owned() };
    let said = summary.reason.as_ref().filter(|reason| summary.outcome != Outcome::Reached && !reason.is_empty());
    let reason = said.map_or(String::new(), |reason| format!(" ({reason})"));
    format!("{word} after {:.2} s: {why}{reason}", summary.mission_s)
}

fn broken(summary: &Summary) -> String {
    let count = summary.violations.len();
    let first = summary.violations.first().map(|violation| {
        let kind = serde_json::to_value(violation.kind).ok();
        let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or("violation").replace('-', " ");
        let value = if kind == "separation" || kind == "clearance" {
            format!(", {:.2} m", violation.value_m)
        } else {
            String::new()
        };
        format!(", first at {:.2} s: {kind} of drones {}{value}", violation.t_s, list(&violation.drones))
    });
    let often =
        if count == 1 { "an invariant was broken".to_owned() } else { format!("invariants were broken {count} times") };
    often + &first.unwrap_or_default()
}

/// What comes after the verdict: labels and lines.
pub(crate) fn lines(summary: &Summary) -> Vec<(String, String)> {
    let mut lines = vec![("run".to_owned(), run(summary))];
    for (number, stage) in summary.stages.iter().enumerate() {
        lines.push((format!("stage {}", number + 1), passed(stage)));
        lines.extend(stage.groups.iter().flatten().map(|group| {
            let leader = group.leader.map_or(String::new(), |leader| format!(", led by {leader}"));
            (String::new(), format!("{:<5} route {}: drones {}{leader}", group.name, group.route, list(&group.drones)))
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
    line("leading", Some(leading(summary)));
    line("messages", Some(messages(summary)));
    for fault in &summary.faults {
        let by = if fault.scheduled { "scheduled" } else { "not scheduled" };
        let kind = serde_json::to_value(fault.kind).ok();
        let kind = kind.as_ref().and_then(|kind| kind.as_str()).unwrap_or("fault");
        let whom = fault.target.map_or_else(|| "the swarm".to_owned(), |drone| format!("drone {drone}"));
        line("fault", Some(format!("{:.2} s: {kind}, {whom} ({by}; {})", fault.t_s, fault.detail)));
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
    let time = stage.pass_time_s.map_or("not passed by all".to_owned(), |time| format!("passed in {time:.2} s"));
    let mut text = format!("{time} from {detected:.2} s");
    let split = match (&stage.split_left_right, &stage.split) {
        (Some([left, right]), _) => Some(format!("; {left} left, {right} right")),
        (None, Some(split)) => {
            Some(format!("; {} from right to left", split.iter().map(u32::to_string).collect::<Vec<_>>().join(" / ")))
        }
        (None, None) => None,
    };
    text.extend(split);
    text.extend(stage.predicted_s.map(|forecast| format!("; forecast {forecast:.2} s")));
    let rehearsed = stage.candidates_rehearsed.filter(|&count| count > 0);
    text.extend(rehearsed.map(|count| format!(", {count} groupings rehearsed")));
    text
}

fn reformation(summary: &Summary) -> Option<String> {
    let start = summary.reform_start_s?;
    let end = summary.reform_end_s.map_or("not closed".to_owned(), |end| format!("closed at {end:.2} s"));
    Some(format!("from {start:.2} s, {end}"))
}

fn energy(summary: &Summary) -> String {
    let mut text = format!("{:.3} kJ", summary.energy_j.total / 1e3);
    text.extend(summary.energy_j.until_passed.map(|joule| format!("; {:.3} kJ until passed", joule / 1e3)));
    text.extend(
        summary.energy_j.detection_to_pass.map(|joule| format!(", {:.3} kJ of it since detection", joule / 1e3)),
    );
    text
}

fn distances(summary: &Summary) -> Option<String> {
    let separation = summary.min_separation_m.map(|m| format!("drones {m:.2} m"));
    let clearance = summary.min_clearance_m.map(|m| format!("obstacles {m:.2} m"));
    let both: Vec<String> = separation.into_iter().chain(clearance).collect();
    (!both.is_empty()).then(|| format!("at least: {}", both.join(", ")))
}

fn leading(summary: &Summary) -> String {
    let mut text = match summary.elections {
        1 => "1 election".to_owned(),
        count => format!("{count} elections"),
    };
    if summary.split_brain_s > 0.0 {
        let _ = write!(text, ", two leaders in contact for {:.2} s", summary.split_brain_s);
    }
    let failovers = summary.failover_s.iter().map(|time| time.map_or("never".to_owned(), |s| format!("{s:.2} s")));
    let failovers: Vec<String> = failovers.collect();
    if !failovers.is_empty() {
        let _ = write!(text, "; led again after a leader's death: {}", failovers.join(", "));
    }
    text
}

fn messages(summary: &Summary) -> String {
    let messages = &summary.messages;
    let mut text = format!("{} sent, {} heard", messages.sent, messages.delivered);
    text.extend(messages.duplicates.filter(|&count| count > 0).map(|count| format!(", {count} of them twice")));
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
        let _ = write!(text, "; delay {:.0} ms, p99 {:.0} ms", p50 * 1e3, p99 * 1e3);
    }
    text
}

fn speed(summary: &Summary) -> Option<String> {
    let (wall, factor) = (summary.wall_s?, summary.realtime_factor?);
    let mut text = format!("{:.2} s of wall time, {factor:.1} × real time", wall);
    text.extend(
        summary.step_us.as_ref().map(|step| format!("; a drone's step {:.0} µs, p99 {:.0} µs", step.p50, step.p99)),
    );
    if summary.deadline_misses > 0 {
        let _ = write!(text, "; {} deadlines missed", summary.deadline_misses);
    }
    Some(text)
}

fn list(drones: &[u32]) -> String {
    drones.iter().map(u32::to_string).collect::<Vec<_>>().join(" ")
}
