//! Receives the downlink of a swarm.

use super::remote_port::RemotePort;
use super::sample::Sample;
use crate::exit::Failure;
use skein_bus::DownlinkSubscriber;

/// A port for the downlink.
pub(crate) enum DownlinkPort {
    /// Of a swarm of this machine.
    Here(DownlinkSubscriber),
    /// Of another machine.
    There(RemotePort),
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
