//! How a flight on a host begins: what a relay asks for, and what the host replies.

use crate::error::HostsError;
use crate::names;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use skein_bus::{PinMode, Version, WaitMode};
use skein_protocol::DroneId;
use skein_runtime::{DroneRange, Program};
use skein_scenario::{Scenario, ScenarioSource};
use std::collections::BTreeSet;

/// What a relay asks for.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Begin {
    /// Name of the flight, for messages.
    pub(crate) flight: String,
    /// The version of Skein that the launcher is built with.
    version: String,
    /// The scenario as the launcher resolved it.
    scenario: Value,
    first: u32,
    count: u32,
    incarnation: u32,
    first_tick: u64,
    pinned: bool,
    yielding: bool,
    /// Drones per process.
    pub(crate) per_process: u32,
    /// Whether drones that are overdue are late, as by the wall clock.
    pub(crate) lossy: bool,
    /// The hashes of the programs of `[[pilot]]` tables with a command.
    commands: Vec<Option<String>>,
    /// The hash of the launcher's program, if it flies pilots of its own.
    own_program: Option<String>,
}

/// What a host replies.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Reply {
    /// The drones are ready.
    Ready,
    /// They do not fly here, and why.
    Refused(String),
}

impl Begin {
    /// A request for these drones of a scenario.
    ///
    /// # Errors
    /// [`HostsError::Runtime`] if the program of a pilot cannot be read here.
    pub(crate) fn new(
        (flight, drones): (String, DroneRange),
        scenario: &Scenario,
        (pin, wait, per_process): (PinMode, WaitMode, u32),
        lossy: bool,
        own_program: Option<String>,
    ) -> Result<Self, HostsError> {
        Ok(Self {
            flight,
            version: Version::OWN.to_string(),
            commands: flown(scenario, drones)
                .map(|program| program.map(|program| program.hash()).transpose())
                .collect::<Result<_, _>>()?,
            // A checked scenario has no value that JSON cannot hold.
            scenario: serde_json::to_value(scenario).unwrap_or_default(),
            first: drones.first.0,
            count: drones.count,
            incarnation: drones.incarnation,
            first_tick: drones.first_tick,
            pinned: pin == PinMode::Auto,
            yielding: wait == WaitMode::Yield,
            per_process,
            lossy,
            own_program,
        })
    }

    /// The drones.
    pub(crate) fn drones(&self) -> DroneRange {
        let Self { first, count, incarnation, first_tick, .. } = *self;
        DroneRange { first: DroneId(first), count, incarnation, first_tick }
    }

    /// Whether each process stays on one core.
    pub(crate) fn pin(&self) -> PinMode {
        if self.pinned { PinMode::Auto } else { PinMode::Off }
    }

    /// How processes wait for each other.
    pub(crate) fn wait(&self) -> WaitMode {
        if self.yielding { WaitMode::Yield } else { WaitMode::Block }
    }

    /// The scenario, checked as that of a file is.
    pub(crate) fn scenario(&self) -> Result<Scenario, String> {
        let source = ScenarioSource { name: "the launcher's scenario", stem: "scenario" };
        Scenario::from_json(&self.scenario, source).map_err(|errors| errors.to_string())
    }

    /// Why a host with this program cannot fly the drones; `None` if it can.
    pub(crate) fn objection(&self, scenario: &Scenario, program: &Program) -> Option<String> {
        let drones = scenario.formation.drones;
        if self.count == 0 || self.first.checked_add(self.count).is_none_or(|end| end > drones) {
            return Some(format!(
                "asked for {} drones from number {} on, of a swarm of {drones}",
                self.count, self.first
            ));
        }
        let wanted = self.own_program.as_ref().map(|hash| (program, hash));
        let commands: Vec<_> = flown(scenario, self.drones()).collect();
        let named = commands.iter().flatten().zip(self.commands.iter().flatten());
        named.chain(wanted).find_map(|(program, wanted)| match program.hash() {
            Err(error) => Some(format!("the program {program} is missing here: {error}")),
            Ok(found) if found != *wanted => {
                Some(format!("the program {program} is another one here: expected hash {wanted}, found {found}"))
            }
            Ok(_) => None,
        })
    }
}

/// The programs of the tables of `[[pilot]]` that have a command and fly one of these drones.
fn flown(scenario: &Scenario, drones: DroneRange) -> impl Iterator<Item = Option<Program>> + '_ {
    let tables = scenario.pilot_tables();
    let here: BTreeSet<usize> = drones.ids().filter_map(|id| tables.get(id.index()).copied().flatten()).collect();
    scenario.pilots.iter().enumerate().map(move |(number, table)| {
        let command = table.command.as_deref().filter(|_| here.contains(&number));
        command.map(Program::of_command)
    })
}

/// Reads a request. It looks at the version first: another version may have other keys.
pub(crate) fn parse(bytes: &[u8]) -> Result<Begin, String> {
    #[derive(Deserialize)]
    struct Head {
        version: String,
    }
    let expected = |error| format!("expected a request for drones: {error}");
    let head: Head = serde_json::from_slice(bytes).map_err(expected)?;
    let own = Version::OWN.to_string();
    if head.version != own {
        return Err(format!("this host is built with {own}, the launcher with {}: use one version", head.version));
    }
    let begin: Begin = serde_json::from_slice(bytes).map_err(expected)?;
    if !names::is_name(&begin.flight) {
        return Err(format!("expected a name of a flight, found {:?}", begin.flight));
    }
    Ok(begin)
}
