//! An experiment: which missions a sweep flies. Read from TOML and checked.

use crate::axis_values::AxisValues;
use crate::error::{ExperimentError, Problem, SceneError};
use crate::file_place::{Spot, line_column, span_of};
use crate::item_problem::ItemProblem;
use crate::limits::MAX_VALUES;
use crate::metrics::{METRICS, SUCCESS, metric, own_name};
use crate::random_scene::SceneBounds;
use crate::run_count::RunCount;
use serde::{Deserialize, Serialize};
use skein_scenario::did_you_mean;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use toml::de::DeTable;

/// The missions of a sweep: every scenario with every strategy, every value of the grid and every seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Name of the experiment. The default folder has the same name.
    pub name: String,
    /// The missions to fly.
    pub scenarios: Vec<Mission>,
    /// Strategies to fly, as on the command line. Empty: each scenario's own strategy.
    pub strategies: Vec<String>,
    /// Where each strategy stands, as `file:line:column`. Empty if it stands in no file.
    #[serde(default)]
    pub strategy_places: Vec<String>,
    /// Seeds, in the order in which they are flown.
    pub seeds: Vec<u64>,
    /// Scenario keys that vary, with the values of each.
    pub grid: Vec<Axis>,
    /// Whether each run is a swarm of processes. Otherwise a run is flown inline, in one thread.
    pub processes: bool,
    /// Names of the metrics that are plotted and tabled. `None`: the most important ones, and every figure that pilots
    /// report.
    pub metrics: Option<Vec<String>>,
    /// Size of random scenes.
    pub bounds: SceneBounds,
}

/// A mission to fly.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mission {
    /// A scenario file and its text.
    File {
        /// Where the file is.
        path: PathBuf,
        /// What stands in it, TOML.
        text: String,
    },
    /// A random scene, another one for each seed.
    Random,
    /// A wide random scene, another one for each seed.
    Wide,
}

/// A scenario key and the values that it takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Path of the key, such as `radio.loss`.
    pub key: String,
    /// Values, as TOML.
    pub values: Vec<String>,
    /// Where each value stands, as `file:line:column`. Empty if it stands in no file.
    pub places: Vec<String>,
}

/// The experiment as it stands in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    name: Option<String>,
    scenario: OneOrMany,
    #[serde(default)]
    strategies: Vec<String>,
    seeds: Seeds,
    #[serde(default)]
    runtime: Runtime,
    metrics: Option<Vec<String>>,
    #[serde(default)]
    grid: toml::Table,
    #[serde(default)]
    random: RawBounds,
}

const KEYS: [&str; 8] = ["name", "scenario", "strategies", "seeds", "runtime", "metrics", "grid", "random"];

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a scenario file, a list of them, \"random\" or \"wide\"")]
enum OneOrMany {
    One(String),
    Many(Vec<String>),
}

impl OneOrMany {
    fn names(&self) -> Vec<String> {
        match self {
            Self::One(name) => vec![name.clone()],
            Self::Many(names) => names.clone(),
        }
    }
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number of seeds, a list of seeds, or { from, count }")]
enum Seeds {
    Count(u64),
    List(Vec<u64>),
    From(SeedRange),
}

impl Seeds {
    /// Number of seeds.
    fn count(&self) -> u64 {
        match self {
            Self::Count(count) | Self::From(SeedRange { count, .. }) => *count,
            Self::List(seeds) => seeds.len() as u64,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SeedRange {
    from: u64,
    count: u64,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Runtime {
    #[default]
    Inline,
    Processes,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct RawBounds {
    drones: Option<[u32; 2]>,
    obstacles: Option<[u32; 2]>,
    room_m: Option<u32>,
}

/// Greatest seed of a scenario: the greatest whole number of TOML.
const MAX_SEED: u64 = i64::MAX as u64;

impl Experiment {
    /// Reads the experiment file at `path`. Paths of scenario files in it are relative to its folder.
    ///
    /// # Errors
    /// [`ExperimentError`], which names the file, the line and the column.
    pub fn read(path: &Path) -> Result<Self, ExperimentError> {
        let read = std::fs::read_to_string(path);
        let text = read.map_err(|source| ExperimentError::Read { path: path.to_owned(), source })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Self::placed(&text, &path.display().to_string(), &stem, folder)
    }

    /// Parses an experiment from text. `name` is its name unless the text gives another one. Paths of scenario files in
    /// the text are relative to `folder`.
    ///
    /// # Errors
    /// [`ExperimentError::Invalid`], which names `name`, the line and the column.
    pub fn parse(text: &str, name: &str, folder: &Path) -> Result<Self, ExperimentError> {
        Self::placed(text, name, name, folder)
    }

    /// `file`: what messages call the text.
    fn placed(text: &str, file: &str, stem: &str, folder: &Path) -> Result<Self, ExperimentError> {
        let read = || -> Result<Self, Fault> {
            let table = DeTable::parse(text).map_err(Fault::toml)?;
            let mut experiment = Self::checked(text, table.get_ref(), stem, folder)?;
            experiment.find_places(table.get_ref(), file, text);
            Ok(experiment)
        };
        read().map_err(|fault| fault.at(file, text))
    }

    fn checked(text: &str, table: &DeTable<'_>, stem: &str, folder: &Path) -> Result<Self, Fault> {
        known_keys(table)?;
        let raw: Raw = toml::from_str(text).map_err(Fault::toml)?;
        let fault = |path: &str| {
            let path = path.to_owned();
            move |ItemProblem { item, problem }| Fault::of(table, &path, item.into(), problem)
        };
        let axes = axes(&raw.grid);
        let scenarios = raw.scenario.names();
        check_count(&raw, &axes, scenarios.len())
            .map_err(|(path, problem)| Fault::of(table, &path, Spot::Value, problem))?;
        let name = raw.name.unwrap_or_else(|| stem.to_owned());
        Ok(Self {
            name: checked_name(name).map_err(|problem| fault("name")(problem.into()))?,
            scenarios: missions(&scenarios, folder).map_err(fault("scenario"))?,
            strategies: checked_strategies(raw.strategies).map_err(fault("strategies"))?,
            strategy_places: Vec::new(),
            seeds: seeds(raw.seeds).map_err(fault("seeds"))?,
            grid: checked_axes(axes, table)?,
            processes: matches!(raw.runtime, Runtime::Processes),
            metrics: metrics(raw.metrics).map_err(fault("metrics"))?,
            bounds: bounds(&raw.random).map_err(|error| Fault::of_bounds(table, error))?,
        })
    }

    /// Notes where strategies and values of the grid stand, for errors that only the scenarios show.
    fn find_places(&mut self, table: &DeTable<'_>, file: &str, text: &str) {
        let places = |path: &str, items: usize| {
            let mut last = (None, String::new());
            let place = |number| {
                let start = span_of(table, path, Spot::Item(number)).map(|span| span.start);
                // All values of a range stand at the same place.
                if start != last.0 {
                    let (line, column) = line_column(text, start.unwrap_or(0));
                    last = (start, format!("{file}:{line}:{column}"));
                }
                last.1.clone()
            };
            (0..items).map(place).collect()
        };
        self.strategy_places = places("strategies", self.strategies.len());
        for axis in &mut self.grid {
            axis.places = places(&format!("grid.{}", axis.key), axis.values.len());
        }
    }
}

/// A problem and its place in the text.
#[derive(Debug)]
struct Fault {
    span: Option<Range<usize>>,
    problem: Box<Problem>,
}

impl Fault {
    fn toml(error: toml::de::Error) -> Self {
        Self { span: error.span(), problem: Box::new(Problem::Toml(error.message().to_owned())) }
    }

    /// A problem with the key of this path, such as `grid.radio.loss`.
    fn of(table: &DeTable<'_>, path: &str, spot: Spot, problem: Box<Problem>) -> Self {
        Self { span: span_of(table, path, spot), problem }
    }

    fn of_bounds(table: &DeTable<'_>, error: SceneError) -> Self {
        let path = match &error {
            SceneError::Bounds { what, .. } => format!("random.{what}"),
            _ => "random.room_m".to_owned(),
        };
        Self::of(table, &path, Spot::Value, Box::new(error.into()))
    }

    fn at(self, name: &str, text: &str) -> ExperimentError {
        let place = self.span.map(|span| line_column(text, span.start));
        ExperimentError::Invalid { name: name.to_owned(), place, problem: self.problem }
    }
}

fn known_keys(table: &DeTable<'_>) -> Result<(), Fault> {
    for key in table.keys() {
        let found: &str = key.get_ref();
        if !KEYS.contains(&found) {
            let suggestion = did_you_mean(found, KEYS);
            let problem = Problem::UnknownKey { found: found.to_owned(), suggestion, expected: KEYS.join(", ") };
            return Err(Fault { span: Some(key.span()), problem: Box::new(problem) });
        }
    }
    Ok(())
}

/// Refuses an experiment with too many runs, with the path of a key, before its seeds and values are written out.
fn check_count(raw: &Raw, axes: &[(String, AxisValues<'_>)], scenarios: usize) -> Result<(), (String, Box<Problem>)> {
    let mut count = RunCount::of_seeds(raw.seeds.count());
    count.times("scenario", scenarios as u64);
    count.times("strategies", raw.strategies.len() as u64);
    for (key, values) in axes {
        count.times(&format!("grid.{key}"), values.count());
    }
    count.check()
}

fn checked_name(name: String) -> Result<String, Problem> {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    match name.len() {
        1..=64 if name.chars().all(fits) && !name.starts_with(['.', '-']) => Ok(name),
        _ => Err(Problem::Name(name)),
    }
}

fn missions(names: &[String], folder: &Path) -> Result<Vec<Mission>, ItemProblem> {
    if names.is_empty() {
        let expected = "a scenario file, \"random\" or \"wide\"";
        return Err(Problem::EmptyList { key: "scenario".to_owned(), expected }.into());
    }
    ItemProblem::unless_unique("scenario", names)?;
    let mission = |(number, name): (usize, &String)| {
        if name == "random" {
            return Ok(Mission::Random);
        }
        if name == "wide" {
            return Ok(Mission::Wide);
        }
        let path = tidy(&folder.join(name));
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(Mission::File { path, text }),
            Err(source) => Err(ItemProblem::of_item(number, Problem::ScenarioFile { path, source })),
        }
    };
    names.iter().enumerate().map(mission).collect()
}

/// Removes `folder/..` from a path, so that commands stay readable.
fn tidy(path: &Path) -> PathBuf {
    let mut tidy = PathBuf::new();
    for part in path.components() {
        let in_folder = matches!(tidy.components().next_back(), Some(Component::Normal(_)));
        match part {
            Component::ParentDir if in_folder && !tidy.is_symlink() => {
                tidy.pop();
            }
            part => tidy.push(part),
        }
    }
    tidy
}

fn checked_strategies(strategies: Vec<String>) -> Result<Vec<String>, ItemProblem> {
    for (number, word) in strategies.iter().enumerate() {
        word.parse::<skein_scenario::Strategy>().map_err(|error| ItemProblem::of_item(number, error.into()))?;
    }
    ItemProblem::unless_unique("strategies", &strategies)?;
    Ok(strategies)
}

fn seeds(written: Seeds) -> Result<Vec<u64>, ItemProblem> {
    let range = match written {
        Seeds::List(seeds) => return listed_seeds(seeds),
        Seeds::Count(count) => SeedRange { from: 1, count },
        Seeds::From(range) => range,
    };
    if !(1..=MAX_VALUES).contains(&range.count) {
        return Err(Problem::SeedCount { found: range.count, most: MAX_VALUES }.into());
    }
    // The TOML reader has checked that neither number is greater than an i64.
    let behind = range.from + range.count;
    if behind > MAX_SEED + 1 {
        return Err(Problem::SeedTooGreat { found: behind - 1, most: MAX_SEED }.into());
    }
    Ok((range.from..behind).collect())
}

/// Each seed is in the range of a TOML integer, because the TOML reader has checked that.
fn listed_seeds(seeds: Vec<u64>) -> Result<Vec<u64>, ItemProblem> {
    if seeds.is_empty() {
        return Err(Problem::EmptyList { key: "seeds".to_owned(), expected: "at least one" }.into());
    }
    ItemProblem::unless_unique("seeds", &seeds)?;
    Ok(seeds)
}

/// The keys of the grid with their values, sorted. Nested tables give keys with dots.
fn axes(grid: &toml::Table) -> Vec<(String, AxisValues<'_>)> {
    let mut axes = Vec::new();
    collect(grid, "", &mut axes);
    axes.sort_by(|(a, _), (b, _)| a.cmp(b));
    axes
}

fn collect<'a>(table: &'a toml::Table, path: &str, axes: &mut Vec<(String, AxisValues<'a>)>) {
    for (name, value) in table {
        let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value {
            toml::Value::Table(range) if range.contains_key("steps") || range.contains_key("from") => {
                axes.push((key, AxisValues::Range(range)));
            }
            toml::Value::Table(inner) => collect(inner, &key, axes),
            toml::Value::Array(values) => axes.push((key, AxisValues::List(values))),
            one => axes.push((key, AxisValues::One(one))),
        }
    }
}

fn checked_axes(axes: Vec<(String, AxisValues<'_>)>, table: &DeTable<'_>) -> Result<Vec<Axis>, Fault> {
    let fault = |key: &str, spot, problem| Fault::of(table, &format!("grid.{key}"), spot, problem);
    if let Some(twice) = axes.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let key = &twice[1].0;
        let problem = Problem::Repeated { key: "grid".to_owned(), item: format!("{key:?}") };
        return Err(fault(key, Spot::Key, Box::new(problem)));
    }
    if let Some((key, _)) = axes.iter().find(|(key, _)| matches!(key.as_str(), "seed" | "strategy" | "name")) {
        return Err(fault(key, Spot::Key, Box::new(Problem::ReservedKey(key.clone()))));
    }
    let axis = |(key, values): (String, AxisValues<'_>)| {
        let wrong = |ItemProblem { item, problem }| fault(&key, item.into(), problem);
        let values = values.written(&key).map_err(wrong)?;
        Ok(Axis { key, values, places: Vec::new() })
    };
    axes.into_iter().map(axis).collect()
}

fn metrics(written: Option<Vec<String>>) -> Result<Option<Vec<String>>, ItemProblem> {
    let Some(written) = written else { return Ok(None) };
    ItemProblem::unless_unique("metrics", &written)?;
    let known: Vec<&str> = std::iter::once(SUCCESS).chain(METRICS.iter().map(|metric| metric.name)).collect();
    let is_known = |name: &String| *name == SUCCESS || metric(name).is_some() || own_name(name).is_some();
    match written.iter().position(|name| !is_known(name)) {
        None => Ok(Some(written)),
        Some(number) => {
            let found = written[number].clone();
            let suggestion = did_you_mean(&found, known.iter().copied());
            let expected = format!(
                "{}, or metric.NAME for a figure that pilots report (also metric.NAME.last, .min and .max)",
                known.join(", ")
            );
            Err(ItemProblem::of_item(number, Problem::UnknownMetric { found, suggestion, expected }))
        }
    }
}

fn bounds(written: &RawBounds) -> Result<SceneBounds, SceneError> {
    let default = SceneBounds::default();
    let bounds = SceneBounds {
        drones: written.drones.unwrap_or(default.drones),
        obstacles: written.obstacles.unwrap_or(default.obstacles),
        room_m: written.room_m,
    };
    bounds.checked()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Experiment, String> {
        Experiment::placed(text, "e.toml", "stem", Path::new("")).map_err(|error| error.to_string())
    }

    #[test]
    fn lists_ranges_and_tables_make_a_grid() {
        let text = "scenario = \"random\"\nseeds = { from = 5, count = 3 }\n[grid]\n\"radio.delay_s\" = [0, 0.5]\n\
                    radio.loss = { from = 0, to = 0.7, steps = 8 }\nformation.shape = \"v\"\n\
                    \"fault.0\" = [{ kind = \"kill\" }, { kind = \"mute\", for_s = 2 }]\n";
        let experiment = parse(text).unwrap();
        assert_eq!(experiment.name, "stem");
        assert_eq!(experiment.seeds, [5, 6, 7]);
        let axes: Vec<(&str, String)> =
            experiment.grid.iter().map(|axis| (axis.key.as_str(), axis.values.join(" "))).collect();
        let wanted = [
            ("fault.0", "{ kind = \"kill\" } { for_s = 2, kind = \"mute\" }"),
            ("formation.shape", "\"v\""),
            ("radio.delay_s", "0 0.5"),
            ("radio.loss", "0 0.1 0.2 0.3 0.4 0.5 0.6 0.7"),
        ];
        assert_eq!(axes, wanted.map(|(key, values)| (key, values.to_owned())));
    }

    #[test]
    fn errors_name_place_and_expectation() {
        let head = "scenario = \"random\"\nseeds = 3\n";
        for (rest, wanted) in [
            ("sedes = 3", "e.toml:3:1: unknown key \"sedes\", expected one of name, "),
            ("sedes = 3", "random; did you mean `seeds`?"),
            ("metrics = [\"order\", \"mision_s\"]", "e.toml:3:21: metrics: unknown \"mision_s\", expected some of "),
            ("metrics = [\"mision_s\"]", "; did you mean `mission_s`?"),
            ("strategies = [\"shortest-path\", \"shortest\"]", "e.toml:3:32: strategies: \"shortest\" is no strategy"),
            ("strategies = [\"fixed:1/2\", \"fixed:1/2\"]", "e.toml:3:28: strategies: \"fixed:1/2\" is there twice"),
            ("[grid]\nradio.delay_s = 0\nradio.loss = []", "e.toml:5:14: grid: radio.loss: found an empty list"),
            ("[grid]\n\"radio.loss\" = [0, 1, 1]", "e.toml:4:23: grid: radio.loss: \"1\" is there twice"),
            ("[grid]\nradio.loss = 0\n\"radio.loss\" = 1", "is there twice"),
            ("[grid]\nradio.loss = { from = 0, to = 1 }", "e.toml:4:14: grid: radio.loss: expected { from = NUMBER"),
            ("[grid]\nradio.loss = 0\nseed = [1, 2]", "e.toml:5:1: grid: seed cannot be a key of the grid"),
            ("[random]\nobstacles = [1, 2]\ndrones = [9, 5]", "e.toml:5:10: random: drones: found 9 to 5"),
            ("[random]\nroom_m = 1", "e.toml:4:10: random: room_m: found 1"),
            ("[random]\ndrone = [5, 9]", "e.toml:4:1: unknown field `drone`"),
            ("runtime = \"outline\"", "e.toml:3:11: unknown variant `outline`"),
            ("name = \"../x\"", "e.toml:3:8: name: found \"../x\""),
        ] {
            let error = parse(&format!("{head}{rest}")).unwrap_err();
            assert!(error.contains(wanted), "{rest}: {error}");
        }
        let missing = parse("seeds = 1").unwrap_err();
        assert!(missing.contains("scenario"), "{missing}");
        let absent = parse("scenario = \"no/such.toml\"\nseeds = 1").unwrap_err();
        assert!(absent.contains("e.toml:1:12: scenario: no/such.toml"), "{absent}");
        assert!(parse("scenario = \"random\"\nseeds = 0").unwrap_err().contains("expected 1 to"));
        let seeds = |seeds: &str| parse(&format!("scenario = \"random\"\nseeds = {seeds}")).unwrap_err();
        assert_eq!(seeds("[1, 2, 1]"), "e.toml:2:16: seeds: 1 is there twice");
        let last = seeds("{ from = 9223372036854775800, count = 9 }");
        assert_eq!(
            last,
            "e.toml:2:9: seeds: found seeds up to 9223372036854775808, expected at most 9223372036854775807"
        );
        let twice = parse("scenario = [\"random\", \"wide\", \"random\"]\nseeds = 1").unwrap_err();
        assert!(twice.contains("e.toml:1:31: scenario: \"random\" is there twice"), "{twice}");
    }

    #[test]
    fn too_many_runs_are_refused_before_they_are_made() {
        let range = |key: char| format!("radio.{key} = {{ from = 0, to = 1, steps = 1000000 }}\n");
        let all: String = ('a'..='z').map(range).collect();
        let error = parse(&format!("scenario = \"random\"\nseeds = 1000000\n[grid]\nx = [1, 2]\n{all}")).unwrap_err();
        assert!(error.starts_with("e.toml:2:9: found more than 10^38 runs"), "{error}");
        let error = parse("scenario = \"random\"\nseeds = 10\n[grid]\nradio.a = { from = 0, to = 1, steps = 1000001 }");
        let wanted =
            "e.toml:4:11: found 10000010 runs, 1000001 cells with 10 seeds each, expected at most 10000000 runs";
        assert_eq!(error.unwrap_err(), wanted);
    }

    #[test]
    fn parent_folders_are_removed_from_paths() {
        assert_eq!(tidy(Path::new("experiments/../scenarios/a.toml")), Path::new("scenarios/a.toml"));
        assert_eq!(tidy(Path::new("../x/./a.toml")), Path::new("../x/a.toml"));
    }
}
