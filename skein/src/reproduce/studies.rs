//! What is flown beside the paper's own cases, a table each: the default strategy beside the paper's rule, every end and
//! energy convention, no queue law, narrow passages, reaction time.

use super::flight::Flight;
use super::flights::{DEFAULT, GEOMETRIES, PAPER, PLACEMENTS, SHORTEST, STRATEGIES, title};
use super::results::Results;
use super::says;

/// Flights side by side in a table.
pub struct Study {
    /// Above it.
    pub heading: &'static str,
    /// What its first columns are.
    pub labels: &'static [&'static str],
    /// One a flight.
    pub lines: Vec<Line>,
    /// What it shows, in words.
    pub says: fn(&Study, &Results) -> String,
}

/// A flight of a study.
pub struct Line {
    /// Of its rows in reproduction.json, before the quantity.
    pub id: String,
    /// In the first columns.
    pub labels: Vec<String>,
    /// Which.
    pub flight: Flight,
    /// Energy published for it, kJ, under a convention that the paper does not name.
    pub published_kj: Option<f64>,
}

impl Line {
    fn new(id: String, labels: &[&str], flight: Flight) -> Self {
        Self { id, labels: labels.iter().map(|&label| label.to_owned()).collect(), flight, published_kj: None }
    }
}

/// All of them.
pub fn studies(quick: bool) -> Vec<Study> {
    vec![strategies(), ends(), ablation(quick), narrow(quick), reaction(quick)]
}

fn strategies() -> Study {
    let scenarios = GEOMETRIES.iter().flat_map(|geometry| PLACEMENTS.map(|at| format!("{geometry}-{at}")));
    let line = |scenario: &str| {
        STRATEGIES.map(|strategy| {
            let id = format!("strategies.{scenario}.{strategy}");
            Line::new(id, &[&title(scenario), strategy], Flight::new(scenario, strategy))
        })
    };
    Study {
        heading: "The default strategy beside the paper's rule",
        labels: &["scenario", "strategy"],
        lines: scenarios.chain(["forest".to_owned()]).flat_map(|scenario| line(&scenario)).collect(),
        says: says::strategies,
    }
}

/// The end that is not the scenario's own is set by hand.
fn ends() -> Study {
    let mut lines = Vec::new();
    for (geometry, end) in GEOMETRIES.iter().flat_map(|geometry| ["hold", "goal"].map(|end| (*geometry, end))) {
        for strategy in STRATEGIES {
            let flight = Flight::new(&format!("{geometry}-right"), strategy);
            let flight = match (geometry, end) {
                ("s3b", "hold") => flight.with("mission.end", "hold"),
                ("s1" | "s2", "goal") => flight.with("mission.end", "goal").with("mission.goal_m", "[425,0]"),
                _ => flight,
            };
            let name = title(geometry);
            let published_kj = match strategy {
                PAPER => Some(54.111),
                SHORTEST => Some(62.084),
                _ => None,
            };
            let line = Line::new(format!("ends.{name}.{end}.{strategy}"), &[&name, end, strategy], flight);
            lines.push(Line { published_kj, ..line });
        }
    }
    Study {
        heading: "Every end of the mission, every energy convention",
        labels: &["geometry", "end", "strategy"],
        lines,
        says: says::ends,
    }
}

fn ablation(quick: bool) -> Study {
    let placements: &[&str] = if quick { &["right"] } else { &PLACEMENTS };
    let mut lines = Vec::new();
    for scenario in GEOMETRIES.iter().flat_map(|geometry| placements.iter().map(move |at| format!("{geometry}-{at}"))) {
        for (queue, strategy) in
            ["true", "false"].iter().flat_map(|queue| STRATEGIES.map(|strategy| (*queue, strategy)))
        {
            let flight = queued(Flight::new(&scenario, strategy), queue);
            let id = format!("ablation.{scenario}.queue-{queue}.{strategy}");
            lines.push(Line::new(id, &[&title(&scenario), yes(queue), strategy], flight));
        }
    }
    Study {
        heading: "Without the queue law",
        labels: &["scenario", "queue law", "strategy"],
        lines,
        says: says::ablation,
    }
}

/// The scenario as it is has the queue law.
fn queued(flight: Flight, queue: &str) -> Flight {
    if queue == "true" { flight } else { flight.with("guidance.queue", queue) }
}

fn yes(queue: &str) -> &'static str {
    if queue == "true" { "yes" } else { "no" }
}

/// Obstacle halves of the gap are 60 m wide, its own opening is 40 m.
fn narrow(quick: bool) -> Study {
    let widths: &[u32] = if quick { &[40] } else { &[36, 40, 44, 50, 60] };
    let gap = |width: u32, strategy: &str| match width {
        40 => Flight::new("gap", strategy),
        _ => {
            let y_m = 60.0 + f64::from(width) / 2.0;
            Flight::new("gap", strategy).with("obstacle.0.centre_m.1", y_m).with("obstacle.1.centre_m.1", -y_m)
        }
    };
    let mut lines = Vec::new();
    for (queue, strategy) in ["true", "false"].iter().flat_map(|queue| STRATEGIES.map(|strategy| (*queue, strategy))) {
        for &width in widths {
            let id = format!("narrow.gap-{width}.queue-{queue}.{strategy}");
            let passage = format!("gap of {width} m");
            lines.push(Line::new(id, &[&passage, yes(queue), strategy], queued(gap(width, strategy), queue)));
        }
        let id = format!("narrow.door.queue-{queue}.{strategy}");
        let flight = queued(Flight::new("door", strategy), queue);
        lines.push(Line::new(id, &["wall with one opening of 120 m", yes(queue), strategy], flight));
    }
    // By passage, then as they were made.
    lines.sort_by(|a, b| a.labels[0].cmp(&b.labels[0]));
    Study { heading: "Narrow passages", labels: &["passage", "queue law", "strategy"], lines, says: says::narrow }
}

fn reaction(quick: bool) -> Study {
    let times: &[&str] = if quick { &["0", "0.2", "0.5"] } else { &["0", "0.1", "0.2", "0.3", "0.4", "0.5"] };
    let mut lines = Vec::new();
    for (geometry, strategy) in ["s1", "s2"].iter().flat_map(|geometry| [PAPER, DEFAULT].map(|s| (*geometry, s))) {
        for &t_c in times {
            let flight = Flight::new(&format!("{geometry}-right"), strategy);
            let flight = if t_c == "0" { flight } else { flight.with("drone.reaction_time_s", t_c) };
            let name = title(geometry);
            let id = format!("E4.{name}.{strategy}.t_c-{t_c}");
            lines.push(Line::new(id, &[&name, strategy, &format!("{t_c} s")], flight));
        }
    }
    Study { heading: "Time to react (E4)", labels: &["geometry", "strategy", "t_c"], lines, says: says::reaction }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_has_an_id_of_its_own_and_a_label_for_each_column() {
        let studies = studies(false);
        let lines = || studies.iter().flat_map(|study| study.lines.iter().map(move |line| (study, line)));
        let mut ids: Vec<&String> = lines().map(|(_, line)| &line.id).collect();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), lines().count());
        assert!(lines().all(|(study, line)| study.labels.len() == line.labels.len()));
    }
}
