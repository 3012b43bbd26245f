//! Attaching to running swarms, for `view`, `top` and `topic`. An observer never delays a swarm.

use crate::exit::Failure;
use skein_bus::{BusError, Domain, DownlinkSubscriber, RecordSubscriber, Services, living};
use skein_report::RunFacts;
use skein_runtime::run_facts::run_facts;
use skein_runtime::{mission, scenario_file};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A running swarm of this user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct RunningSwarm {
    /// Folder of its domain.
    pub(crate) path: PathBuf,
}

impl RunningSwarm {
    /// Its displayed name: `<scenario>.<pid of the launcher>`.
    pub(crate) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        name.split('_').next().unwrap_or(&name).to_owned()
    }
}

/// The swarms that this user runs on this machine. If `name` is given: those whose name begins with it.
pub(crate) fn running(name: Option<&str>) -> Result<Vec<RunningSwarm>, Failure> {
    let all = living().map_err(Failure::environment)?.into_iter().map(|path| RunningSwarm { path });
    Ok(all.filter(|run| name.is_none_or(|name| run.name().starts_with(name))).collect())
}

/// The failure if no swarm runs.
pub(crate) fn no_swarm(name: Option<&str>) -> Failure {
    let which = name.map_or(String::new(), |name| format!(" whose name begins with {name}"));
    Failure::environment(format!("no swarm runs{which}; start one with `skein run SCENARIO` (processes, not inline)"))
}

/// A tap on a running swarm: it receives copies of what the swarm publishes. Its ports stay on the thread that made them.
pub(crate) struct SwarmTap {
    /// Facts of the run. The clock is not known.
    pub(crate) facts: RunFacts,
    /// The records of its ticks.
    pub(crate) records: RecordSubscriber,
    /// The topics that its pilots declare.
    pub(crate) own_topics: BTreeSet<String>,
    // Dropped after the ports, which are made from it.
    services: Services,
    domain: Domain,
}

impl SwarmTap {
    /// Attaches to a swarm. Fails if the swarm has just started and has no services yet; try again then.
    pub(crate) fn attach(path: &Path) -> Result<Self, Failure> {
        let domain = Domain::join(path).map_err(Failure::environment)?;
        let scenario = scenario_file::read(path).map_err(Failure::environment)?;
        let open = |domain: &Domain| -> Result<(Services, RecordSubscriber), BusError> {
            let services = Services::visit(domain, mission::drones(&scenario), "observer")?;
            let records = services.watch_subscriber()?;
            Ok((services, records))
        };
        // Observers that died may occupy all places.
        let opened = open(&domain).or_else(|_| skein_bus::clean_dead_nodes(&domain).and_then(|_| open(&domain)));
        let (services, records) = opened.map_err(Failure::environment)?;
        let facts = run_facts(&scenario, "processes", "").map_err(Failure::usage)?;
        let own_topics = scenario.declared_topics().into_iter().map(|(_, name)| name.to_owned()).collect();
        Ok(Self { facts, records, own_topics, services, domain })
    }

    /// A port for the downlink: the senses and frames that the world sends to the drones.
    pub(crate) fn downlink(&self) -> Result<DownlinkSubscriber, Failure> {
        self.services.downlink_subscriber().map_err(Failure::environment)
    }

    /// Whether the swarm's launcher lives.
    pub(crate) fn alive(&self) -> bool {
        living().is_ok_and(|runs| runs.iter().any(|run| run == self.domain.path()))
    }
}
