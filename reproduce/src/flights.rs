//! The list of missions that are flown.

use crate::cases::{DRONES, GEOMETRIES, PLACEMENTS, STRATEGIES, fixed, jittered, seeds};
use crate::flight::Flight;
use crate::gain;
use crate::studies::studies;
use std::collections::BTreeSet;

/// All flights, each once. A quick reproduction has fewer seeds and values, and fixed splits in S2 alone.
pub(crate) fn flights(quick: bool) -> Vec<Flight> {
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
    flights.extend(studies(quick).into_iter().flat_map(|study| study.cases).map(|case| case.flight));
    flights.extend(gain::flights(quick));
    let mut seen = BTreeSet::new();
    flights.retain(|flight| seen.insert(flight.clone()));
    flights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flight_has_a_valid_scenario_and_the_full_list_contains_the_quick_one() {
        let all = flights(false);
        for flight in &all {
            flight.resolve().unwrap_or_else(|error| panic!("{flight:?}: {error}"));
        }
        let quick = flights(true);
        assert!(quick.iter().all(|flight| all.contains(flight)));
        assert!(all.len() > 2 * quick.len(), "{} and {}", all.len(), quick.len());
        let jittered = |scenario| all.iter().filter(|f| f.seed.is_some() && f.scenario == scenario).count();
        assert_eq!((jittered("s2-right"), jittered("forest")), (90, 90));
    }
}
