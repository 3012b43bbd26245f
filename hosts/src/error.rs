//! What keeps a host, a relay, a share or a look from doing its part.

use skein_bus::BusError;
use skein_protocol::downlink::DownlinkError;
use skein_runtime::RuntimeError;
use thiserror::Error;

/// Why one of them ended.
#[derive(Debug, Error)]
pub(crate) enum HostsError {
    /// The command line asks for what may not be.
    #[error("{0}")]
    Usage(String),
    /// The host does not fly these drones.
    #[error("host {host}: {why}")]
    Refused {
        /// Name of the host.
        host: String,
        /// Why, in words.
        why: String,
    },
    /// There is no such host.
    #[error("host {host} does not answer at {at}; is `skein host --name {host}` running there?")]
    NotFound {
        /// Name of the host.
        host: String,
        /// The endpoints.
        at: String,
    },
    /// The host was there, and is no longer.
    #[error("host {0} is gone: its drones count as dead")]
    Gone(String),
    /// There is no share.
    #[error(
        "nothing is shared at {at}: expected `skein share` there, with certificates of the same authority if the endpoint is tls/"
    )]
    NoShare {
        /// The endpoints.
        at: String,
    },
    /// The shares were there, and are no longer.
    #[error("the connection to {at} is lost: `skein share` has ended there, or the network is cut")]
    ShareGone {
        /// The endpoints.
        at: String,
    },
    /// The share of a swarm was there, and is no longer.
    #[error("the connection to its machine is lost: `skein share` has ended there, or the network is cut")]
    LookLost,
    /// A share refuses what was asked for.
    #[error("{0}")]
    NotShared(String),
    /// What came over the network cannot be used.
    #[error("what came over the network cannot be used: {0}")]
    Message(&'static str),
    /// A downlink cannot be used.
    #[error(transparent)]
    Downlink(#[from] DownlinkError),
    /// Zenoh failed.
    #[error("{what}: {source}")]
    Network {
        /// What was tried.
        what: String,
        /// Zenoh's error.
        source: zenoh::Error,
    },
    /// The runtime failed.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// Shared memory, a service or the barrier failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A key or certificate could not be made.
    #[error("making keys: {0}")]
    Keys(#[from] rcgen::Error),
    /// A file or a system call failed.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
}

impl HostsError {
    /// Makes an error of Zenoh an error while doing `what`.
    pub(crate) fn network(what: impl Into<String>) -> impl FnOnce(zenoh::Error) -> Self {
        let what = what.into();
        move |source| Self::Network { what, source }
    }

    /// Makes an error of the operating system an error while doing `what`.
    pub(crate) fn system(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let what = what.into();
        move |source| Self::System { what, source }
    }
}
