//! Which missions are flown. Their files are part of the program, so that the command works anywhere.

use skein_scenario::{Scenario, Source};

/// The paper's rule.
pub const PAPER: &str = "congestion-aware-paper";
/// What the paper compares itself with.
pub const SHORTEST: &str = "shortest-path";
/// The geometries that were searched for: the paper gives none.
pub const GEOMETRIES: [&str; 3] = ["s1", "s2", "s3b"];
/// Where the obstacle is, seen along the flight.
pub const PLACEMENTS: [&str; 3] = ["centred", "left", "right"];
/// Greatest displacement of a drone's start where starts are jittered, m.
pub const JITTER_M: f64 = 2.0;
/// Drones in each of these missions.
pub const DRONES: u32 = 8;

macro_rules! files {
    ($($name:literal),*) => {
        [$(($name, include_str!(concat!("../../../scenarios/paper/", $name, ".toml")))),*]
    };
}

const FILES: [(&str, &str); 10] = files![
    "s1-centred",
    "s1-left",
    "s1-right",
    "s2-centred",
    "s2-left",
    "s2-right",
    "s3b-centred",
    "s3b-left",
    "s3b-right",
    "forest"
];

/// One mission to fly.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Flight {
    /// Name of the scenario's file, without its ending.
    pub scenario: String,
    /// As on the command line.
    pub strategy: String,
    /// Of the jittered start; `None`: every drone starts in its slot.
    pub seed: Option<u64>,
}

impl Flight {
    /// With every drone in its slot at the start.
    pub fn new(scenario: &str, strategy: &str) -> Self {
        Self { scenario: scenario.to_owned(), strategy: strategy.to_owned(), seed: None }
    }

    /// Repeats it.
    pub fn command(&self) -> String {
        let start = self.seed.map(|seed| format!(" --seed {seed} --set formation.start_jitter_m={JITTER_M}"));
        let Self { scenario, strategy, .. } = self;
        format!("skein run scenarios/paper/{scenario}.toml --strategy {strategy}{}", start.unwrap_or_default())
    }

    /// The scenario; the error says what is wrong with it.
    pub fn resolve(&self) -> Result<Scenario, String> {
        let file = FILES.iter().find(|file| file.0 == self.scenario);
        let (name, text) = file.ok_or_else(|| format!("no scenario {:?}", self.scenario))?;
        let mut overrides = vec![("strategy".to_owned(), format!("{:?}", self.strategy))];
        overrides.extend(self.seed.map(|seed| ("seed".to_owned(), seed.to_string())));
        overrides.extend(self.seed.map(|_| ("formation.start_jitter_m".to_owned(), JITTER_M.to_string())));
        Scenario::parse(text, Source { name, stem: name }, &overrides).map_err(|error| error.to_string())
    }
}

/// All flights. `quick` leaves out most seeds, and the fixed splits of all geometries but S2.
pub fn flights(quick: bool) -> Vec<Flight> {
    let mut flights = Vec::new();
    for geometry in GEOMETRIES {
        for scenario in PLACEMENTS.map(|placement| format!("{geometry}-{placement}")) {
            flights.extend([PAPER, SHORTEST].map(|strategy| Flight::new(&scenario, strategy)));
            if !quick || geometry == "s2" {
                flights.extend((0..=DRONES).map(|left| Flight::new(&scenario, &fixed(left))));
            }
        }
    }
    flights.extend([PAPER, SHORTEST].map(|strategy| Flight::new("forest", strategy)));
    for seed in seeds(quick) {
        for scenario in ["s2-right", "forest"] {
            let flight = |strategy| Flight { seed: Some(seed), ..Flight::new(scenario, strategy) };
            flights.extend([PAPER, SHORTEST].map(flight));
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flight_is_a_scenario_and_none_is_flown_twice() {
        let all = flights(false);
        all.iter().for_each(|flight| assert_eq!(flight.resolve().map(|_| ()), Ok(()), "{flight:?}"));
        let mut unique = all.clone();
        unique.sort();
        unique.dedup();
        assert_eq!((unique.len(), all.len()), (3 * 3 * 11 + 2 + 30 * 4, all.len()));
        assert_eq!(unique.len(), all.len());
        assert!(flights(true).iter().all(|flight| all.contains(flight)));
    }

    #[test]
    fn the_command_names_everything_that_is_not_in_the_file() {
        let flight = Flight { seed: Some(3), ..Flight::new("forest", SHORTEST) };
        let wanted = "skein run scenarios/paper/forest.toml --strategy shortest-path --seed 3 --set \
                      formation.start_jitter_m=2";
        assert_eq!(flight.command(), wanted);
    }
}
