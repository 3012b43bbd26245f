//! Attaching to running swarms, for `view`, `top` and `topic`: to those of this machine by shared memory, to others over the network. An
//! observer never delays a swarm.

mod downlink_port;
mod link;
mod look_args;
mod remote_port;
mod remote_tap;
mod sample;
mod sound;
mod swarms;

use crate::exit::Failure;
use downlink_port::DownlinkPort;
pub(crate) use look_args::LookArgs;
use remote_tap::RemoteTap;
pub(crate) use sample::Sample;
use skein_report::RunFacts;
use skein_runtime::LocalTap;
use skein_runtime::run_facts::run_facts;
use skein_scenario::{DEFAULT_PILOT, PilotKeys};
use std::collections::BTreeSet;
pub(crate) use swarms::{RunningSwarm, Swarms};

/// The other built-in pilot without topics of its own.
const CRUISE: &str = "cruise";

/// A tap on a running swarm: it receives copies of what the swarm publishes. It stays on the thread that made it.
pub(crate) struct SwarmTap {
    /// Facts of the run. The clock is not known.
    pub(crate) facts: RunFacts,
    /// The topics that its pilots declare.
    pub(crate) own_topics: BTreeSet<String>,
    /// Whether its pilots have no topics besides those that they declare.
    pub(crate) topics_known: bool,
    source: TapSource,
}

/// Where it receives from.
enum TapSource {
    /// This machine.
    Here(Box<LocalTap>),
    /// Another machine.
    There(RemoteTap),
}

impl SwarmTap {
    /// Attaches to a swarm. Fails if the swarm has just started and has no services yet; try again then.
    pub(crate) fn attach(swarms: &Swarms, run: &RunningSwarm) -> Result<Self, Failure> {
        let (scenario, source) = match (run, swarms) {
            (RunningSwarm::There(run), Swarms::There(link)) => {
                let (tap, scenario) = RemoteTap::attach(link, run)?;
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
        let silent = [DEFAULT_PILOT, CRUISE];
        let is_built_in = |pilot: &PilotKeys| pilot.command.is_none() && silent.contains(&pilot.shown_name());
        let topics_known = scenario.pilots.iter().all(is_built_in);
        Ok(Self { facts, own_topics, topics_known, source })
    }

    /// The oldest record of a tick that is not yet received.
    pub(crate) fn record(&self) -> Result<Option<Sample>, Failure> {
        match &self.source {
            TapSource::Here(tap) => Ok(tap.records().receive().map_err(Failure::environment)?.map(Sample::Record)),
            TapSource::There(tap) => tap.record(),
        }
    }

    /// A port for the downlink: the senses and frames that the world sends to the drones.
    pub(crate) fn downlink(&self) -> Result<DownlinkPort, Failure> {
        match &self.source {
            TapSource::Here(tap) => tap.downlink().map(DownlinkPort::Here).map_err(Failure::environment),
            TapSource::There(tap) => Ok(DownlinkPort::There(tap.downlink())),
        }
    }

    /// Whether the swarm's launcher lives. That of another machine is dead once all that it published is received.
    pub(crate) fn alive(&self) -> bool {
        match &self.source {
            TapSource::Here(tap) => tap.is_alive(),
            TapSource::There(tap) => tap.is_alive(),
        }
    }
}
