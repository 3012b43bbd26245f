//! Looking on at running swarms: what `view`, `top` and `topic` share. An observer never holds up a swarm.

use crate::exit::Failure;
use skein_bus::{BusError, Domain, DownlinkSubscriber, RecordSubscriber, Services, living};
use skein_report::RunFacts;
use skein_runtime::run_facts::run_facts;
use skein_runtime::{mission, scenario_file};
use std::path::{Path, PathBuf};

/// A running swarm of this user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Running {
    /// Its domain's folder.
    pub path: PathBuf,
}

impl Running {
    /// Its name for people: `<scenario>.<pid of the launcher>`.
    pub fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        name.split('_').next().unwrap_or(&name).to_owned()
    }
}

/// The swarms that run on this machine under this user, those whose name begins with `name` if one is given.
pub fn running(name: Option<&str>) -> Result<Vec<Running>, Failure> {
    let all = living().map_err(Failure::environment)?.into_iter().map(|path| Running { path });
    Ok(all.filter(|run| name.is_none_or(|name| run.name().starts_with(name))).collect())
}

/// What to say where there is no swarm.
pub fn nobody(name: Option<&str>) -> Failure {
    let which = name.map_or(String::new(), |name| format!(" whose name begins with {name}"));
    Failure::environment(format!("no swarm runs{which}; start one with `skein run SCENARIO` (processes, not inline)"))
}

/// An ear at a running swarm. Ports stay on the thread that made them.
pub struct Tap {
    /// What is flown. The clock is not known.
    pub facts: RunFacts,
    /// Its records.
    pub records: RecordSubscriber,
    // Dropped last: the ports are made of them.
    services: Services,
    domain: Domain,
}

impl Tap {
    /// Attaches to a swarm. One that has just begun may not have its services yet: an error, to be tried again.
    pub fn attach(path: &Path) -> Result<Self, Failure> {
        let domain = Domain::join(path).map_err(Failure::environment)?;
        let scenario = scenario_file::read(path).map_err(Failure::environment)?;
        let open = |domain: &Domain| -> Result<(Services, RecordSubscriber), BusError> {
            let services = Services::open(domain, mission::drones(&scenario), "observer")?;
            let records = services.watch_subscriber()?;
            Ok((services, records))
        };
        // All places may be taken by observers that died.
        let opened = open(&domain).or_else(|_| skein_bus::clean_dead_nodes(&domain).and_then(|_| open(&domain)));
        let (services, records) = opened.map_err(Failure::environment)?;
        let facts = run_facts(&scenario, "processes", "").map_err(Failure::usage)?;
        Ok(Self { facts, records, services, domain })
    }

    /// What the drones hear of the world: senses and air.
    pub fn downlink(&self) -> Result<DownlinkSubscriber, Failure> {
        self.services.downlink_subscriber().map_err(Failure::environment)
    }

    /// Whether its launcher lives.
    pub fn alive(&self) -> bool {
        living().is_ok_and(|runs| runs.iter().any(|run| run == self.domain.path()))
    }
}
