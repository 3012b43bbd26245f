//! An experiment: which missions a sweep flies. Read from TOML and checked.

use crate::error::{ExperimentError, Problem};
use crate::metrics::{METRICS, SUCCESS, metric, own_name};
use crate::random_scene::SceneBounds;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// The missions of a sweep: every scenario with every strategy, every value of the grid and every seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Name of the experiment. The default folder has the same name.
    pub name: String,
    /// The missions to fly.
    pub scenarios: Vec<Mission>,
    /// Strategies to fly, as on the command line. Empty: each scenario's own strategy.
    pub strategies: Vec<String>,
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

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number of seeds, a list of seeds, or { from, count }")]
enum Seeds {
    Count(u64),
    List(Vec<u64>),
    From(SeedRange),
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

/// Greatest number of seeds, and of values of one key.
const MAX_VALUES: u64 = 1_000_000;

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
        let mut experiment = Self::checked(text, stem, folder).map_err(|fault| fault.at(file, text))?;
        let table = DeTable::parse(text).map_err(|error| Fault::toml(error).at(file, text))?;
        if let Some(DeValue::Table(grid)) = table.get_ref().get("grid").map(|grid| grid.get_ref()) {
            for axis in &mut experiment.grid {
                let place =
                    |number| format!("{file}{}", colons(line_column(text, place_in(grid, "", &axis.key, number))));
                axis.places = (0..axis.values.len()).map(place).collect();
            }
        }
        Ok(experiment)
    }

    fn checked(text: &str, stem: &str, folder: &Path) -> Result<Self, Fault> {
        let table = DeTable::parse(text).map_err(Fault::toml)?;
        known_keys(table.get_ref())?;
        let raw: Raw = toml::from_str(text).map_err(Fault::toml)?;
        let place = |key: &str| table.get_ref().get(key).map(|value| value.span());
        let fault = |key: &str| {
            let span = place(key);
            move |problem: Problem| Fault { span, problem: Box::new(problem) }
        };
        let name = raw.name.unwrap_or_else(|| stem.to_owned());
        Ok(Self {
            name: checked_name(name).map_err(fault("name"))?,
            scenarios: scenarios(raw.scenario, folder).map_err(fault("scenario"))?,
            strategies: checked_strategies(raw.strategies).map_err(fault("strategies"))?,
            seeds: seeds(raw.seeds).map_err(fault("seeds"))?,
            grid: axes(&raw.grid).map_err(fault("grid"))?,
            processes: matches!(raw.runtime, Runtime::Processes),
            metrics: metrics(raw.metrics).map_err(fault("metrics"))?,
            bounds: bounds(&raw.random).map_err(fault("random"))?,
        })
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

    fn at(self, name: &str, text: &str) -> ExperimentError {
        let place = line_column(text, self.span);
        ExperimentError::Invalid { name: name.to_owned(), place, problem: self.problem }
    }
}

/// Line and column, from 1, of the beginning of a span.
fn line_column(text: &str, span: Option<Range<usize>>) -> Option<(usize, usize)> {
    let before = text.get(..span?.start).unwrap_or(text);
    let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
    Some((before.matches('\n').count() + 1, column))
}

fn colons(place: Option<(usize, usize)>) -> String {
    place.map(|(line, column)| format!(":{line}:{column}")).unwrap_or_default()
}

/// Where value `number` of the key with this path stands. `above`: the path of `table` itself.
fn place_in(table: &DeTable<'_>, above: &str, key: &str, number: usize) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| {
        let path = format!("{above}{}", name.get_ref());
        match value.get_ref() {
            DeValue::Array(values) if path == key => values.get(number).map(|value| value.span()),
            _ if path == key => Some(value.span()),
            DeValue::Table(inner) => place_in(inner, &format!("{path}."), key, number),
            _ => None,
        }
    })
}

fn known_keys(table: &DeTable<'_>) -> Result<(), Fault> {
    for key in table.keys() {
        let found: &str = key.get_ref();
        if !KEYS.contains(&found) {
            let suggestion = suggestion(found, &KEYS);
            let problem = Problem::UnknownKey { found: found.to_owned(), suggestion, expected: KEYS.join(", ") };
            return Err(Fault { span: Some(key.span()), problem: Box::new(problem) });
        }
    }
    Ok(())
}

/// The known word that is most like `found`, as a question. Empty if none is close.
fn suggestion(found: &str, known: &[&str]) -> String {
    let best = known.iter().map(|word| (strsim::damerau_levenshtein(found, word), word)).min();
    match best {
        Some((edits, word)) if edits <= 1 + found.len() / 4 => format!(" (did you mean {word:?}?)"),
        _ => String::new(),
    }
}

fn checked_name(name: String) -> Result<String, Problem> {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    match name.len() {
        1..=64 if name.chars().all(fits) && !name.starts_with(['.', '-']) => Ok(name),
        _ => Err(Problem::Name(name)),
    }
}

fn scenarios(written: OneOrMany, folder: &Path) -> Result<Vec<Mission>, Problem> {
    let names = match written {
        OneOrMany::One(name) => vec![name],
        OneOrMany::Many(names) => names,
    };
    if names.is_empty() {
        let expected = "a scenario file, \"random\" or \"wide\"";
        return Err(Problem::EmptyList { key: "scenario".to_owned(), expected });
    }
    unique("scenario", &names)?;
    let mission = |name: &String| {
        if name == "random" {
            return Ok(Mission::Random);
        }
        if name == "wide" {
            return Ok(Mission::Wide);
        }
        let path = tidy(&folder.join(name));
        match std::fs::read_to_string(&path) {
            Ok(text) => Ok(Mission::File { path, text }),
            Err(source) => Err(Problem::ScenarioFile { path, source }),
        }
    };
    names.iter().map(mission).collect()
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

fn checked_strategies(strategies: Vec<String>) -> Result<Vec<String>, Problem> {
    for word in &strategies {
        word.parse::<skein_scenario::Strategy>()?;
    }
    unique("strategies", &strategies)?;
    Ok(strategies)
}

fn unique<T: PartialEq + std::fmt::Debug>(key: &str, items: &[T]) -> Result<(), Problem> {
    match (1..items.len()).find(|&i| items[..i].contains(&items[i])) {
        Some(i) => Err(Problem::Repeated { key: key.to_owned(), item: format!("{:?}", items[i]) }),
        None => Ok(()),
    }
}

fn seeds(written: Seeds) -> Result<Vec<u64>, Problem> {
    let range = match written {
        Seeds::List(seeds) => return listed_seeds(seeds),
        Seeds::Count(count) => SeedRange { from: 1, count },
        Seeds::From(range) => range,
    };
    if !(1..=MAX_VALUES).contains(&range.count) {
        return Err(Problem::SeedCount { found: range.count, most: MAX_VALUES });
    }
    Ok((range.from..range.from.saturating_add(range.count)).collect())
}

/// Each seed is in the range of a TOML integer, because the TOML reader has checked that.
fn listed_seeds(seeds: Vec<u64>) -> Result<Vec<u64>, Problem> {
    let mut sorted = seeds.clone();
    sorted.sort_unstable();
    let key = || "seeds".to_owned();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(Problem::Repeated { key: key(), item: pair[0].to_string() }),
        None if seeds.is_empty() => Err(Problem::EmptyList { key: key(), expected: "at least one" }),
        None => Ok(seeds),
    }
}

/// The keys of the grid, sorted. Nested tables give keys with dots.
fn axes(table: &toml::Table) -> Result<Vec<Axis>, Problem> {
    let mut axes = Vec::new();
    collect(table, "", &mut axes)?;
    axes.sort_by(|a, b| a.key.cmp(&b.key));
    let keys: Vec<&String> = axes.iter().map(|axis| &axis.key).collect();
    unique("grid", &keys)?;
    match axes.iter().find(|axis| matches!(axis.key.as_str(), "seed" | "strategy" | "name")) {
        Some(axis) => Err(Problem::ReservedKey(axis.key.clone())),
        None => Ok(axes),
    }
}

fn collect(table: &toml::Table, path: &str, axes: &mut Vec<Axis>) -> Result<(), Problem> {
    for (name, value) in table {
        let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value {
            toml::Value::Table(range) if range.contains_key("steps") || range.contains_key("from") => {
                axes.push(Axis { values: steps(&key, range)?, key, places: Vec::new() });
            }
            toml::Value::Table(inner) => collect(inner, &key, axes)?,
            toml::Value::Array(values) if values.is_empty() => {
                return Err(Problem::EmptyList { key: format!("grid: {key}"), expected: "at least one value" });
            }
            toml::Value::Array(values) => {
                let values: Vec<String> = values.iter().map(ToString::to_string).collect();
                unique(&format!("grid: {key}"), &values)?;
                axes.push(Axis { key, values, places: Vec::new() });
            }
            one => axes.push(Axis { key, values: vec![one.to_string()], places: Vec::new() }),
        }
    }
    Ok(())
}

/// The values of `{ from, to, steps }`: evenly spaced, both ends included.
fn steps(key: &str, range: &toml::Table) -> Result<Vec<String>, Problem> {
    let number = |name: &str| {
        let value = range.get(name)?;
        value.as_float().or_else(|| value.as_integer().map(|integer| integer as f64)).filter(|v| v.is_finite())
    };
    let count = range.get("steps").and_then(toml::Value::as_integer).unwrap_or(0);
    match (number("from"), number("to")) {
        (Some(from), Some(to)) if range.len() == 3 && (2..=MAX_VALUES as i64).contains(&count) && from != to => {
            // Rounded at the twelfth digit: 0.3, not 0.30000000000000004.
            let at = |i: i64| from + (to - from) * i as f64 / (count - 1) as f64;
            Ok((0..count).map(|i| ((at(i) * 1e12).round() / 1e12).to_string()).collect())
        }
        _ => Err(Problem::Range(key.to_owned())),
    }
}

fn metrics(written: Option<Vec<String>>) -> Result<Option<Vec<String>>, Problem> {
    let Some(written) = written else { return Ok(None) };
    unique("metrics", &written)?;
    let known: Vec<&str> = std::iter::once(SUCCESS).chain(METRICS.iter().map(|metric| metric.name)).collect();
    let is_known = |name: &&String| *name == SUCCESS || metric(name).is_some() || own_name(name).is_some();
    match written.iter().find(|name| !is_known(name)) {
        None => Ok(Some(written)),
        Some(name) => {
            let (found, suggestion) = (name.clone(), suggestion(name, &known));
            let expected = format!(
                "{}, or metric.NAME for a figure that pilots report (also metric.NAME.last, .min and .max)",
                known.join(", ")
            );
            Err(Problem::UnknownMetric { found, suggestion, expected })
        }
    }
}

fn bounds(written: &RawBounds) -> Result<SceneBounds, Problem> {
    let default = SceneBounds::default();
    let bounds = SceneBounds {
        drones: written.drones.unwrap_or(default.drones),
        obstacles: written.obstacles.unwrap_or(default.obstacles),
        room_m: written.room_m,
    };
    Ok(bounds.checked()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Experiment, String> {
        Experiment::checked(text, "stem", Path::new("")).map_err(|fault| fault.at("e.toml", text).to_string())
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
            ("sedes = 3", "e.toml:3:1: unknown key \"sedes\" (did you mean \"seeds\"?)"),
            ("metrics = [\"mision_s\"]", "e.toml:3:11: metrics: unknown \"mision_s\" (did you mean \"mission_s\"?)"),
            ("strategies = [\"shortest\"]", "e.toml:3:14: strategies: \"shortest\" is no strategy"),
            ("strategies = [\"fixed:1/2\", \"fixed:1/2\"]", "is there twice"),
            ("[grid]\nradio.loss = []", "grid: radio.loss: found an empty list"),
            ("[grid]\nradio.loss = { from = 0, to = 1 }", "grid: radio.loss: expected { from = NUMBER"),
            ("[grid]\nseed = [1, 2]", "seed cannot be a key of the grid"),
            ("[random]\ndrones = [9, 5]", "random: drones: found 9 to 5"),
            ("[random]\ndrone = [5, 9]", "unknown field `drone`"),
            ("runtime = \"outline\"", "unknown variant `outline`"),
            ("name = \"../x\"", "name: found \"../x\""),
        ] {
            let error = parse(&format!("{head}{rest}")).unwrap_err();
            assert!(error.contains(wanted), "{rest}: {error}");
        }
        let missing = parse("seeds = 1").unwrap_err();
        assert!(missing.contains("scenario"), "{missing}");
        let absent = parse("scenario = \"no/such.toml\"\nseeds = 1").unwrap_err();
        assert!(absent.contains("e.toml:1:12: scenario: no/such.toml"), "{absent}");
        assert!(parse("scenario = \"random\"\nseeds = 0").unwrap_err().contains("expected 1 to"));
        assert!(parse("scenario = \"random\"\nseeds = [1, 1]").unwrap_err().contains("twice"));
        let twice = parse("scenario = [\"random\", \"wide\", \"random\"]\nseeds = 1").unwrap_err();
        assert!(twice.contains("e.toml:1:12: scenario: \"random\" is there twice"), "{twice}");
    }

    #[test]
    fn parent_folders_are_removed_from_paths() {
        assert_eq!(tidy(Path::new("experiments/../scenarios/a.toml")), Path::new("scenarios/a.toml"));
        assert_eq!(tidy(Path::new("../x/./a.toml")), Path::new("../x/a.toml"));
    }
}
