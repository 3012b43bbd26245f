//! What the studies show, in words that are made of their numbers.

use super::flights::{DEFAULT, GEOMETRIES, PAPER, SHORTEST, title};
use super::results::Results;
use super::rows::{CONVENTIONS, pass_s};
use super::studies::Study;
use skein_report::Summary;

/// Energies closer than this part of each other count as equal.
const EQUAL: f64 = 1e-3;

impl Study {
    /// The flight with these labels, if it reached its goal.
    fn reached<'a>(&self, results: &'a Results, labels: &[&str]) -> Option<&'a Summary> {
        results.reached(&self.lines.iter().find(|line| line.labels == labels)?.flight)
    }

    /// Energy of one flight by that of another, start to end.
    fn ratio(&self, results: &Results, one: &[&str], other: &[&str]) -> Option<f64> {
        Some(self.reached(results, one)?.energy_j.total / self.reached(results, other)?.energy_j.total)
    }

    /// Each first label once, in order.
    fn firsts(&self) -> Vec<&str> {
        let mut firsts: Vec<&str> = self.lines.iter().map(|line| line.labels[0].as_str()).collect();
        firsts.dedup();
        firsts
    }
}

/// How often the default is better than the paper's rule.
pub fn strategies(study: &Study, results: &Results) -> String {
    let against = |other: &str| {
        let ratio = |name: &&str| Some((study.ratio(results, &[name, DEFAULT], &[name, other])?, (*name).to_owned()));
        let mut ratios: Vec<(f64, String)> = study.firsts().iter().filter_map(ratio).collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let less = ratios.iter().filter(|(ratio, _)| *ratio < 1.0 - EQUAL).count();
        let more = ratios.iter().filter(|(ratio, _)| *ratio > 1.0 + EQUAL).count();
        let ends = ratios.first().zip(ratios.last()).map(|(least, most)| {
            format!("from {} in {} to {} in {}", percent(least.0), least.1, percent(most.0), most.1)
        });
        format!("less in {less} and more in {more} of {} scenarios ({})", ratios.len(), ends.unwrap_or_default())
    };
    format!(
        "The rule looks at the time of the last drone alone. Against it the default, `{DEFAULT}`, takes energy, start to \
         end, {}; against shortest path, {}. Differences below 0.1 % count as none.",
        against(PAPER),
        against(SHORTEST)
    )
}

/// How far the ratio depends on the convention.
pub fn ends(study: &Study, results: &Results) -> String {
    let range = |geometry: &str| {
        let name = title(geometry);
        let pair = |end| {
            Some((study.reached(results, &[&name, end, SHORTEST])?, study.reached(results, &[&name, end, PAPER])?, end))
        };
        let pairs = ["hold", "goal"].into_iter().filter_map(pair);
        let ratios = pairs.flat_map(|(shortest, paper, end)| {
            CONVENTIONS.iter().filter_map(move |(_, words, of)| Some((of(shortest)? / of(paper)?, end, *words)))
        });
        let mut ratios: Vec<(f64, &str, &str)> = ratios.collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (least, most) = ratios.first().zip(ratios.last())?;
        Some(format!("{name} from {:.3} ({}, {}) to {:.3} ({}, {})", least.0, least.1, least.2, most.0, most.1, most.2))
    };
    let ranges: Vec<String> = GEOMETRIES.iter().filter_map(|geometry| range(geometry)).collect();
    format!(
        "The paper does not say when a mission ends or when its energy begins to count. With `hold` it ends where the \
         formation is closed again, with `goal` in fixed slots whose front one is at x = 425 m. What shortest path takes \
         by what the paper's rule takes is, by end and convention: {}. The published ratio is 1.147.",
        ranges.join("; ")
    )
}

/// Who wins with and without the law.
pub fn ablation(study: &Study, results: &Results) -> String {
    let of = |name: &str, queue: &str| study.ratio(results, &[name, queue, SHORTEST], &[name, queue, PAPER]);
    let both = |name: &&str| Some(format!("{name} {:.3} and {:.3}", of(name, "yes")?, of(name, "no")?));
    let ratios: Vec<String> = study.firsts().iter().filter_map(both).collect();
    let names = study.firsts();
    let without: Vec<f64> = names.iter().filter_map(|name| of(name, "no")).collect();
    let wins = without.iter().filter(|ratio| **ratio < 1.0 - EQUAL).count();
    let saving = |name: &&str| study.ratio(results, &[name, "no", SHORTEST], &[name, "yes", SHORTEST]);
    let savings: Vec<f64> = names.iter().filter_map(saving).collect();
    let mean = savings.iter().sum::<f64>() / savings.len().max(1) as f64;
    format!(
        "With `guidance.queue = false` drones on one route do not slow down into a single file; the safety filter alone \
         keeps them apart, and in open space they pass abreast. What shortest path takes by what the paper's rule takes, \
         with the law and without: {}. Without the law shortest path is the cheaper of the two in {wins} of {} scenarios, \
         and takes {} of energy against itself with the law, on average: much of the congestion that the rule avoids is \
         made by the queue.",
        ratios.join("; "),
        without.len(),
        percent(mean),
    )
}

/// What the passages do to each strategy.
pub fn narrow(study: &Study, results: &Results) -> String {
    let time = |passage: &str, queue: &str, strategy: &str| {
        let time_s = study.reached(results, &[passage, queue, strategy]).and_then(pass_s);
        time_s.map_or_else(|| "not at all".to_owned(), |time_s| format!("in {time_s:.1} s"))
    };
    let one = |passage: &&str| {
        format!(
            "{passage}: the rule {} with the queue law and {} without, shortest path {} and {}",
            time(passage, "yes", PAPER),
            time(passage, "no", PAPER),
            time(passage, "yes", SHORTEST),
            time(passage, "no", SHORTEST)
        )
    };
    let all: Vec<String> = study.firsts().iter().map(one).collect();
    format!(
        "Where a gap lets one drone through at a time, congestion is real: with the law the rule sends others round, and \
         without it those who go through crowd. How much a queue is ahead of a crowd depends on the gap and on how many \
         come. Where an opening is wide and nobody can avoid \
         it, strategies cannot differ, and the law alone makes the difference. All drones are past: {}.",
        all.join("; ")
    )
}

/// What a time to react costs, and that it is safe.
pub fn reaction(study: &Study, results: &Results) -> String {
    let of = |geometry: &str, t_c: &str| study.reached(results, &[geometry, PAPER, t_c]);
    let one = |geometry: &str, t_c: &str| {
        let (quick, slow) = (of(geometry, "0 s")?, of(geometry, t_c)?);
        Some(format!(
            "{geometry} {} of energy and {:+.1} s to pass at {t_c}",
            percent(slow.energy_j.total / quick.energy_j.total),
            pass_s(slow)? - pass_s(quick)?
        ))
    };
    let cases = study.firsts().into_iter().flat_map(|geometry| ["0.2 s", "0.5 s"].map(|t_c| (geometry, t_c)));
    let costs: Vec<String> = cases.filter_map(|(geometry, t_c)| one(geometry, t_c)).collect();
    let summary = |line: &super::studies::Line| results.get(&line.flight);
    let broken = study.lines.iter().filter(|line| summary(line).is_some_and(|s| !s.violations.is_empty())).count();
    let open = study.lines.iter().filter(|line| results.reached(&line.flight).is_none()).count();
    format!(
        "The paper's runs have t_c = 0. Here `drone.reaction_time_s` delays what a drone does by t_c, and widens its \
         stopping distance by v·t_c (E2, E4) and the distance it keeps from others by t_c (1 m/s + a·t_c). It costs, with \
         the paper's rule: {}. Flights in which a distance was broken: {broken}; flights that did not reach their goal: \
         {open}. What it has commanded but not yet done a drone knows, and it decides for the moment at which a command \
         takes effect: where there is room the delay itself costs nothing. S1 has slots 35 m apart and a safe distance of \
         33 m: there the wider distances leave no room, and its formation closes slowly if at all.",
        costs.join("; ")
    )
}

/// 1.05 as `+5.0 %`.
fn percent(ratio: f64) -> String {
    format!("{:+.1} %", (ratio - 1.0) * 100.0)
}
