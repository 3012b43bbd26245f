//! One mission of the reproduction. The scenario files are part of the program, so that it works in any folder.

use crate::error::MissionError;
use skein_scenario::{Scenario, ScenarioSource};

/// Greatest displacement of a drone's start in flights with jittered starts, m.
pub(crate) const JITTER_M: f64 = 2.0;

macro_rules! files {
    ($($folder:literal / $name:literal),*) => {
        [$(($folder, $name, include_str!(concat!("../../scenarios/", $folder, "/", $name, ".toml")))),*]
    };
}

const FILES: [(&str, &str, &str); 12] = files![
    "paper" / "s1-centred",
    "paper" / "s1-left",
    "paper" / "s1-right",
    "paper" / "s2-centred",
    "paper" / "s2-left",
    "paper" / "s2-right",
    "paper" / "s3b-centred",
    "paper" / "s3b-left",
    "paper" / "s3b-right",
    "paper" / "forest",
    "narrow" / "gap",
    "narrow" / "door"
];

/// One mission to fly: a scenario of the paper, a strategy, a seed and changed keys.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Flight {
    /// Name of the scenario's file, without `.toml`.
    pub scenario: String,
    /// The strategy, as on the command line.
    pub strategy: String,
    /// Seed of the jittered starts; `None`: every drone starts in its slot.
    pub seed: Option<u64>,
    /// Scenario keys that differ from the file, with their values as TOML.
    pub set: Vec<(String, String)>,
}

impl Flight {
    /// A flight in which every drone starts in its slot.
    #[must_use]
    pub fn new(scenario: &str, strategy: &str) -> Self {
        Self { scenario: scenario.to_owned(), strategy: strategy.to_owned(), seed: None, set: Vec::new() }
    }

    /// The same flight with jittered starts.
    #[must_use]
    pub fn jittered(self, seed: u64) -> Self {
        Self { seed: Some(seed), ..self }
    }

    /// The same flight with another value of a scenario key.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl ToString) -> Self {
        self.set.push((key.to_owned(), value.to_string()));
        self
    }

    /// The command that repeats the flight, from the folder that holds `scenarios`.
    #[must_use]
    pub fn command(&self) -> String {
        let folder = self.file().map_or("paper", |file| file.0);
        let mut command = format!("skein run scenarios/{folder}/{}.toml --strategy {}", self.scenario, self.strategy);
        if let Some(seed) = self.seed {
            command += &format!(" --seed {seed} --set formation.start_jitter_m={JITTER_M}");
        }
        for (key, value) in &self.set {
            // A shell would interpret brackets.
            let quote = if value.contains('[') { "'" } else { "" };
            command += &format!(" --set {quote}{key}={value}{quote}");
        }
        command
    }

    /// The checked scenario.
    ///
    /// # Errors
    /// [`MissionError`] if no scenario has this name, or the changes do not fit it.
    pub fn resolve(&self) -> Result<Scenario, MissionError> {
        let (_, name, text) = self.file().ok_or_else(|| MissionError::Unknown(self.scenario.clone()))?;
        let mut overrides = vec![("strategy".to_owned(), format!("{:?}", self.strategy))];
        overrides.extend(self.seed.map(|seed| ("seed".to_owned(), seed.to_string())));
        overrides.extend(self.seed.map(|_| ("formation.start_jitter_m".to_owned(), JITTER_M.to_string())));
        overrides.extend(self.set.iter().cloned());
        Ok(Scenario::parse(text, ScenarioSource { name, stem: name }, &overrides)?)
    }

    fn file(&self) -> Option<&(&str, &str, &str)> {
        FILES.iter().find(|file| file.1 == self.scenario)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_names_everything_that_is_not_in_the_file() {
        let flight = Flight::new("gap", "shortest-path").jittered(3).with("mission.goal_m", "[425,0]");
        let wanted = "skein run scenarios/narrow/gap.toml --strategy shortest-path --seed 3 --set \
                      formation.start_jitter_m=2 --set 'mission.goal_m=[425,0]'";
        assert_eq!(flight.command(), wanted);
        assert_eq!(flight.resolve().unwrap().mission.goal_m, Some([425.0, 0.0]));
    }
}
