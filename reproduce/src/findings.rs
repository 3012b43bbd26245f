//! What the studies show, in words, with numbers from the flights.

use crate::cases::{GEOMETRIES, LOOK_AHEAD, PAPER, SHORTEST, title};
use crate::results::Results;
use crate::row::{CONVENTIONS, pass_s};
use crate::study::{Study, StudyCase};

/// Relative difference below which energies count as equal.
const EQUAL: f64 = 1e-3;

/// How often the look-ahead takes less energy than the others.
pub(crate) fn strategies(study: &Study, results: &Results) -> String {
    let against = |other: &str| {
        let ratio =
            |name: &&str| Some((study.ratio(results, &[name, LOOK_AHEAD], &[name, other])?, (*name).to_owned()));
        let mut ratios: Vec<(f64, String)> = study.first_labels().iter().filter_map(ratio).collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let less = ratios.iter().filter(|(ratio, _)| *ratio < 1.0 - EQUAL).count();
        let more = ratios.iter().filter(|(ratio, _)| *ratio > 1.0 + EQUAL).count();
        let ends = ratios.first().zip(ratios.last()).map(|(least, most)| {
            format!("from {} in {} to {} in {}", percent(least.0), least.1, percent(most.0), most.1)
        });
        format!("less in {less} and more in {more} of {} scenarios ({})", ratios.len(), ends.unwrap_or_default())
    };
    format!(
        "The paper's rule considers only the time of the last drone. Compared with it, the look-ahead, `{LOOK_AHEAD}`, takes energy \
         from start to end: {}. Compared with shortest path: {}. Differences below 0.1 % count as none.",
        against(PAPER),
        against(SHORTEST)
    )
}

/// How much the ratio depends on the speed while re-forming.
pub(crate) fn caps(study: &Study, results: &Results) -> String {
    let ratio = |scenario: &str, cap: &str| study.ratio(results, &[scenario, cap, SHORTEST], &[scenario, cap, PAPER]);
    let of = |scenario: &&str| {
        let ratios = ["10 m/s", "15 m/s", "20 m/s"].map(|cap| ratio(scenario, cap));
        let words = ratios.map(|ratio| ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.3}")));
        format!("{scenario} {}", words.join(" / "))
    };
    let all: Vec<String> = study.first_labels().iter().map(of).collect();
    format!(
        "The paper does not say how fast drones may return to their slots; v + δ is 15 m/s. Energy of shortest path over that \
         of the paper's rule, from start to end, with caps of 10 / 15 / 20 m/s on `mission.reform_speed_max_mps`: {}. The published \
         ratio is 1.147.",
        all.join("; ")
    )
}

/// How much energy and ratio depend on what power is computed from.
pub(crate) fn power(study: &Study, results: &Results) -> String {
    let models: Vec<&str> = {
        let mut models: Vec<&str> = study.cases.iter().map(|case| case.labels[1].as_str()).collect();
        models.truncate(models.len() / study.first_labels().len().max(1));
        models.dedup();
        models
    };
    let ratio = |scenario: &str, model: &str| {
        let ratio = study.ratio(results, &[scenario, model, SHORTEST], &[scenario, model, PAPER]);
        ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.3}"))
    };
    let of = |scenario: &&str| {
        let ratios: Vec<String> = models.iter().map(|model| ratio(scenario, model)).collect();
        format!("{scenario} {}", ratios.join(" / "))
    };
    let all: Vec<String> = study.first_labels().iter().map(of).collect();
    let thrust = |strategy: &str| {
        let of = |scenario: &&str| {
            let energy = |model: &str| Some(study.reached(results, &[scenario, model, strategy])?.energy_j.total);
            Some(percent(energy("thrust for acceleration")? / energy("paper")?))
        };
        study.first_labels().iter().filter_map(of).collect::<Vec<String>>().join(", ")
    };
    format!(
        "The paper's power depends on the speed in still air alone. With `energy.thrust = \"acceleration\"` it is P(V, κ) of Zeng, \
         Xu and Zhang, with κ the thrust over the weight; this adds {} to the energy of the rule, and {} to that of shortest path. With \
         `energy.wind_mps` it is the power of the airspeed. Neither changes a flight. Energy of shortest path over that of the \
         paper's rule, from start to end, with power by {}: {}.",
        thrust(PAPER),
        thrust(SHORTEST),
        models.join(" / "),
        all.join("; ")
    )
}

/// What it changes whether groups close up between two sets.
pub(crate) fn between(study: &Study, results: &Results) -> String {
    let one = |name: &&str| {
        let rule = study.reached(results, &[name, PAPER])?;
        let stage = rule.stages.last()?;
        let split: Vec<String> = stage.split.iter().flatten().rev().map(ToString::to_string).collect();
        Some(format!(
            "{name}: second set detected after {:.1} s and passed after {:.1} s in {}, formation closed after {:.1} s, {:.1} kJ, \
             shortest path over the rule {:.3}",
            stage.detected_s?,
            stage.passed_s?,
            split.join("/"),
            rule.mission_s,
            rule.energy_j.total / 1e3,
            study.ratio(results, &[name, SHORTEST], &[name, PAPER])?
        ))
    };
    let both: Vec<String> = study.first_labels().iter().filter_map(one).collect();
    format!(
        "In the paper, N1 and N2 go on as they are, and split again as soon as they are past the first set: `mission.between = \
         \"go-on\"`, which the scenario file has. Each group closes its own ranks and flies straight to the part of the formation at \
         the destination that its drones will take. With `close-up`, the default of the key, all drones become one formation \
         between the sets. {}.",
        both.join(". ")
    )
}

/// How much the ratio depends on the end of the mission and on the convention.
pub(crate) fn ends(study: &Study, results: &Results) -> String {
    let range = |geometry: &str| {
        let name = title(geometry);
        let pair = |end| {
            Some((study.reached(results, &[&name, end, SHORTEST])?, study.reached(results, &[&name, end, PAPER])?, end))
        };
        let pairs = ["hold", "goal"].into_iter().filter_map(pair);
        let ratios = pairs.flat_map(|(shortest, paper, end)| {
            CONVENTIONS.iter().filter_map(move |convention| {
                let of = convention.energy_j;
                Some((of(shortest)? / of(paper)?, end, convention.words))
            })
        });
        let mut ratios: Vec<(f64, &str, &str)> = ratios.collect();
        ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (least, most) = ratios.first().zip(ratios.last())?;
        Some(format!("{name} from {:.3} ({}, {}) to {:.3} ({}, {})", least.0, least.1, least.2, most.0, most.1, most.2))
    };
    let ranges: Vec<String> = GEOMETRIES.iter().filter_map(|geometry| range(geometry)).collect();
    format!(
        "The paper does not say when a mission ends or from when its energy counts. With `hold` it ends when the formation \
         is closed again; with `goal` it ends in fixed slots, the front one at x = 425 m. Energy of shortest path over that \
         of the paper's rule, by end and convention: {}. The published ratio is 1.147.",
        ranges.join("; ")
    )
}

/// Which strategy takes less energy with and without the queue law.
pub(crate) fn ablation(study: &Study, results: &Results) -> String {
    let of = |name: &str, queue: &str| study.ratio(results, &[name, queue, SHORTEST], &[name, queue, PAPER]);
    let both = |name: &&str| Some(format!("{name} {:.3} and {:.3}", of(name, "yes")?, of(name, "no")?));
    let ratios: Vec<String> = study.first_labels().iter().filter_map(both).collect();
    let names = study.first_labels();
    let without: Vec<f64> = names.iter().filter_map(|name| of(name, "no")).collect();
    let wins = without.iter().filter(|ratio| **ratio < 1.0 - EQUAL).count();
    let saving = |name: &&str| study.ratio(results, &[name, "no", SHORTEST], &[name, "yes", SHORTEST]);
    let savings: Vec<f64> = names.iter().filter_map(saving).collect();
    let mean = savings.iter().sum::<f64>() / savings.len().max(1) as f64;
    format!(
        "With `guidance.queue = false`, drones on one route do not slow down into a single file. The safety filter alone \
         keeps them apart, and in open space they pass abreast. Energy of shortest path over that of the paper's rule, with \
         and without the law: {}. Without the law, shortest path takes less energy in {wins} of {} scenarios, and its own \
         energy changes by {} on average. So the queue itself causes much of the congestion that the rule avoids.",
        ratios.join("; "),
        without.len(),
        percent(mean),
    )
}

/// How long each strategy needs to pass narrow passages.
pub(crate) fn narrow(study: &Study, results: &Results) -> String {
    let time = |passage: &str, queue: &str, strategy: &str| {
        let time_s = study.reached(results, &[passage, queue, strategy]).and_then(pass_s);
        time_s.map_or_else(|| "not at all".to_owned(), |time_s| format!("in {time_s:.1} s"))
    };
    let one = |passage: &&str| {
        format!(
            "{passage}: the rule {} with the queue law and {} without it, shortest path {} and {}",
            time(passage, "yes", PAPER),
            time(passage, "no", PAPER),
            time(passage, "yes", SHORTEST),
            time(passage, "no", SHORTEST)
        )
    };
    let all: Vec<String> = study.first_labels().iter().map(one).collect();
    format!(
        "If a gap lets one drone through at a time, congestion is real. With the queue law, the rule sends other drones \
         round; without it, the drones at the gap crowd. How much faster a queue is than a crowd depends on the gap and on \
         the number of drones. If all drones must use one wide opening, the strategies cannot differ, and only the law makes \
         a difference. All drones are past: {}.",
        all.join("; ")
    )
}

/// What a reaction time costs, and whether it is safe.
pub(crate) fn reaction(study: &Study, results: &Results) -> String {
    let of = |geometry: &str, t_c: &str| study.reached(results, &[geometry, PAPER, t_c]);
    let one = |geometry: &str, t_c: &str| {
        let (quick, slow) = (of(geometry, "0 s")?, of(geometry, t_c)?);
        Some(format!(
            "{geometry} {} of energy and {:+.1} s to pass at {t_c}",
            percent(slow.energy_j.total / quick.energy_j.total),
            pass_s(slow)? - pass_s(quick)?
        ))
    };
    let cases = study.first_labels().into_iter().flat_map(|geometry| ["0.2 s", "0.5 s"].map(|t_c| (geometry, t_c)));
    let costs: Vec<String> = cases.filter_map(|(geometry, t_c)| one(geometry, t_c)).collect();
    let summary = |case: &StudyCase| results.get(&case.flight);
    let broken = study.cases.iter().filter(|case| summary(case).is_some_and(|s| !s.violations.is_empty())).count();
    let open = study.cases.iter().filter(|case| results.reached(&case.flight).is_none()).count();
    format!(
        "The paper's runs have t_c = 0. Here `drone.reaction_time_s` delays each command of a drone by t_c. It widens the \
         stopping distance by v·t_c (E2, E4) and the distance to other drones by t_c (1 m/s + a·t_c). With the paper's rule \
         it costs: {}. Flights with a broken distance: {broken}. Flights that did not reach their goal: {open}. A drone \
         knows the commands that have not taken effect yet, and decides for the moment at which a command takes effect. So \
         the delay itself costs nothing where there is room. S1 has slots 35 m apart and a safe distance of 33 m: the wider \
         distances leave no room there, and its formation closes slowly or not at all.",
        costs.join("; ")
    )
}

/// A ratio as a change: 1.05 as `+5.0 %`.
fn percent(ratio: f64) -> String {
    format!("{:+.1} %", (ratio - 1.0) * 100.0)
}
