//! The runs of an experiment: every combination of scenario, strategy and grid values, with every seed.

use crate::error::{JobError, SceneError};
use crate::experiment::{Experiment, Mission};
use crate::program_name::{SKEIN, quoted};
use crate::random_scene::{SceneBounds, random_scene, scene_toml};
use crate::wide_scene::{wide_scene, wide_scene_toml};
use skein_runtime::{PilotProblem, PilotRegistry, resolve_commands};
use skein_scenario::{Scenario, ScenarioErrors, ScenarioSource};
use std::path::Path;

/// All runs of an experiment. A run is known by its job number, from 0, in the order of runs.csv.
#[derive(Debug)]
pub struct Grid<'a> {
    experiment: &'a Experiment,
    /// Overrides of every run, from the command line.
    overrides: &'a [(String, String)],
    combinations: Vec<Combination>,
    /// The beginning of the commands that repeat runs.
    program: String,
}

/// Everything that a run has besides its seed. The runs of one combination are averaged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Combination {
    /// Index of the scenario in the experiment's list.
    pub scenario: usize,
    /// The strategy; `None`: the scenario's own.
    pub strategy: Option<String>,
    /// One value, as TOML, for each key of the grid.
    pub values: Vec<String>,
}

impl<'a> Grid<'a> {
    /// The runs of an experiment with these overrides (key path and TOML value) in each. The seed varies fastest, then
    /// the grid's last key, then the strategy, then the scenario.
    #[must_use]
    pub fn new(experiment: &'a Experiment, overrides: &'a [(String, String)]) -> Self {
        let strategies: Vec<Option<String>> = if experiment.strategies.is_empty() {
            vec![None]
        } else {
            experiment.strategies.iter().cloned().map(Some).collect()
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
        Self { experiment, overrides, combinations, program: SKEIN.to_owned() }
    }

    /// Sets the program that flies the runs, as a shell reads it: the commands that repeat them begin with it. The default is `skein`.
    #[must_use]
    pub fn program(self, program: impl Into<String>) -> Self {
        Self { program: program.into(), ..self }
    }

    /// The program that flies the runs.
    #[must_use]
    pub fn program_name(&self) -> &str {
        &self.program
    }

    /// The experiment.
    #[must_use]
    pub fn experiment(&self) -> &'a Experiment {
        self.experiment
    }

    /// Overrides of every run.
    #[must_use]
    pub fn overrides(&self) -> &'a [(String, String)] {
        self.overrides
    }

    /// Keys that the grid varies.
    #[must_use]
    pub fn keys(&self) -> Vec<&'a str> {
        self.experiment.grid.iter().map(|axis| axis.key.as_str()).collect()
    }

    /// Number of runs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.combinations.len() * self.experiment.seeds.len()
    }

    /// Whether there are no runs.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Combination and seed of a run.
    ///
    /// # Panics
    /// If `number` is not below [`Grid::len`].
    #[must_use]
    pub fn job(&self, number: usize) -> (&Combination, u64) {
        let seeds = self.experiment.seeds.len();
        (&self.combinations[number / seeds], self.experiment.seeds[number % seeds])
    }

    /// The checked scenario of a run.
    ///
    /// # Errors
    /// [`JobError`] if the scenario is not valid.
    pub fn scenario(&self, number: usize) -> Result<Scenario, JobError> {
        let (combination, seed) = self.job(number);
        let overrides = self.overrides_of(number);
        match &self.experiment.scenarios[combination.scenario] {
            Mission::Random => {
                let scene = random_scene(seed, self.experiment.bounds, &overrides);
                scene.map_err(|error| self.placed_in_scene(combination, error))
            }
            Mission::Wide => wide_scene(seed, &overrides).map_err(|error| self.placed_in_scene(combination, error)),
            Mission::File { path, text } => {
                let parsed = named(path, |source| Scenario::parse(text, source, &overrides));
                let mut scenario = parsed.map_err(|errors| self.placed(combination, errors))?;
                resolve_commands(&mut scenario, path.parent().unwrap_or(Path::new("")));
                Ok(scenario)
            }
        }
    }

    /// Everything that a run changes of its scenario.
    fn overrides_of(&self, number: usize) -> Vec<(String, String)> {
        let (combination, seed) = self.job(number);
        let mut overrides = self.changes(combination);
        overrides.push(("seed".to_owned(), seed.to_string()));
        overrides
    }

    /// Gives an error in a strategy or in a value of the grid its place in the experiment file.
    fn placed(&self, combination: &Combination, errors: ScenarioErrors) -> ScenarioErrors {
        let Experiment { strategies, strategy_places, grid, .. } = self.experiment;
        let strategy =
            combination.strategy.iter().map(|word| (format!("strategy={word:?}"), word, strategies, strategy_places));
        let axes = grid.iter().zip(&combination.values);
        let axes = axes.map(|(axis, value)| (format!("{}={value}", axis.key), value, &axis.values, &axis.places));
        let changes: Vec<_> = strategy.chain(axes).collect();
        errors.with_places(|place| {
            let change = place.strip_prefix("--set ")?;
            let (_, value, values, places) = changes.iter().find(|(known, ..)| known == change)?;
            places.get(values.iter().position(|known| known == *value)?).cloned()
        })
    }

    fn placed_in_scene(&self, combination: &Combination, error: SceneError) -> JobError {
        match error {
            SceneError::Overrides(errors) => self.placed(combination, errors).into(),
            error => error.into(),
        }
    }

    /// Checks each combination, and that these pilots can fly it, with its first seed. `inline`: in this process. Another seed can only change the start's jitter; if that makes the
    /// scenario invalid, the run gets a row with the outcome `invalid`.
    ///
    /// # Errors
    /// The first combination that is not a valid scenario.
    pub fn check(&self, pilots: &PilotRegistry, inline: bool) -> Result<(), JobError> {
        let seeds = self.experiment.seeds.len();
        for number in 0..self.combinations.len() {
            let number = number * seeds;
            pilots.check(&self.scenario(number)?, inline).map_err(|problem| self.blamed(number, problem))?;
        }
        Ok(())
    }

    /// Gives a problem of the pilots its place in the scenario or in the experiment.
    fn blamed(&self, number: usize, problem: PilotProblem) -> JobError {
        let (combination, seed) = self.job(number);
        let overrides = self.overrides_of(number);
        let blame = |text: &str, source: ScenarioSource<'_>| {
            let errors = Scenario::blame(text, source, &overrides, problem.keys(), problem.message());
            self.placed(combination, errors).into()
        };
        let scene = |kind: &str, text: Result<String, SceneError>| {
            let name = format!("{kind}-{seed}");
            text.map_or_else(JobError::from, |text| blame(&text, ScenarioSource { name: &name, stem: &name }))
        };
        match &self.experiment.scenarios[combination.scenario] {
            Mission::File { path, text } => named(path, |source| blame(text, source)),
            Mission::Random => scene("random", scene_toml(seed, self.experiment.bounds)),
            Mission::Wide => scene("wide", wide_scene_toml(seed)),
        }
    }

    /// What a combination changes of its scenario, besides the seed.
    fn changes(&self, combination: &Combination) -> Vec<(String, String)> {
        let keys = self.experiment.grid.iter().map(|axis| axis.key.clone());
        let grid = keys.zip(combination.values.iter().cloned());
        let strategy = combination.strategy.iter().map(|word| ("strategy".to_owned(), format!("{word:?}")));
        self.overrides.iter().cloned().chain(grid).chain(strategy).collect()
    }

    /// Name of the combination's scenario, as it stands in rows.
    #[must_use]
    pub fn scenario_name(&self, combination: &Combination) -> String {
        match &self.experiment.scenarios[combination.scenario] {
            Mission::Random => "random".to_owned(),
            Mission::Wide => "wide".to_owned(),
            Mission::File { path, .. } => stem(path),
        }
    }

    /// The command that repeats a run, in processes: the digest is the same as inline.
    #[must_use]
    pub fn command(&self, number: usize) -> String {
        let (combination, seed) = self.job(number);
        let program = &self.program;
        let (before, path) = match &self.experiment.scenarios[combination.scenario] {
            Mission::File { path, .. } => (String::new(), path.display().to_string()),
            Mission::Wide => {
                let file = format!("wide-{seed}.toml");
                (format!("{program} scene --wide {seed} > {file} && "), file)
            }
            Mission::Random => {
                let file = format!("random-{seed}.toml");
                (format!("{program} scene {seed}{} > {file} && ", flags(self.experiment.bounds)), file)
            }
        };
        let mut command = format!("{before}{program} run {}", quoted(&path));
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
fn flags(bounds: SceneBounds) -> String {
    let flag = |name: &str, [least, most]: [u32; 2], default: [u32; 2]| {
        if [least, most] == default { String::new() } else { format!(" --{name} {least}..{most}") }
    };
    let default = SceneBounds::default();
    let room = bounds.room_m.map_or(String::new(), |room_m| format!(" --room {room_m}"));
    flag("drones", bounds.drones, default.drones) + &flag("obstacles", bounds.obstacles, default.obstacles) + &room
}

/// Calls `read` with the names of a scenario file.
fn named<R>(path: &Path, read: impl FnOnce(ScenarioSource<'_>) -> R) -> R {
    let (name, stem) = (path.display().to_string(), stem(path));
    read(ScenarioSource { name: &name, stem: &stem })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Axis;

    fn experiment() -> Experiment {
        let axis = |key: &str, values: &[&str]| Axis {
            key: key.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
            places: Vec::new(),
        };
        let text = "[formation]\ndrones = 3\nspacing_m = 60\n".to_owned();
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::File { path: "a b.toml".into(), text }, Mission::Random],
            strategies: vec!["shortest-path".to_owned(), "congestion-aware".to_owned()],
            strategy_places: Vec::new(),
            seeds: vec![4, 9],
            grid: vec![axis("radio.delay_s", &["0", "0.5"]), axis("radio.loss", &["0", "0.1", "0.2"])],
            processes: false,
            metrics: None,
            bounds: SceneBounds { drones: [5, 6], ..SceneBounds::default() },
        }
    }

    #[test]
    fn every_combination_comes_once_and_seeds_vary_fastest() {
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
        grid.check(&PilotRegistry::built_in().unwrap(), true).unwrap();
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
        let own = grid.program("python3 boids.py");
        assert!(own.command(5).starts_with("python3 boids.py run 'a b.toml' --strategy"), "{}", own.command(5));
        let scene =
            "python3 boids.py scene 4 --drones 5..6 > random-4.toml && python3 boids.py run random-4.toml --strategy";
        assert!(own.command(24).starts_with(scene), "{}", own.command(24));
    }

    #[test]
    fn an_invalid_combination_is_found_before_the_flight() {
        let mut experiment = experiment();
        experiment.grid[1].values.push("1.5".to_owned());
        let error =
            Grid::new(&experiment, &[]).check(&PilotRegistry::built_in().unwrap(), true).unwrap_err().to_string();
        assert!(error.contains("--set radio.loss=1.5"), "{error}");
    }

    #[test]
    fn what_only_a_scenario_shows_has_its_place_in_the_experiment() {
        let pilots = PilotRegistry::built_in().unwrap();
        let refused = |scenario: &str, rest: &str| {
            let text = format!("scenario = {scenario:?}\nseeds = 1\n{rest}");
            let experiment = Experiment::parse(&text, "e.toml", Path::new("../scenarios/paper")).unwrap();
            Grid::new(&experiment, &[]).check(&pilots, true).unwrap_err().to_string()
        };
        for scenario in ["random", "wide", "s2-right.toml"] {
            for (rest, place) in [
                ("strategies = [\"shortest-path\", \"fixed:99/1\"]", "e.toml:3:32: strategy: "),
                ("[grid]\nradio.loss = [0, 1.5]", "e.toml:4:18: radio.loss: "),
                ("[grid]\n\"drone.safe_distance_m\" = [20, 900]", "e.toml:4:32: "),
                ("[grid]\npilot.0.name = \"papr\"", "e.toml:4:16: pilot.0.name: "),
            ] {
                let error = refused(scenario, rest);
                assert!(error.starts_with(place), "{scenario}, {rest}: {error}");
            }
        }
    }
}
