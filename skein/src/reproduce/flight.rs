//! One mission to fly. The scenario files are part of the program, so that the command works anywhere.

use skein_scenario::{Scenario, ScenarioSource};

/// Greatest displacement of a drone's start where starts are jittered, m.
pub const JITTER_M: f64 = 2.0;

macro_rules! files {
    ($($folder:literal / $name:literal),*) => {
        [$(($folder, $name, include_str!(concat!("../../../scenarios/", $folder, "/", $name, ".toml")))),*]
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

/// One mission to fly.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Flight {
    /// Name of the scenario's file, without its ending.
    pub scenario: String,
    /// As on the command line.
    pub strategy: String,
    /// Of the jittered start; `None`: every drone starts in its slot.
    pub seed: Option<u64>,
    /// Keys that differ from the file, and their values as TOML.
    pub set: Vec<(String, String)>,
}

impl Flight {
    /// With every drone in its slot at the start.
    pub fn new(scenario: &str, strategy: &str) -> Self {
        Self { scenario: scenario.to_owned(), strategy: strategy.to_owned(), seed: None, set: Vec::new() }
    }

    /// The same with jittered starts.
    pub fn jittered(self, seed: u64) -> Self {
        Self { seed: Some(seed), ..self }
    }

    /// The same with another value of a key.
    pub fn with(mut self, key: &str, value: impl ToString) -> Self {
        self.set.push((key.to_owned(), value.to_string()));
        self
    }

    /// Repeats it, from the folder that holds `scenarios`.
    pub fn command(&self) -> String {
        let folder = self.file().map_or("paper", |file| file.0);
        let mut command = format!("skein run scenarios/{folder}/{}.toml --strategy {}", self.scenario, self.strategy);
        if let Some(seed) = self.seed {
            command += &format!(" --seed {seed} --set formation.start_jitter_m={JITTER_M}");
        }
        for (key, value) in &self.set {
            // A shell would take brackets for itself.
            let quote = if value.contains('[') { "'" } else { "" };
            command += &format!(" --set {quote}{key}={value}{quote}");
        }
        command
    }

    /// The scenario; the error says what is wrong with it.
    pub fn resolve(&self) -> Result<Scenario, String> {
        let (_, name, text) = self.file().ok_or_else(|| format!("no scenario {:?}", self.scenario))?;
        let mut overrides = vec![("strategy".to_owned(), format!("{:?}", self.strategy))];
        overrides.extend(self.seed.map(|seed| ("seed".to_owned(), seed.to_string())));
        overrides.extend(self.seed.map(|_| ("formation.start_jitter_m".to_owned(), JITTER_M.to_string())));
        overrides.extend(self.set.iter().cloned());
        Scenario::parse(text, ScenarioSource { name, stem: name }, &overrides).map_err(|error| error.to_string())
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
