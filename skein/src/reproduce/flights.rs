//! Which missions are flown.

use super::flight::Flight;
use super::gain;
use super::studies::studies;
use std::collections::BTreeSet;

/// The paper's rule.
pub const PAPER: &str = "congestion-aware-paper";
/// What the paper compares itself with.
pub const SHORTEST: &str = "shortest-path";
/// What drones do if nothing else is asked for.
pub const DEFAULT: &str = "congestion-aware";
/// The three, as they stand in tables.
pub const STRATEGIES: [&str; 3] = [PAPER, DEFAULT, SHORTEST];
/// The geometries that were searched for: the paper gives none.
pub const GEOMETRIES: [&str; 3] = ["s1", "s2", "s3b"];
/// Where the obstacle is, seen along the flight.
pub const PLACEMENTS: [&str; 3] = ["centred", "left", "right"];
/// Drones in each of these missions.
pub const DRONES: u32 = 8;

/// All flights, none of them twice. `quick` leaves out most seeds and values, and the fixed splits of all geometries but
/// S2.
pub fn flights(quick: bool) -> Vec<Flight> {
    let mut flights = Vec::new();
    for geometry in GEOMETRIES {
        for scenario in PLACEMENTS.map(|placement| format!("{geometry}-{placement}")) {
            flights.extend(STRATEGIES.map(|strategy| Flight::new(&scenario, strategy)));
            if !quick || geometry == "s2" {
                flights.extend((0..=DRONES).map(|left| Flight::new(&scenario, &fixed(left))));
            }
        }
    }
    flights.extend(STRATEGIES.map(|strategy| Flight::new("forest", strategy)));
    for seed in seeds(quick) {
        for scenario in jittered(quick) {
            flights.extend(STRATEGIES.map(|strategy| Flight::new(scenario, strategy).jittered(seed)));
        }
    }
    flights.extend(studies(quick).into_iter().flat_map(|study| study.lines).map(|line| line.flight));
    flights.extend(gain::flights(quick));
    let mut seen = BTreeSet::new();
    flights.retain(|flight| seen.insert(flight.clone()));
    flights
}

/// The strategy that sends so many drones past the left side.
pub fn fixed(left: u32) -> String {
    format!("fixed:{left}/{}", DRONES.saturating_sub(left))
}

/// Seeds of jittered starts.
pub fn seeds(quick: bool) -> std::ops::RangeInclusive<u64> {
    1..=if quick { 8 } else { 30 }
}

/// Scenarios that are flown from jittered starts. S1 has no room for it: its slots are 35 m apart, its safe distance is
/// 33 m.
pub fn jittered(quick: bool) -> &'static [&'static str] {
    if quick { &["s2-right", "forest"] } else { &["s2-right", "forest", "s3b-right"] }
}

/// A geometry's or scenario's name in words: `S2`, `S2-right`.
pub fn title(name: &str) -> String {
    name.strip_prefix('s').map_or_else(|| name.to_owned(), |rest| format!("S{rest}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flight_is_a_scenario_and_the_full_report_flies_what_the_quick_one_does() {
        let all = flights(false);
        all.iter().for_each(|flight| assert_eq!(flight.resolve().map(|_| ()), Ok(()), "{flight:?}"));
        let quick = flights(true);
        assert!(quick.iter().all(|flight| all.contains(flight)));
        assert!(all.len() > 2 * quick.len(), "{} and {}", all.len(), quick.len());
        let jittered = |scenario| all.iter().filter(|f| f.seed.is_some() && f.scenario == scenario).count();
        assert_eq!((jittered("s2-right"), jittered("forest")), (90, 90));
    }
}
