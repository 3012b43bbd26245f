//! A tap on a swarm of another machine.

use super::link::Link;
use super::remote_port::RemotePort;
use super::sample::Sample;
use crate::exit::Failure;
use skein_runtime::{LookRequest, LookRun, LookStream};
use skein_scenario::{Scenario, ScenarioSource};
use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

/// A tap on a swarm of another machine.
pub(super) struct RemoteTap {
    link: Arc<Link>,
    run: u32,
    /// Number of drones.
    drones: u32,
    records: RemotePort,
    /// Whether the swarm is gone, and all that it published is received.
    over: Rc<Cell<bool>>,
}

impl RemoteTap {
    /// A tap on this swarm, and the scenario of the swarm, checked as that of a file is.
    pub(super) fn attach(link: &Arc<Link>, run: &LookRun) -> Result<(Self, Scenario), Failure> {
        let source = ScenarioSource { name: "the scenario of a shared swarm", stem: "scenario" };
        let scenario = Scenario::from_json(&run.scenario, source).map_err(Failure::environment)?;
        let (over, drones) = (Rc::new(Cell::new(false)), scenario.formation.drones);
        let request = LookRequest { run: run.run, stream: LookStream::Record };
        let records = RemotePort::new(Arc::clone(link), request, drones, Rc::clone(&over));
        Ok((Self { link: Arc::clone(link), run: run.run, drones, records, over }, scenario))
    }

    /// The oldest record that is not yet received.
    pub(super) fn record(&self) -> Result<Option<Sample>, Failure> {
        Ok(self.records.receive()?.map(Sample::remote))
    }

    /// A port for the downlink.
    pub(super) fn downlink(&self) -> RemotePort {
        let request = LookRequest { run: self.run, stream: LookStream::Downlink };
        RemotePort::new(Arc::clone(&self.link), request, self.drones, Rc::clone(&self.over))
    }

    /// Whether something may still come of the swarm.
    pub(super) fn is_alive(&self) -> bool {
        !self.over.get()
    }
}
