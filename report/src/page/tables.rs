//! The summary of a run in tables.

use super::escaped;
use crate::summary::Summary;
use crate::text;
use skein_protocol::record::Percentiles;

/// The outcome's name.
pub(super) fn outcome(summary: &Summary) -> String {
    let name = serde_json::to_value(summary.outcome).ok();
    name.as_ref().and_then(|name| name.as_str()).unwrap_or("aborted").to_owned()
}

/// Summary, messages, faults and violations.
pub(super) fn all(summary: &Summary) -> String {
    let lines = text::lines(summary).into_iter().map(|(label, line)| vec![label, line]);
    let mut html = format!("<h2>Summary</h2>{}", table(&[], lines.collect()));
    html += &format!("<h2>Messages</h2>{}", messages(summary));
    html += &section("Faults", &["time (s)", "what", "drone", "by", "detail"], faults(summary));
    html += &section("Broken invariants", &["time (s)", "what", "drones", "value (m)"], violations(summary));
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
    let said = &summary.messages;
    let mut lines = vec![
        vec!["frames sent".to_owned(), said.sent.to_string()],
        vec!["messages heard, over all receivers".to_owned(), said.delivered.to_string()],
    ];
    let dropped = serde_json::to_value(&said.dropped).unwrap_or_default();
    for (reason, count) in dropped.as_object().into_iter().flatten() {
        let count = count.as_u64().map_or("unknown".to_owned(), |count| count.to_string());
        lines.push(vec![format!("dropped: {reason}"), count]);
    }
    lines.push(vec!["delay from sending to hearing".to_owned(), percentiles(&said.delay_s)]);
    lines.push(vec!["age of a peer's last known pose".to_owned(), percentiles(&said.age_s)]);
    table(&[], lines)
}

fn percentiles(times: &Percentiles) -> String {
    let ms = |value: Option<f64>| value.map_or("unknown".to_owned(), |s| format!("{:.0} ms", s * 1e3));
    format!(
        "mean {}, median {}, 99 % within {}, at most {}",
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
        let by = if fault.scheduled { "the scenario" } else { "nobody: it happened" };
        vec![
            format!("{:.2}", fault.t_s),
            name(&fault.kind),
            fault.target.map_or_else(|| "all".to_owned(), |drone| drone.to_string()),
            by.to_owned(),
            fault.detail.clone(),
        ]
    };
    summary.faults.iter().map(line).collect()
}

fn violations(summary: &Summary) -> Vec<Vec<String>> {
    let line = |broken: &crate::summary::Violation| {
        let drones: Vec<String> = broken.drones.iter().map(u32::to_string).collect();
        vec![format!("{:.2}", broken.t_s), name(&broken.kind), drones.join(", "), format!("{:.2}", broken.value_m)]
    };
    summary.violations.iter().map(line).collect()
}
