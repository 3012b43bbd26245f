//! What is flown besides the paper's own cases, one table each: the look-ahead beside the paper's rule, every end of
//! the mission and energy convention, no queue law, narrow passages, reaction time.

use crate::cases::{GEOMETRIES, LOOK_AHEAD, PAPER, PLACEMENTS, SHORTEST, STRATEGIES, title};
use crate::findings;
use crate::flight::Flight;
use crate::study::{Study, StudyCase};

/// Models of power, each with the key that it changes.
const POWER_MODELS: [(&str, (&str, &str)); 5] = [
    ("paper", ("", "")),
    ("thrust for acceleration", ("energy.thrust", "acceleration")),
    ("head wind of 5 m/s", ("energy.wind_mps", "[-5,0]")),
    ("tail wind of 5 m/s", ("energy.wind_mps", "[5,0]")),
    ("side wind of 5 m/s", ("energy.wind_mps", "[0,5]")),
];

/// All studies.
pub(crate) fn studies(quick: bool) -> Vec<Study> {
    vec![caps(), power(), between(), strategies(), ends(), ablation(quick), narrow(quick), reaction(quick)]
}

fn strategies() -> Study {
    let scenarios = GEOMETRIES.iter().flat_map(|geometry| PLACEMENTS.map(|at| format!("{geometry}-{at}")));
    let case = |scenario: &str| {
        STRATEGIES.map(|strategy| {
            let id = format!("strategies.{scenario}.{strategy}");
            StudyCase::new(id, &[&title(scenario), strategy], Flight::new(scenario, strategy))
        })
    };
    Study {
        heading: "The look-ahead beside the paper's rule",
        labels: &["scenario", "strategy"],
        cases: scenarios.chain(["forest".to_owned()]).flat_map(|scenario| case(&scenario)).collect(),
        finding: findings::strategies,
    }
}

/// The greatest speed while re-forming. The paper gives v ± δ, which is 15 m/s at most, and a limit of 20 m/s.
fn caps() -> Study {
    let scenarios = GEOMETRIES.iter().map(|geometry| format!("{geometry}-right")).chain(["forest".to_owned()]);
    let mut cases = Vec::new();
    for (scenario, cap) in scenarios.flat_map(|scenario| ["10", "15", "20"].map(|cap| (scenario.clone(), cap))) {
        for strategy in [PAPER, SHORTEST] {
            let flight = Flight::new(&scenario, strategy).with("mission.reform_speed_max_mps", cap);
            let id = format!("cap.{scenario}.{cap}.{strategy}");
            cases.push(StudyCase::new(id, &[&title(&scenario), &format!("{cap} m/s"), strategy], flight));
        }
    }
    Study {
        heading: "The greatest speed while re-forming",
        labels: &["scenario", "cap", "strategy"],
        cases,
        finding: findings::caps,
    }
}

/// What the energy is computed from: thrust for acceleration, and airspeed in wind.
fn power() -> Study {
    let scenarios = GEOMETRIES.iter().map(|geometry| format!("{geometry}-right")).chain(["forest".to_owned()]);
    let mut cases = Vec::new();
    for (scenario, (name, key, value)) in
        scenarios.flat_map(|scenario| POWER_MODELS.map(|(name, set)| (scenario.clone(), (name, set.0, set.1))))
    {
        for strategy in [PAPER, SHORTEST] {
            let flight = Flight::new(&scenario, strategy);
            let flight = if key.is_empty() { flight } else { flight.with(key, value) };
            let id = format!("power.{scenario}.{}.{strategy}", name.replace(' ', "-"));
            cases.push(StudyCase::new(id, &[&title(&scenario), name, strategy], flight));
        }
    }
    Study {
        heading: "What power is computed from",
        labels: &["scenario", "power", "strategy"],
        cases,
        finding: findings::power,
    }
}

/// The two sets of the forest, both ways.
fn between() -> Study {
    let mut cases = Vec::new();
    for (name, between) in [("go on", "go-on"), ("close up", "close-up")] {
        for strategy in [PAPER, SHORTEST] {
            let flight = Flight::new("forest", strategy);
            // The scenario file has the paper's way.
            let flight = if between == "go-on" { flight } else { flight.with("mission.between", "close-up") };
            cases.push(StudyCase::new(format!("between.{between}.{strategy}"), &[name, strategy], flight));
        }
    }
    Study {
        heading: "Between the two sets of the forest (G1)",
        labels: &["between the sets", "strategy"],
        cases,
        finding: findings::between,
    }
}

/// An end that is not the scenario's own is set by overrides.
fn ends() -> Study {
    let mut cases = Vec::new();
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
            let case = StudyCase::new(format!("ends.{name}.{end}.{strategy}"), &[&name, end, strategy], flight);
            cases.push(StudyCase { published_kj, ..case });
        }
    }
    Study {
        heading: "Every end of the mission, every energy convention",
        labels: &["geometry", "end", "strategy"],
        cases,
        finding: findings::ends,
    }
}

fn ablation(quick: bool) -> Study {
    let placements: &[&str] = if quick { &["right"] } else { &PLACEMENTS };
    let mut cases = Vec::new();
    for scenario in GEOMETRIES.iter().flat_map(|geometry| placements.iter().map(move |at| format!("{geometry}-{at}"))) {
        for (queue, strategy) in
            ["true", "false"].iter().flat_map(|queue| STRATEGIES.map(|strategy| (*queue, strategy)))
        {
            let flight = queued(Flight::new(&scenario, strategy), queue);
            let id = format!("ablation.{scenario}.queue-{queue}.{strategy}");
            cases.push(StudyCase::new(id, &[&title(&scenario), yes(queue), strategy], flight));
        }
    }
    Study {
        heading: "Without the queue law",
        labels: &["scenario", "queue law", "strategy"],
        cases,
        finding: findings::ablation,
    }
}

/// The scenario files have the queue law; only `false` is set.
fn queued(flight: Flight, queue: &str) -> Flight {
    if queue == "true" { flight } else { flight.with("guidance.queue", queue) }
}

fn yes(queue: &str) -> &'static str {
    if queue == "true" { "yes" } else { "no" }
}

/// Each half of the gap is 60 m wide. The opening in the file is 40 m.
fn narrow(quick: bool) -> Study {
    let widths: &[u32] = if quick { &[40] } else { &[36, 40, 44, 50, 60] };
    let gap = |width: u32, strategy: &str| match width {
        40 => Flight::new("gap", strategy),
        _ => {
            let y_m = 60.0 + f64::from(width) / 2.0;
            Flight::new("gap", strategy).with("obstacle.0.centre_m.1", y_m).with("obstacle.1.centre_m.1", -y_m)
        }
    };
    let mut cases = Vec::new();
    for (queue, strategy) in ["true", "false"].iter().flat_map(|queue| STRATEGIES.map(|strategy| (*queue, strategy))) {
        for &width in widths {
            let id = format!("narrow.gap-{width}.queue-{queue}.{strategy}");
            let passage = format!("gap of {width} m");
            cases.push(StudyCase::new(id, &[&passage, yes(queue), strategy], queued(gap(width, strategy), queue)));
        }
        let id = format!("narrow.door.queue-{queue}.{strategy}");
        let flight = queued(Flight::new("door", strategy), queue);
        cases.push(StudyCase::new(id, &["wall with one opening of 120 m", yes(queue), strategy], flight));
    }
    // A stable sort by passage.
    cases.sort_by(|a, b| a.labels[0].cmp(&b.labels[0]));
    Study {
        heading: "Narrow passages",
        labels: &["passage", "queue law", "strategy"],
        cases,
        finding: findings::narrow,
    }
}

fn reaction(quick: bool) -> Study {
    let times: &[&str] = if quick { &["0", "0.2", "0.5"] } else { &["0", "0.1", "0.2", "0.3", "0.4", "0.5"] };
    let mut cases = Vec::new();
    for (geometry, strategy) in ["s1", "s2"].iter().flat_map(|geometry| [PAPER, LOOK_AHEAD].map(|s| (*geometry, s))) {
        for &t_c in times {
            let flight = Flight::new(&format!("{geometry}-right"), strategy);
            let flight = if t_c == "0" { flight } else { flight.with("drone.reaction_time_s", t_c) };
            let name = title(geometry);
            let id = format!("E4.{name}.{strategy}.t_c-{t_c}");
            cases.push(StudyCase::new(id, &[&name, strategy, &format!("{t_c} s")], flight));
        }
    }
    Study {
        heading: "Time to react (E4)",
        labels: &["geometry", "strategy", "t_c"],
        cases,
        finding: findings::reaction,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_has_its_own_id_and_a_label_for_each_column() {
        let studies = studies(false);
        let cases = || studies.iter().flat_map(|study| study.cases.iter().map(move |case| (study, case)));
        let mut ids: Vec<&String> = cases().map(|(_, case)| &case.id).collect();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), cases().count());
        assert!(cases().all(|(study, case)| study.labels.len() == case.labels.len()));
    }
}
