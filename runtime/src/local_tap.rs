//! A tap on a swarm of this machine, for observers. An observer never delays a swarm.

use crate::error::RuntimeError;
use crate::{mission, scenario_file};
use skein_bus::{BusError, Domain, DownlinkSubscriber, RecordSubscriber, Services, living};
use skein_scenario::Scenario;
use std::path::Path;

/// A tap on a swarm of this machine: it receives copies of what the swarm publishes. Its ports stay on the thread that made them.
#[derive(Debug)]
pub struct LocalTap {
    scenario: Scenario,
    records: RecordSubscriber,
    // Dropped after the ports, which are made from it.
    services: Services,
    domain: Domain,
}

impl LocalTap {
    /// Attaches to the swarm in this folder. If the swarm has just started, it has no services yet: try again then.
    ///
    /// # Errors
    /// [`RuntimeError::Bus`] if the swarm has no services, or no place for one more observer; as [`scenario_file::read`].
    pub fn attach(path: &Path) -> Result<Self, RuntimeError> {
        let domain = Domain::join(path)?;
        let scenario = scenario_file::read(path)?;
        let open = |domain: &Domain| -> Result<(Services, RecordSubscriber), BusError> {
            let services = Services::visit(domain, mission::drones(&scenario), "observer")?;
            let records = services.watch_subscriber()?;
            Ok((services, records))
        };
        // Observers that died may occupy all places.
        let opened = open(&domain).or_else(|_| skein_bus::clean_dead_nodes(&domain).and_then(|_| open(&domain)));
        let (services, records) = opened?;
        Ok(Self { scenario, records, services, domain })
    }

    /// The swarm's scenario, as the launcher resolved it.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The port for the records of its ticks.
    #[must_use]
    pub fn records(&self) -> &RecordSubscriber {
        &self.records
    }

    /// A port for the downlink: the senses and frames that the world sends to the drones.
    ///
    /// # Errors
    /// [`RuntimeError::Bus`].
    pub fn downlink(&self) -> Result<DownlinkSubscriber, RuntimeError> {
        Ok(self.services.downlink_subscriber()?)
    }

    /// Whether the swarm's launcher lives.
    #[must_use]
    pub fn is_alive(&self) -> bool {
        living().is_ok_and(|runs| runs.iter().any(|run| run == self.domain.path()))
    }
}
