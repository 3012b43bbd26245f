//! The services of a run, without its processes, for tests of one process.

use skein_bus::{Domain, Services};
use skein_scenario::{Scenario, ScenarioSource};
use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;

/// A run in a folder of its own. The fields are dropped in their order: the domain's files go after the services.
pub(crate) struct TestRun {
    services: Services,
    domain: Domain,
    scenario: Scenario,
    _root: tempfile::TempDir,
}

impl TestRun {
    /// The run of a scenario.
    pub(crate) fn new(text: &str) -> Self {
        let source = ScenarioSource { name: "test.toml", stem: "test" };
        let scenario = Scenario::parse(text, source, &[]).unwrap();
        let root = tempfile::Builder::new().permissions(Permissions::from_mode(0o700)).tempdir().unwrap();
        let domain = Domain::create_in(root.path(), "test").unwrap();
        let services = Services::create(&domain, scenario.formation.drones as usize, 1, "launcher").unwrap();
        Self { services, domain, scenario, _root: root }
    }

    pub(crate) fn services(&self) -> &Services {
        &self.services
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    pub(crate) fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    pub(crate) fn drones(&self) -> usize {
        self.scenario.formation.drones as usize
    }
}
