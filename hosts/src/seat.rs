//! One drone's place in the barrier of the launcher's machine, taken by a relay.

use crate::error::HostsError;
use crate::up::{Answer, Standing};
use skein_bus::{BusError, Control, DroneEndpoint, SHARD_DRONES, TickOutcome, UplinkHeader, UplinkPublisher};
use skein_protocol::slot::LinkStats;
use skein_protocol::{DroneId, Tick};
use std::process::ExitStatus;
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

    /// The newest tick that the world has opened.
    pub(crate) fn newest_tick(&self) -> Tick {
        self.endpoint.newest_tick()
    }

    /// Begins a tick. False if the drone is dead or may not answer it: then the world does not wait for it.
    pub(crate) fn join(&mut self, tick: Tick) -> bool {
        !self.control.is_dead(self.drone.index()) && self.endpoint.join_tick(tick)
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
            TickOutcome::Dead => self.die(tick, answer.end),
            // Late and hung drones do not answer: the world decides what becomes of them.
            _ => {}
        }
        Ok(())
    }

    /// Notes that the drone was dead in a tick. The supervisor may have started it again since: then it is no longer.
    fn die(&self, tick: Tick, end: Option<ExitStatus>) {
        let drone = self.drone.index();
        if tick < self.endpoint.resume_from() || self.control.is_dead(drone) {
            return;
        }
        if let Some(end) = end {
            self.control.set_end(drone, end);
        }
        self.control.mark_dead(drone);
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

#[cfg(test)]
mod tests {
    use super::*;
    use skein_bus::{ControlSpec, WaitMode};

    #[test]
    fn a_late_word_of_a_death_does_not_kill_the_drone_that_was_started_again() {
        let spec = ControlSpec { drones: 1, cores: 1, per_process: 1, wait: WaitMode::Block };
        let control = Arc::new(Control::create(spec).unwrap());
        let mut seat = Seat::new(&control, DroneId(0), Arc::default()).unwrap();
        assert!(seat.join(0));
        seat.die(0, None);
        assert!(control.is_dead(0));
        assert!(!seat.join(1), "the world does not wait for it");
        control.revive(0, 5);
        seat.die(4, None);
        assert!(!control.is_dead(0), "it was dead in tick 4, and flies from tick 5 on");
        assert!(!seat.join(4) && seat.join(5));
        seat.die(5, None);
        assert!(control.is_dead(0));
    }
}
