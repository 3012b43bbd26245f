//! From an experiment to the list of its runs.

use super::experiment::{Experiment, Mission};
use super::random::{Bounds, random_scene};
use skein_scenario::{Scenario, ScenarioSource};
use std::path::Path;

/// All runs of an experiment, numbered in the order of runs.csv.
pub struct Grid<'a> {
    experiment: &'a Experiment,
    /// Overrides of every run, from the command line.
    overrides: &'a [(String, String)],
    combinations: Vec<Combination>,
}

/// What a cell of the result stands for: everything but the seed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Combination {
    /// Place in the experiment's list.
    pub scenario: usize,
    /// `None`: as the scenario says.
    pub strategy: Option<String>,
    /// A value, as TOML, for each key of the grid.
    pub values: Vec<String>,
}

impl<'a> Grid<'a> {
    /// Scenario by scenario, strategy by strategy, the grid's last key fastest, then the seeds.
    pub fn new(experiment: &'a Experiment, overrides: &'a [(String, String)]) -> Self {
        let strategies: Vec<Option<String>> = match experiment.strategies.is_empty() {
            true => vec![None],
            false => experiment.strategies.iter().cloned().map(Some).collect(),
        };
        let points = points(experiment);
        let mut combinations = Vec::new();
        for scenario in 0..experiment.scenarios.len() {
            for strategy in &strategies {
                combinations.extend(points.iter().map(|values| Combination {
                    scenario,
                    strategy: strategy.clone(),
                    values: values.clone(),
                }));
            }
        }
        Self { experiment, overrides, combinations }
    }

    /// Number of runs.
    pub fn len(&self) -> usize {
        self.combinations.len() * self.experiment.seeds.len()
    }

    /// Which combination and seed a run has.
    pub fn job(&self, number: usize) -> (&Combination, u64) {
        let seeds = self.experiment.seeds.len();
        (&self.combinations[number / seeds], self.experiment.seeds[number % seeds])
    }

    /// A run's scenario, checked.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn scenario(&self, number: usize) -> Result<Scenario, String> {
        let (combination, seed) = self.job(number);
        let mut overrides = self.changes(combination);
        overrides.push(("seed".to_owned(), seed.to_string()));
        match &self.experiment.scenarios[combination.scenario] {
            Mission::Random => random_scene(seed, self.experiment.bounds, &overrides),
            Mission::File { path, text } => parse(path, text, &overrides),
        }
    }

    /// Checks each combination with its first seed. Another seed can only break the start's jitter, and is then a row
    /// of its own.
    ///
    /// # Errors
    /// The first combination that is no scenario.
    pub fn check(&self) -> Result<(), String> {
        let seeds = self.experiment.seeds.len();
        (0..self.combinations.len()).try_for_each(|number| self.scenario(number * seeds).map(|_| ()))
    }

    /// What a combination changes of its scenario, beside the seed.
    pub fn changes(&self, combination: &Combination) -> Vec<(String, String)> {
        let keys = self.experiment.grid.iter().map(|axis| axis.key.clone());
        let grid = keys.zip(combination.values.iter().cloned());
        let strategy = combination.strategy.iter().map(|word| ("strategy".to_owned(), format!("{word:?}")));
        self.overrides.iter().cloned().chain(grid).chain(strategy).collect()
    }

    /// The scenario's name in rows.
    pub fn scenario_name(&self, combination: &Combination) -> String {
        match &self.experiment.scenarios[combination.scenario] {
            Mission::Random => "random".to_owned(),
            Mission::File { path, .. } => stem(path),
        }
    }

    /// The command that repeats a run. Its processes give the same digest as inline.
    pub fn command(&self, number: usize) -> String {
        let (combination, seed) = self.job(number);
        let (before, path) = match &self.experiment.scenarios[combination.scenario] {
            Mission::File { path, .. } => (String::new(), path.display().to_string()),
            Mission::Random => {
                let file = format!("random-{seed}.toml");
                (format!("skein scene {seed}{} > {file} && ", flags(self.experiment.bounds)), file)
            }
        };
        let mut command = format!("{before}skein run {}", quoted(&path));
        command += &combination.strategy.iter().map(|word| format!(" --strategy {word}")).collect::<String>();
        if before.is_empty() {
            command += &format!(" --seed {seed}");
        }
        for (key, value) in self.changes(combination).iter().filter(|(key, _)| key != "strategy") {
            command += &format!(" --set {}", quoted(&format!("{key}={value}")));
        }
        command
    }
}

/// The arguments of `skein scene` that give these bounds.
fn flags(bounds: Bounds) -> String {
    let flag = |name: &str, [least, most]: [u32; 2], default: [u32; 2]| match [least, most] == default {
        true => String::new(),
        false => format!(" --{name} {least}..{most}"),
    };
    let default = Bounds::default();
    flag("drones", bounds.drones, default.drones) + &flag("obstacles", bounds.obstacles, default.obstacles)
}

fn parse(path: &Path, text: &str, overrides: &[(String, String)]) -> Result<Scenario, String> {
    let (name, stem) = (path.display().to_string(), stem(path));
    Scenario::parse(text, ScenarioSource { name: &name, stem: &stem }, overrides).map_err(|errors| errors.to_string())
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}

/// All combinations of the grid's values, the last key fastest.
fn points(experiment: &Experiment) -> Vec<Vec<String>> {
    experiment.grid.iter().fold(vec![Vec::new()], |points, axis| {
        let longer = |point: &Vec<String>, value: &String| point.iter().chain([value]).cloned().collect();
        points.iter().flat_map(|point| axis.values.iter().map(move |value| longer(point, value))).collect()
    })
}

/// For a shell.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+%@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::super::experiment::Axis;
    use super::*;

    fn experiment() -> Experiment {
        let axis = |key: &str, values: &[&str]| Axis {
            key: key.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
        };
        let text = "[formation]\ndrones = 3\nspacing_m = 60\n".to_owned();
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::File { path: "a b.toml".into(), text }, Mission::Random],
            strategies: vec!["shortest-path".to_owned(), "congestion-aware".to_owned()],
            seeds: vec![4, 9],
            grid: vec![axis("radio.delay_s", &["0", "0.5"]), axis("radio.loss", &["0", "0.1", "0.2"])],
            processes: false,
            metrics: vec![],
            bounds: Bounds { drones: [5, 6], ..Bounds::default() },
        }
    }

    #[test]
    fn every_combination_once_the_seeds_fastest() {
        let experiment = experiment();
        let grid = Grid::new(&experiment, &[]);
        assert_eq!(grid.len(), 2 * 2 * 6 * 2);
        let (first, seed) = grid.job(0);
        assert_eq!((first.scenario, first.values.join(" "), seed), (0, "0 0".to_owned(), 4));
        assert_eq!(grid.job(1).1, 9);
        assert_eq!(grid.job(2).0.values.join(" "), "0 0.1");
        let (last, seed) = grid.job(47);
        assert_eq!((last.scenario, last.strategy.as_deref(), seed), (1, Some("congestion-aware"), 9));
        assert_eq!(last.values.join(" "), "0.5 0.2");
        let mut all = grid.combinations.clone();
        all.dedup();
        assert_eq!(all.len(), 24);
    }

    #[test]
    fn a_run_has_its_seed_strategy_and_values() {
        let experiment = experiment();
        let overrides = [("drone.safe_distance_m".to_owned(), "30".to_owned())];
        let grid = Grid::new(&experiment, &overrides);
        assert_eq!(grid.check(), Ok(()));
        let scenario = grid.scenario(5).unwrap();
        assert_eq!((scenario.seed, scenario.radio.delay_s, scenario.radio.loss), (9, 0.0, 0.2));
        assert_eq!((scenario.strategy.to_string().as_str(), scenario.drone.safe_distance_m), ("shortest-path", 30.0));
        assert_eq!(grid.scenario(47).unwrap().seed, 9);
    }

    #[test]
    fn commands_repeat_their_runs() {
        let experiment = experiment();
        let grid = Grid::new(&experiment, &[]);
        let wanted =
            "skein run 'a b.toml' --strategy shortest-path --seed 9 --set radio.delay_s=0 --set radio.loss=0.2";
        assert_eq!(grid.command(5), wanted);
        let wanted = "skein scene 4 --drones 5..6 > random-4.toml && skein run random-4.toml --strategy shortest-path \
                      --set radio.delay_s=0 --set radio.loss=0";
        assert_eq!(grid.command(24), wanted);
    }

    #[test]
    fn a_combination_that_is_no_scenario_is_found_before_the_flight() {
        let mut experiment = experiment();
        experiment.grid[1].values.push("1.5".to_owned());
        let error = Grid::new(&experiment, &[]).check().unwrap_err();
        assert!(error.contains("--set radio.loss=1.5"), "{error}");
    }
}
