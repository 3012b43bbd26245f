//! The tables of the page: summary, messages, faults and violations.

use crate::markup::escaped;
use crate::number_text::fixed;
use crate::summary::Summary;
use crate::text;
use skein_protocol::record::Percentiles;

/// Name of the outcome.
pub(super) fn outcome(summary: &Summary) -> String {
    let name = serde_json::to_value(summary.outcome).ok();
    name.as_ref().and_then(|name| name.as_str()).unwrap_or("aborted").to_owned()
}

/// Summary, messages, faults and violations.
pub(super) fn all(summary: &Summary) -> String {
    let lines = text::lines(summary).into_iter().map(|(label, line)| vec![label, line]);
    let mut html = format!("<h2>Summary</h2>{}", table(&[], lines.collect()));
    html += &format!("<h2>Messages</h2>{}", messages(summary));
    html += &section("Faults", &["time (s)", "fault", "drone", "cause", "detail"], faults(summary));
    html += &section("Violated invariants", &["time (s)", "invariant", "drones", "value (m)"], violations(summary));
    html
}

fn section(title: &str, head: &[&str], lines: Vec<Vec<String>>) -> String {
    let content = if lines.is_empty() { "<p>None.</p>".to_owned() } else { table(head, lines) };
    format!("<h2>{title}</h2>{content}")
}

fn table(head: &[&str], lines: Vec<Vec<String>>) -> String {
    let head: String = head.iter().map(|cell| format!("<th>{}</th>", escaped(cell))).collect();
    let line = |line: Vec<String>| {
        let cells: String = line.iter().map(|cell| format!("<td>{}</td>", escaped(cell))).collect();
        format!("<tr>{cells}</tr>")
    };
    let body: String = lines.into_iter().map(line).collect();
    format!("<div class=\"wide\"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>")
}

fn messages(summary: &Summary) -> String {
    let counts = &summary.messages;
    let mut lines = vec![
        vec!["frames sent".to_owned(), counts.sent.to_string()],
        vec!["messages received, over all receivers".to_owned(), counts.delivered.to_string()],
    ];
    let dropped = serde_json::to_value(&counts.dropped).unwrap_or_default();
    for (reason, count) in dropped.as_object().into_iter().flatten() {
        let count = count.as_u64().map_or("unknown".to_owned(), |count| count.to_string());
        lines.push(vec![format!("dropped: {reason}"), count]);
    }
    lines.push(vec!["delay from sending to receiving".to_owned(), percentiles(&counts.delay_s)]);
    lines.push(vec!["age of the last known pose of another drone".to_owned(), percentiles(&counts.age_s)]);
    table(&[], lines)
}

fn percentiles(times: &Percentiles) -> String {
    let ms = |value: Option<f64>| value.map_or("unknown".to_owned(), |s| format!("{:.0} ms", s * 1e3));
    format!(
        "mean {}, median {}, 99th percentile {}, maximum {}",
        ms(times.mean),
        ms(times.p50),
        ms(times.p99),
        ms(times.max)
    )
}

fn name(value: &impl serde::Serialize) -> String {
    let name = serde_json::to_value(value).ok();
    name.as_ref().and_then(|name| name.as_str()).unwrap_or_default().replace('-', " ")
}

fn faults(summary: &Summary) -> Vec<Vec<String>> {
    let line = |fault: &crate::summary::FaultEntry| {
        let cause = if fault.scheduled { "scheduled by the scenario" } else { "not scheduled" };
        vec![
            format!("{:.2}", fault.t_s),
            name(&fault.kind),
            fault.target.map_or_else(|| "all".to_owned(), |drone| drone.to_string()),
            cause.to_owned(),
            fault.detail.clone(),
        ]
    };
    summary.faults.iter().map(line).collect()
}

fn violations(summary: &Summary) -> Vec<Vec<String>> {
    let line = |violation: &crate::summary::Violation| {
        let drones: Vec<String> = violation.drones.iter().map(u32::to_string).collect();
        vec![
            format!("{:.2}", violation.t_s),
            name(&violation.kind),
            drones.join(", "),
            if violation.kind.is_distance() { fixed(violation.value_m, 2) } else { "–".to_owned() },
        ]
    };
    summary.violations.iter().map(line).collect()
}
