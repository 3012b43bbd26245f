//! Whether a file is a scenario or an experiment.

/// Keys that an experiment has and a scenario has not.
const OF_EXPERIMENTS: [&str; 3] = ["seeds", "scenario", "grid"];
/// Keys that a scenario has and an experiment has not.
const OF_SCENARIOS: [&str; 5] = ["formation", "mission", "obstacle", "drone", "sensors"];

/// What a TOML file describes, judged by its keys alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// A mission: `skein run` flies it.
    Scenario,
    /// Many missions: `skein sweep` flies them.
    Experiment,
    /// Neither, or not TOML.
    Unknown,
}

impl FileKind {
    /// The kind of a file with this text.
    #[must_use]
    pub fn of(text: &str) -> Self {
        let Ok(table) = toml::from_str::<toml::Table>(text) else { return Self::Unknown };
        let any = |keys: &[&str]| keys.iter().any(|&key| table.contains_key(key));
        match (any(&OF_EXPERIMENTS), any(&OF_SCENARIOS)) {
            (true, false) => Self::Experiment,
            (false, true) => Self::Scenario,
            _ => Self::Unknown,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_judged_by_its_keys() {
        assert_eq!(FileKind::of("scenario = \"random\"\nseeds = 3\n"), FileKind::Experiment);
        assert_eq!(FileKind::of("name = \"x\"\n[formation]\ndrones = 3\n"), FileKind::Scenario);
        for text in ["", "name = \"x\"", "seeds = 3\n[formation]", "seeds ="] {
            assert_eq!(FileKind::of(text), FileKind::Unknown, "{text}");
        }
    }
}
