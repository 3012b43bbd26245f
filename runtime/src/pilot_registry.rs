//! The pilots that a program knows by name.

use crate::beacon::BeaconPilot;
use crate::cruise::CruisePilot;
use crate::error::RuntimeError;
use crate::forked::copy_came_back;
use crate::in_pilots::{self, Place};
use crate::mission;
use crate::pilot_problem::PilotProblem;
use crate::program::Program;
use crate::reported_panic::catch;
use crate::run_facts::pilot_groups;
use crate::talker::TalkerPilot;
use serde_json::Value;
use skein_agent::CoursePilot;
use skein_bus::ForkGuard;
use skein_pilot::{Birth, Params, Pilot, PilotError};
use skein_protocol::{DroneId, SimTime};
use skein_report::{PilotEntry, TopicSchema};
use skein_scenario::{DEFAULT_PILOT, PilotKeys, Scenario, did_you_mean};
use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

type Make = dyn Fn(&Scenario, &Birth) -> Result<Box<dyn Pilot>, PilotError> + Send + Sync;

/// The pilots that a program knows by name, and the program itself, from which processes are started.
pub struct PilotRegistry {
    pilots: BTreeMap<String, Registered>,
    topics: Vec<TopicSchema>,
    program: Program,
}

struct Registered {
    make: Box<Make>,
    own: bool,
}

impl fmt::Debug for PilotRegistry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PilotRegistry").field("pilots", &self.names()).field("program", &self.program).finish()
    }
}

impl PilotRegistry {
    /// The built-in pilots: `paper` and `cruise`, and those with which the runtime is measured: `beacon` and `talker`.
    #[must_use]
    pub fn new(program: Program) -> Self {
        let mut registry = Self { pilots: BTreeMap::new(), topics: Vec::new(), program };
        registry.insert(DEFAULT_PILOT, false, |scenario, birth| {
            without_params(birth)?;
            Ok(Box::new(swarm_pilot(scenario, birth)))
        });
        registry.insert("talker", false, |scenario, birth| {
            Ok(Box::new(TalkerPilot::new(swarm_pilot(scenario, birth), &birth.params)?))
        });
        registry.insert("cruise", false, |_, birth| Ok(Box::new(CruisePilot::new(&birth.params)?)));
        registry.insert("beacon", false, |scenario, birth| {
            without_params(birth)?;
            let ticks = (scenario.beacon_period_s() / scenario.time.dt_s).round() as u64;
            Ok(Box::new(BeaconPilot::new(DroneId(birth.drone), birth.incarnation, ticks)))
        });
        registry
    }

    /// The built-in pilots in the executable of this process.
    ///
    /// # Errors
    /// [`RuntimeError::System`] if the system does not know the executable.
    pub fn built_in() -> Result<Self, RuntimeError> {
        Ok(Self::new(Program::current()?))
    }

    /// Adds a pilot, or replaces the one of this name. `make` is called once for each start of a drone.
    pub fn register(
        &mut self,
        name: &str,
        make: impl Fn(&Birth) -> Result<Box<dyn Pilot>, PilotError> + Send + Sync + 'static,
    ) {
        self.insert(name, true, move |_, birth| make(birth));
    }

    fn insert(
        &mut self,
        name: &str,
        own: bool,
        make: impl Fn(&Scenario, &Birth) -> Result<Box<dyn Pilot>, PilotError> + Send + Sync + 'static,
    ) {
        self.pilots.insert(name.to_owned(), Registered { make: Box::new(make), own });
    }

    /// Says what the pilots' messages on a topic look like. It goes into the recordings of runs.
    pub fn describe_topic(&mut self, topic: TopicSchema) {
        self.topics.push(topic);
    }

    /// The schemas of the pilots' topics.
    #[must_use]
    pub fn topics(&self) -> &[TopicSchema] {
        &self.topics
    }

    /// The program from which processes are started.
    #[must_use]
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The names of all pilots.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        self.pilots.keys().map(String::as_str).collect()
    }

    /// The names of the pilots that are not built in.
    #[must_use]
    pub fn own_names(&self) -> Vec<&str> {
        self.pilots.iter().filter(|(_, pilot)| pilot.own).map(|(name, _)| name.as_str()).collect()
    }

    /// Whether the scenario's drones fly any of the program's own pilots.
    #[must_use]
    pub fn flies_own(&self, scenario: &Scenario) -> bool {
        let own = |name: &str| self.pilots.get(name).is_some_and(|pilot| pilot.own);
        scenario.pilots.iter().any(|table| table.command.is_none() && table.name.as_deref().is_some_and(own))
    }

    /// Whether this program can fly the scenario: it makes one pilot of each table. `inline`: in this process, where commands
    /// cannot fly. From now on, a pilot that ends this process ends it with exit code 3.
    ///
    /// # Errors
    /// [`PilotProblem`] with the key that is wrong.
    pub fn check(&self, scenario: &Scenario, inline: bool) -> Result<(), PilotProblem> {
        in_pilots::guard().map_err(|error| PilotProblem::new("pilot", error.to_string()))?;
        let tables = scenario.pilot_tables();
        let json = Arc::new(serde_json::to_value(scenario).unwrap_or_default());
        for (number, table) in scenario.pilots.iter().enumerate() {
            if let Some(words) = &table.command {
                check_command(words, inline)
                    .map_err(|message| PilotProblem::new(format!("pilot.{number}.command"), message))?;
                continue;
            }
            let drone = tables.iter().position(|of| *of == Some(number)).unwrap_or_default() as u32;
            self.make(scenario, &json, Some(number), (DroneId(drone), 1, SimTime::ZERO))?;
        }
        Ok(())
    }

    /// Makes the pilot of a drone: of the scenario's table with this number, or of the default pilot. `json`: the scenario.
    /// `incarnation` counts the drone's starts from 1, `start` is the time of its first tick.
    pub(crate) fn make(
        &self,
        scenario: &Scenario,
        json: &Arc<Value>,
        table: Option<usize>,
        (drone, incarnation, start): (DroneId, u32, SimTime),
    ) -> Result<Box<dyn Pilot>, PilotProblem> {
        let keys = table.and_then(|number| scenario.pilots.get(number));
        let path = format!("pilot.{}", table.unwrap_or_default());
        let name = self.name_of(keys, &path)?;
        let registered = self.pilots.get(name).ok_or_else(|| self.unknown(name, &path))?;
        let birth = Birth {
            drone: drone.0,
            drones: scenario.formation.drones,
            incarnation,
            start_s: start.secs(),
            dt_s: scenario.time.dt_s,
            seed: scenario.seed,
            pilot: name.to_owned(),
            params: keys.map(|keys| Params::from(keys.params.clone())).unwrap_or_default(),
            scenario: Arc::clone(json),
        };
        let guard = ForkGuard::new().map_err(|error| PilotProblem::new(path.clone(), error.to_string()))?;
        let made = {
            let mut place = Place::new();
            let _in = place.enter(birth.drone);
            catch(|| (registered.make)(scenario, &birth))
        };
        guard.end_copy(|| copy_came_back(birth.drone));
        let made = made.unwrap_or_else(|panic| Err(PilotError::new(format!("the pilot {name:?} {panic}"))));
        made.map_err(|error| refused(name, &path, &error))
    }

    /// The name of the pilot of a table.
    fn name_of<'a>(&'a self, keys: Option<&'a PilotKeys>, path: &str) -> Result<&'a str, PilotProblem> {
        match keys.map(|keys| (keys.name.as_deref(), keys.command.is_some())) {
            Some((Some(name), _)) => Ok(name),
            Some((None, true)) => match self.own_names()[..] {
                [only] => Ok(only),
                ref own => {
                    let message = format!("is missing: the program has {} pilots: {}", own.len(), own.join(", "));
                    Err(PilotProblem::new(format!("{path}.name"), message))
                }
            },
            Some((None, false)) | None => Ok(DEFAULT_PILOT),
        }
    }

    fn unknown(&self, name: &str, path: &str) -> PilotProblem {
        let known: Vec<&str> = self.names().into_iter().filter(|name| !["beacon", "talker"].contains(name)).collect();
        let hint = did_you_mean(name, known.iter().copied());
        let list: Vec<String> = known.iter().map(|known| format!("{known:?}")).collect();
        let message =
            format!("found {name:?}, expected one of {}, the pilots of {}{hint}", list.join(", "), self.program);
        PilotProblem::new(format!("{path}.name"), message)
    }

    /// The scenario's pilots for the manifest and the summary, with the hashes of their programs.
    ///
    /// # Errors
    /// [`RuntimeError::System`] if a program's file cannot be read.
    pub fn entries(&self, scenario: &Scenario) -> Result<Vec<PilotEntry>, RuntimeError> {
        let mut entries = Vec::new();
        for (keys, mut entry) in pilot_groups(scenario) {
            let own = self.pilots.get(&entry.name).is_some_and(|pilot| pilot.own);
            entry.program = match keys.and_then(|keys| keys.command.as_deref()) {
                Some(words) => Some(Program::of_command(words).hash()?),
                None if own => Some(self.program.hash()?),
                None => None,
            };
            entries.push(entry);
        }
        Ok(entries)
    }
}

fn swarm_pilot(scenario: &Scenario, birth: &Birth) -> CoursePilot {
    let (id, start) = (DroneId(birth.drone), SimTime::from_secs(birth.start_s));
    CoursePilot::new(scenario.course(), mission::pilot_params(scenario, id, birth.incarnation, start))
}

fn without_params(birth: &Birth) -> Result<(), PilotError> {
    let expected = format!("expected no parameters: the pilot {:?} reads the keys of the scenario", birth.pilot);
    birth.params.keys().next().map_or(Ok(()), |key| Err(PilotError::of_param(key, expected)))
}

fn refused(name: &str, path: &str, error: &PilotError) -> PilotProblem {
    let key = match error.key() {
        Some(key) => format!("{path}.params.{key}"),
        None => format!("{path}.params"),
    };
    PilotProblem::new(key, format!("{} (pilot {name:?})", error.problem()))
}

/// Whether a pilot's command can fly. `inline`: in this process.
fn check_command(words: &[String], inline: bool) -> Result<(), String> {
    if inline {
        return Err("a program of its own cannot fly inline: expected --runtime processes".to_owned());
    }
    if Program::of_command(words).is_there() {
        return Ok(());
    }
    let program = words.first().map_or("", String::as_str);
    Err(format!("{program:?} is no program: expected a file, or the name of one in the search path"))
}

#[cfg(test)]
mod tests;
