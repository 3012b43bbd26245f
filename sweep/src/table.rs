//! A sweep's cells as a text table.

use crate::cells::Cell;
use crate::metrics::SUCCESS;
use crate::statistics::Estimate;
use skein_report::number_text::brief;

/// Greatest number of cells in the table. The others are in summary.json and the plots.
pub(crate) const MAX_LINES: usize = 40;

/// The table. Each line is a cell: its scenario and strategy, the keys that vary, the number of runs, and the mean ± half
/// the interval of each metric.
pub(crate) fn table(cells: &[Cell], keys: &[&str], metrics: &[String]) -> String {
    let varies = |&i: &usize| cells.iter().any(|cell| cell.values[i] != cells[0].values[i]);
    let varying: Vec<usize> = (0..keys.len()).filter(varies).collect();
    let mut head = vec!["scenario", "strategy"];
    head.extend(varying.iter().map(|&i| keys[i]));
    head.push("runs");
    head.extend(metrics.iter().map(String::as_str));
    let mut lines: Vec<Vec<String>> = vec![head.into_iter().map(str::to_owned).collect()];
    for cell in cells.iter().take(MAX_LINES) {
        let mut line = vec![cell.scenario.clone(), cell.strategy.clone()];
        line.extend(varying.iter().map(|&i| cell.values[i].clone()));
        let runs = cell.outcomes.values().sum::<usize>();
        line.push(if cell.equal > 0 { format!("{runs}, all equal") } else { runs.to_string() });
        let field = |name: &String| {
            let bound = cell.failures_at_most().filter(|_| name == SUCCESS);
            let bound = bound.map(|share| format!(", at most {:.1} % fail", 100.0 * share));
            shown(name, cell.estimate(name)) + &bound.unwrap_or_default()
        };
        line.extend(metrics.iter().map(field));
        lines.push(line);
    }
    let columns = lines[0].len();
    let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        let padded: Vec<String> = line.iter().zip(&widths).map(|(field, &width)| format!("{field:<width$}")).collect();
        text += padded.join("  ").trim_end();
        text.push('\n');
    }
    if cells.len() > MAX_LINES {
        text += &format!("… and {} more in summary.json\n", cells.len() - MAX_LINES);
    }
    text + &equal_runs(cells, &varying)
}

/// Says which cells have runs with equal digests: their seeds change nothing.
fn equal_runs(cells: &[Cell], varying: &[usize]) -> String {
    let equal: Vec<&Cell> = cells.iter().filter(|cell| cell.equal > 0).collect();
    let Some(first) = equal.first() else { return String::new() };
    let values: Vec<&str> = varying.iter().map(|&i| first.values[i].as_str()).collect();
    let with = if values.is_empty() { String::new() } else { format!(" with {}", values.join(", ")) };
    let more = match equal.len() {
        1 => String::new(),
        count => format!(", and those of {} other cells", count - 1),
    };
    format!(
        "\n{} runs of {}{with} are one flight: their digests are equal{more}. Their seeds change nothing, so they give no \
         interval.\n",
        first.equal, first.scenario
    )
}

fn shown(name: &str, found: Option<Estimate>) -> String {
    match found {
        None => "-".to_owned(),
        Some(found) if name == SUCCESS => {
            let interval = found.interval().map(|[low, high]| format!(" [{:.1}, {:.1}]", 100.0 * low, 100.0 * high));
            format!("{:.1} %{}", 100.0 * found.mean, interval.unwrap_or_default())
        }
        Some(found) => {
            let scale = found.min.abs().max(found.max.abs());
            let half = found.interval().map(|[low, high]| format!(" ± {}", brief((high - low) / 2.0, scale)));
            brief(found.mean, scale) + &half.unwrap_or_default()
        }
    }
}
