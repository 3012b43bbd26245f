//! The built-in pilots.

/// A built-in pilot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PilotKind {
    /// The paper's pilot, `skein_agent::SwarmPilot`.
    #[default]
    Swarm,
    /// The trivial pilot, [`BeaconPilot`](crate::BeaconPilot), with which the runtime is measured.
    Beacon,
}

impl PilotKind {
    /// Its name in the arguments of a child process.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Swarm => "swarm",
            Self::Beacon => "beacon",
        }
    }
}
