//! The bench as a table.

use super::cases::Case;
use super::{Bench, Row};
use skein_report::plot::sweep::{Lines, Point, Series};
use std::fmt::Write;

/// The table and the ratios.
pub(super) fn text(bench: &Bench) -> String {
    let mut out = format!("{} cores, {} rounds interleaved; medians\n\n", bench.cores, bench.rounds);
    let heads = ["drones", "case", "ticks/s", "steps/s", "× real", "p50", "p99", "max", "calls", "switches"];
    let more = ["cpu", "world", "drones", "RSS", "PSS", "start", "end"];
    let _ = write!(out, "{:>6} {:<31}", heads[0], heads[1]);
    heads[2..].iter().chain(&more).for_each(|head| _ = write!(out, "{head:>9}"));
    let units = [
        "1/s", "1/s", "", "µs", "µs", "µs", "a step", "a step", "µs/step", "µs/step", "µs/step", "MiB", "MiB", "s", "s",
    ];
    let _ = write!(out, "\n{:38}", "");
    units.iter().for_each(|unit| _ = write!(out, "{unit:>9}"));
    out.push('\n');
    bench.rows.iter().for_each(|row| line(&mut out, row));
    out.push_str("\nratios, paired by round\n");
    for ratio in &bench.ratios {
        let (low, high) = ratio.rounds.iter().fold((f64::INFINITY, 0f64), |(l, h), &r| (l.min(r), h.max(r)));
        let what = if ratio.of == "ticks_per_s" { "ticks/s" } else { "CPU a step" };
        let pair = format!("{} / {}", ratio.case.name(), ratio.to.name());
        let _ =
            writeln!(out, "{:>6} {pair:<48} {what:<11} {:>6.2}  ({low:.2} to {high:.2})", ratio.drones, ratio.median);
    }
    out
}

/// CPU time of an agent-step against the size of the swarm, an SVG.
pub(super) fn plot(bench: &Bench) -> Result<String, String> {
    let cases = [Case::Floor, Case::BlockBeacon, Case::Inline, Case::Block, Case::Yield, Case::Packed];
    let series = cases.map(|case| {
        let of_case = bench.rows.iter().filter(|row| row.case == case);
        let point = |row: &Row| {
            let us = row.median.cpu_us_per_step?;
            Some(Point { x: f64::from(row.drones).log2(), mean: us, low: us, high: us })
        };
        Series { label: case.name().to_owned(), points: of_case.filter_map(point).collect() }
    });
    let lines = Lines {
        title: "CPU time of an agent-step, the world's share included: medians".to_owned(),
        x_label: "drones, as a power of two".to_owned(),
        y_label: "CPU time of an agent-step, µs".to_owned(),
        series: series.into_iter().filter(|series| !series.points.is_empty()).collect(),
    };
    lines.draw().map_err(|error| error.to_string())
}

fn line(out: &mut String, row: &Row) {
    let m = &row.median;
    let _ = write!(
        out,
        "{:>6} {:<31}{:>9}{:>9}",
        row.drones,
        row.case.name(),
        short(m.ticks_per_s),
        short(m.agent_steps_per_s)
    );
    let rest = [
        m.realtime_factor,
        m.step_us_p50,
        m.step_us_p99,
        m.step_us_max,
        m.calls_per_step,
        m.switches_per_step,
        m.cpu_us_per_step,
        m.world_us_per_step,
        m.drones_us_per_step,
        m.rss_mib,
        m.pss_mib,
        m.startup_s,
        m.shutdown_s,
    ];
    rest.into_iter().for_each(|value| _ = write!(out, "{:>9}", value.map_or_else(|| "-".to_owned(), short)));
    out.push('\n');
}

/// Three figures that matter.
fn short(value: f64) -> String {
    match value.abs() {
        v if v >= 1e6 => format!("{:.2} M", value / 1e6),
        v if v >= 1e4 => format!("{:.1} k", value / 1e3),
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn three_figures() {
        assert_eq!(
            [short(1_234_567.0), short(31_300.0), short(742.0), short(0.456)],
            ["1.23 M", "31.3 k", "742", "0.46"]
        );
    }
}
