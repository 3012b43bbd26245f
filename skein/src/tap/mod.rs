//! Attaching to running swarms, for `view`, `top` and `topic`: to those of this machine by shared memory, to others over the network. An
//! observer never delays a swarm.

mod link;
mod look_args;
mod remote_port;
mod sound;
mod swarms;

use crate::exit::Failure;
use link::Link;
pub(crate) use look_args::LookArgs;
use remote_port::RemotePort;
use skein_bus::DownlinkSubscriber;
use skein_bus::payload::{DownWord, RecordWord};
use skein_bus::ports::StreamSample;
use skein_report::RunFacts;
use skein_runtime::run_facts::run_facts;
use skein_runtime::{LocalTap, LookRequest, LookRun, LookStream};
use skein_scenario::{Scenario, ScenarioSource};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::rc::Rc;
use std::sync::Arc;
pub(crate) use swarms::{RunningSwarm, Swarms};

/// A tap on a running swarm: it receives copies of what the swarm publishes. It stays on the thread that made it.
pub(crate) struct SwarmTap {
    /// Facts of the run. The clock is not known.
    pub(crate) facts: RunFacts,
    /// The topics that its pilots declare.
    pub(crate) own_topics: BTreeSet<String>,
    source: TapSource,
}

/// Where it receives from.
enum TapSource {
    /// This machine.
    Here(Box<LocalTap>),
    /// Another machine.
    There(RemoteTap),
}

/// A tap on a swarm of another machine.
struct RemoteTap {
    link: Arc<Link>,
    run: u32,
    records: RemotePort,
    over: Rc<Cell<bool>>,
}

/// A port for the downlink.
pub(crate) enum DownlinkPort {
    /// Of a swarm of this machine.
    Here(DownlinkSubscriber),
    /// Of another machine.
    There(RemotePort),
}

/// A received sample.
pub(crate) enum Sample {
    /// A record of this machine, read in place.
    Record(StreamSample<RecordWord>),
    /// A downlink of this machine, read in place.
    Downlink(StreamSample<DownWord>),
    /// One that came over the network: its words, and its length in bytes.
    Remote(Vec<u64>, usize),
}

impl Sample {
    /// Its bytes, 8-aligned.
    pub(crate) fn bytes(&self) -> &[u8] {
        match self {
            Self::Record(sample) => sample.bytes(),
            Self::Downlink(sample) => sample.bytes(),
            Self::Remote(words, len) => &bytemuck::cast_slice(words)[..*len],
        }
    }

    fn remote((words, len): (Vec<u64>, usize)) -> Self {
        Self::Remote(words, len)
    }
}

impl SwarmTap {
    /// Attaches to a swarm. Fails if the swarm has just started and has no services yet; try again then.
    pub(crate) fn attach(swarms: &Swarms, run: &RunningSwarm) -> Result<Self, Failure> {
        let (scenario, source) = match (run, swarms) {
            (RunningSwarm::There(run), Swarms::There(link)) => {
                let scenario = scenario_of(run)?;
                let tap = RemoteTap::new(Arc::clone(link), run.run, scenario.formation.drones);
                (scenario, TapSource::There(tap))
            }
            (RunningSwarm::Here(path), _) => {
                let tap = LocalTap::attach(path).map_err(Failure::environment)?;
                (tap.scenario().clone(), TapSource::Here(Box::new(tap)))
            }
            (RunningSwarm::There(_), Swarms::Here) => {
                return Err(Failure::environment(format!("expected a swarm of this machine, found {}", run.name())));
            }
        };
        let facts = run_facts(&scenario, "processes", "").map_err(Failure::usage)?;
        let own_topics = scenario.declared_topics().into_iter().map(|(_, name)| name.to_owned()).collect();
        Ok(Self { facts, own_topics, source })
    }

    /// The oldest record of a tick that is not yet received.
    pub(crate) fn record(&self) -> Result<Option<Sample>, Failure> {
        match &self.source {
            TapSource::Here(tap) => Ok(tap.records().receive().map_err(Failure::environment)?.map(Sample::Record)),
            TapSource::There(tap) => Ok(tap.records.receive()?.map(Sample::remote)),
        }
    }

    /// A port for the downlink: the senses and frames that the world sends to the drones.
    pub(crate) fn downlink(&self) -> Result<DownlinkPort, Failure> {
        match &self.source {
            TapSource::Here(tap) => tap.downlink().map(DownlinkPort::Here).map_err(Failure::environment),
            TapSource::There(tap) => Ok(DownlinkPort::There(tap.port(LookStream::Downlink, self.facts.drones))),
        }
    }

    /// Whether the swarm's launcher lives. That of another machine is dead once all that it published is received.
    pub(crate) fn alive(&self) -> bool {
        match &self.source {
            TapSource::Here(tap) => tap.is_alive(),
            TapSource::There(tap) => !tap.over.get(),
        }
    }
}

impl RemoteTap {
    fn new(link: Arc<Link>, run: u32, drones: u32) -> Self {
        let over = Rc::new(Cell::new(false));
        let request = LookRequest { run, stream: LookStream::Record };
        let records = RemotePort::new(Arc::clone(&link), request, drones, Rc::clone(&over));
        Self { link, run, records, over }
    }

    fn port(&self, stream: LookStream, drones: u32) -> RemotePort {
        let request = LookRequest { run: self.run, stream };
        RemotePort::new(Arc::clone(&self.link), request, drones, Rc::clone(&self.over))
    }
}

impl DownlinkPort {
    /// The oldest sample that is not yet received.
    pub(crate) fn receive(&self) -> Result<Option<Sample>, Failure> {
        match self {
            Self::Here(port) => Ok(port.receive().map_err(Failure::environment)?.map(Sample::Downlink)),
            Self::There(port) => Ok(port.receive()?.map(Sample::remote)),
        }
    }
}

/// The scenario of a swarm of another machine, checked as that of a file is.
fn scenario_of(run: &LookRun) -> Result<Scenario, Failure> {
    let source = ScenarioSource { name: "the scenario of a shared swarm", stem: "scenario" };
    Scenario::from_json(&run.scenario, source).map_err(Failure::environment)
}
