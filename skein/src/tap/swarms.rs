//! The running swarms: those of this user on this machine, or those that other machines share.

use super::link::Link;
use super::look_args::LookArgs;
use crate::exit::Failure;
use skein_bus::living;
use skein_runtime::LookRun;
use std::path::PathBuf;
use std::sync::Arc;

/// Where swarms are looked for.
#[derive(Clone)]
pub(crate) enum Swarms {
    /// On this machine.
    Here,
    /// On other machines.
    There(Arc<Link>),
}

/// A running swarm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum RunningSwarm {
    /// One of this user on this machine: the folder of its domain.
    Here(PathBuf),
    /// One of another machine.
    There(LookRun),
}

impl RunningSwarm {
    /// Its displayed name: `<scenario>.<pid of the launcher>`.
    pub(crate) fn name(&self) -> String {
        let name = match self {
            Self::Here(path) => path.file_name().unwrap_or_default().to_string_lossy(),
            Self::There(run) => run.folder.as_str().into(),
        };
        name.split('_').next().unwrap_or(&name).to_owned()
    }
}

impl Swarms {
    /// The swarms that the arguments say. With other machines, this connects to them. Call it before signals are watched: until it has
    /// connected, a signal ends the process.
    pub(crate) fn of(args: &LookArgs) -> Result<Self, Failure> {
        Ok(match args.network()? {
            None => Self::Here,
            Some(network) => Self::There(Arc::new(Link::connect(&network)?)),
        })
    }

    /// The swarms that run now. If `name` is given: those whose name begins with it. Once the connection to other machines is lost,
    /// this fails for good.
    pub(crate) fn running(&self, name: Option<&str>) -> Result<Vec<RunningSwarm>, Failure> {
        let mut all: Vec<RunningSwarm> = match self {
            Self::Here => living().map_err(Failure::environment)?.into_iter().map(RunningSwarm::Here).collect(),
            Self::There(link) => link.runs()?.into_iter().map(RunningSwarm::There).collect(),
        };
        all.retain(|run| name.is_none_or(|name| run.name().starts_with(name)));
        Ok(all)
    }

    /// What to say if no swarm runs.
    pub(crate) fn none(&self, name: Option<&str>) -> String {
        let which = name.map_or(String::new(), |name| format!(" whose name begins with {name}"));
        match self {
            Self::Here => format!("no swarm runs{which}; start one with `skein run SCENARIO` (processes, not inline)"),
            Self::There(link) => {
                let at = link.at();
                format!(
                    "no swarm runs{which} at {at}; start one there with `skein run SCENARIO` (processes, not inline)"
                )
            }
        }
    }

    /// Why the connection to other machines is lost.
    pub(crate) fn failure(&self) -> Option<Failure> {
        match self {
            Self::Here => None,
            Self::There(link) => link.failure(),
        }
    }
}
