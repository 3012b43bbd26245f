//! One drone's place in the barrier of the launcher's machine, taken by a relay.

use crate::error::HostsError;
use crate::up::{Answer, Standing};
use skein_bus::{BusError, Control, DroneEndpoint, SHARD_DRONES, TickOutcome, UplinkHeader, UplinkPublisher};
use skein_protocol::slot::LinkStats;
use skein_protocol::{DroneId, Tick};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// A drone's place in the barrier.
pub(crate) struct Seat {
    drone: DroneId,
    endpoint: DroneEndpoint,
    control: Arc<Control>,
    /// The incarnation of its process on the host, which a restart changes.
    incarnation: Arc<AtomicU32>,
    /// What it stands at, as the host says.
    pub(crate) standing: Standing,
    /// What its radio had counted before this relay began.
    before: LinkStats,
}

impl Seat {
    /// The place of this drone.
    pub(crate) fn new(control: &Arc<Control>, drone: DroneId, incarnation: Arc<AtomicU32>) -> Result<Self, HostsError> {
        Ok(Self {
            drone,
            endpoint: DroneEndpoint::new(Arc::clone(control), drone.index())?,
            control: Arc::clone(control),
            incarnation,
            standing: Standing::default(),
            before: control.stats(drone.index()),
        })
    }

    /// The shard of the uplink on which it speaks.
    pub(crate) fn shard(&self) -> usize {
        self.drone.index() / SHARD_DRONES
    }

    /// Begins a tick. False if the drone may not answer it.
    pub(crate) fn join(&mut self, tick: Tick) -> bool {
        self.endpoint.join_tick(tick)
    }

    /// Does what the drone did on its host: it speaks and answers, or is dead.
    pub(crate) fn take(&mut self, tick: Tick, answer: &Answer, uplink: &UplinkPublisher) -> Result<(), HostsError> {
        match answer.outcome {
            TickOutcome::Done => {
                self.speak(tick, answer, uplink)?;
                let mut stats = self.before;
                stats.merge(&self.standing.stats);
                *self.endpoint.stats_mut() = stats;
                self.endpoint.finish(tick, &self.standing.slot);
            }
            TickOutcome::Dead if !self.control.is_dead(self.drone.index()) => {
                if let Some(end) = answer.end {
                    self.control.set_end(self.drone.index(), end);
                }
                self.control.mark_dead(self.drone.index());
            }
            // Late and hung drones do not answer: the world decides what becomes of them.
            _ => {}
        }
        Ok(())
    }

    fn speak(&self, tick: Tick, answer: &Answer, uplink: &UplinkPublisher) -> Result<(), HostsError> {
        if answer.frames.is_empty() {
            return Ok(());
        }
        let incarnation = self.incarnation.load(Ordering::Acquire);
        let header = UplinkHeader { tick, source: self.drone.0, incarnation };
        match uplink.send(header, answer.frames.len(), |out| out.copy_from_slice(&answer.frames)) {
            // By the wall clock only: the world is far behind, and these frames are lost.
            Err(BusError::Full { .. }) => Ok(()),
            sent => Ok(sent?),
        }
    }
}
