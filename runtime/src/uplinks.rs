//! The frames of all drones, as the process that opens ticks receives them.

use crate::error::RuntimeError;
use skein_bus::{SHARD_DRONES, Services, UplinkHeader, UplinkSubscriber, shards};
use skein_protocol::frame::Frame;

/// Receives exactly as many frames as the drones announce in their slots.
pub(crate) struct Uplinks {
    ports: Vec<UplinkSubscriber>,
    /// Number of frames received from each drone so far.
    received: Vec<u64>,
    /// Number of frames that each drone has announced so far.
    announced: Vec<u64>,
}

impl Uplinks {
    /// The uplinks of a swarm of this many drones.
    pub(crate) fn new(services: &Services, drones: usize) -> Result<Self, RuntimeError> {
        let ports = (0..shards(drones)).map(|shard| services.uplink_subscriber(shard)).collect::<Result<_, _>>()?;
        Ok(Self { ports, received: vec![0; drones], announced: vec![0; drones] })
    }

    /// Connects all ports now rather than during the next tick.
    pub(crate) fn connect(&self) -> Result<(), RuntimeError> {
        self.ports.iter().try_for_each(|port| Ok(port.connect()?))
    }

    /// Notes how many frames a drone's process has sent since it started.
    pub(crate) fn announce(&mut self, drone: usize, frames: u64) {
        self.announced[drone] = frames;
    }

    /// Notes that a drone has a new process.
    pub(crate) fn restart(&mut self, drone: usize) {
        (self.received[drone], self.announced[drone]) = (0, 0);
    }

    /// Receives exactly the frames that drones have announced: one more call would look through all shards. With `late`, this
    /// receives everything there is, so that the buffer of a late drone does not fill up. `deliver` returns false for frames
    /// of a process that is no longer the drone's. By the wall clock (`lossy`) such frames may still be in the buffer, and they
    /// are lost.
    pub(crate) fn take(
        &mut self,
        (late, lossy): (bool, bool),
        mut deliver: impl FnMut(UplinkHeader, &[Frame]) -> bool,
    ) -> Result<(), RuntimeError> {
        for (shard, port) in self.ports.iter().enumerate() {
            let first = shard * SHARD_DRONES;
            let drones = first..(first + SHARD_DRONES).min(self.announced.len());
            let mut missing = drones.clone().any(|drone| self.received[drone] < self.announced[drone]);
            while missing || late {
                let Some(sample) = port.receive()? else {
                    if lossy {
                        break;
                    }
                    return Err(RuntimeError::MissingFrames { shard });
                };
                let known = self.received.get_mut(sample.header().source as usize);
                if let Some(received) = known.filter(|_| deliver(sample.header(), sample.frames())) {
                    *received += sample.frames().len() as u64;
                }
                missing = drones.clone().any(|drone| self.received[drone] < self.announced[drone]);
            }
        }
        Ok(())
    }
}
