//! The table of all drones: the body and the process of each, by id.

use crate::body::{Body, admissible};
use crate::params::WorldParams;
use crate::process::Process;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, SimTime, Vec3};

/// All drones. Calls about a drone that does not exist have no effect.
#[derive(Clone, Debug)]
pub(crate) struct DroneTable {
    bodies: Vec<Body>,
    /// As many as bodies.
    processes: Vec<Process>,
}

impl DroneTable {
    /// Living drones at these positions (m) with these velocities (m/s), world frame, by id.
    pub(crate) fn new(starts: &[(Vec3, Vec3)]) -> Self {
        let bodies: Vec<Body> = starts.iter().map(|&(position, velocity)| Body::new(position, velocity)).collect();
        Self { processes: vec![Process::default(); bodies.len()], bodies }
    }

    /// All bodies, by id.
    pub(crate) fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// All processes, by id.
    pub(crate) fn processes(&self) -> &[Process] {
        &self.processes
    }

    /// The drone's body.
    pub(crate) fn body(&self, id: DroneId) -> Option<&Body> {
        self.bodies.get(id.index())
    }

    /// The drone's process.
    pub(crate) fn process(&self, id: DroneId) -> Option<&Process> {
        self.processes.get(id.index())
    }

    /// Whether the drone's process lives; false if there is no such drone.
    pub(crate) fn is_alive(&self, id: DroneId) -> bool {
        self.body(id).is_some_and(Body::is_alive)
    }

    /// The last answer of a drone whose process lives and is not frozen.
    pub(crate) fn answer(&self, drone: usize) -> Option<&Slot> {
        let process = self.processes.get(drone)?;
        (self.bodies[drone].is_alive() && !process.is_frozen()).then_some(process.slot())
    }

    /// The last answers of all drones whose processes live and are not frozen.
    pub(crate) fn answers(&self) -> impl Iterator<Item = (usize, &Slot)> {
        (0..self.bodies.len()).filter_map(|drone| Some((drone, self.answer(drone)?)))
    }

    /// Whether there are living drones and the last answers of all of them say that the mission is done.
    pub(crate) fn all_done(&self) -> bool {
        let pairs = self.bodies.iter().zip(&self.processes);
        let mut done =
            pairs.filter(|(body, _)| body.is_alive()).map(|(_, process)| process.slot().is_done()).peekable();
        done.peek().is_some() && done.all(|done| done)
    }

    /// Takes a drone's answer to the current tick, if its process lives and is not frozen.
    pub(crate) fn take_slot(&mut self, id: DroneId, slot: &Slot) {
        if let Some(process) = self.running(id) {
            process.take(slot);
        }
    }

    /// A drone misses the current tick. Returns whether this is news.
    pub(crate) fn miss(&mut self, id: DroneId) -> bool {
        let Some(process) = self.running(id).filter(|process| !process.is_late()) else { return false };
        process.miss();
        true
    }

    /// Notes every drone that has not answered the current tick. Returns how many missed it.
    pub(crate) fn hold_unanswered(&mut self) -> u64 {
        let mut missed = 0;
        for (_, process) in self.bodies.iter().zip(&mut self.processes).filter(|(body, _)| body.is_alive()) {
            if process.is_frozen() {
                process.skip();
            } else if process.is_pending() {
                process.miss();
                missed += 1;
            }
        }
        missed
    }

    /// The sequence number of the drone's next frame, and where the drone is, m. `None` if its process is dead.
    pub(crate) fn next_frame(&mut self, id: DroneId) -> Option<(u32, Vec3)> {
        let body = self.bodies.get(id.index()).filter(|body| body.is_alive())?;
        Some((self.processes[id.index()].next_sequence(), body.position()))
    }

    /// The drone's process is gone. Returns whether this is news.
    pub(crate) fn kill(&mut self, id: DroneId) -> bool {
        if !self.is_alive(id) {
            return false;
        }
        self.bodies[id.index()].kill();
        self.processes[id.index()].set_frozen(false);
        true
    }

    /// The drone's process is stopped.
    pub(crate) fn freeze(&mut self, id: DroneId) {
        if let Some(process) = self.processes.get_mut(id.index()) {
            process.set_frozen(true);
        }
    }

    /// The drone's process continues. False if it was not stopped or has been killed since.
    pub(crate) fn resume(&mut self, id: DroneId) -> bool {
        let alive = self.is_alive(id);
        self.processes.get_mut(id.index()).is_some_and(|process| process.set_frozen(false)) && alive
    }

    /// A new process takes over a dead drone. Returns its incarnation; `None` if the drone lives or is landing.
    pub(crate) fn restart(&mut self, id: DroneId) -> Option<u32> {
        let body = self.bodies.get_mut(id.index()).filter(|body| body.can_revive())?;
        body.revive();
        Some(self.processes[id.index()].restart())
    }

    /// Notes the incarnation of the drone's process. Returns whether it is another one than before.
    pub(crate) fn set_incarnation(&mut self, id: DroneId, incarnation: u32) -> bool {
        self.processes.get_mut(id.index()).is_some_and(|process| process.set_incarnation(incarnation))
    }

    /// Moves every body by one tick, which opens at `opening`: as its process commands, or as its autopilot flies without a command.
    /// `wind_mps2` is added to the commands. Returns how many commands were rejected because they were not finite.
    pub(crate) fn fly(&mut self, params: &WorldParams, opening: SimTime, wind_mps2: impl Fn(DroneId) -> Vec3) -> u64 {
        // Whatever happens to a process, the others cannot react before their first commands take effect.
        let coasts = opening.since(SimTime::ZERO) < params.reaction_time_s - params.dt_s() / 2.0;
        let mut rejected = 0;
        for ((body, process), id) in self.bodies.iter_mut().zip(&self.processes).zip(0..) {
            if !body.is_alive() {
                if coasts {
                    body.coast(params)
                } else {
                    body.fail_safe(params)
                }
                continue;
            }
            // The safety rule allows a command in the state in which it was given, and braking in every state. A pilot that has
            // failed in this tick commands nothing.
            if process.is_frozen() || process.is_late() || process.slot().has_failed() {
                if coasts {
                    body.coast(params)
                } else {
                    body.hover(params)
                }
                continue;
            }
            let command = admissible(process.slot().acceleration_mps2, params.acceleration_max_mps2);
            rejected += u64::from(command.is_none());
            body.fly(command.unwrap_or_default(), wind_mps2(DroneId(id)), params);
        }
        rejected
    }

    /// Takes a drone out of the table.
    pub(crate) fn remove(&mut self, drone: usize) -> (Body, Process) {
        (self.bodies.remove(drone), self.processes.remove(drone))
    }

    /// Puts a drone into the table, before the one that is at this place.
    pub(crate) fn insert(&mut self, drone: usize, body: Body, process: Process) {
        self.bodies.insert(drone, body);
        self.processes.insert(drone, process);
    }

    /// The next tick begins: every process owes an answer.
    pub(crate) fn open_tick(&mut self) {
        for process in &mut self.processes {
            process.open_tick();
        }
    }

    /// Puts a drone somewhere else.
    #[cfg(test)]
    pub(crate) fn place(&mut self, drone: usize, position: Vec3) {
        let alive = self.bodies[drone].is_alive();
        self.bodies[drone] = Body::new(position, self.bodies[drone].velocity());
        if !alive {
            self.bodies[drone].kill();
        }
    }

    /// The process of a drone if it lives and is not frozen.
    fn running(&mut self, id: DroneId) -> Option<&mut Process> {
        let alive = self.is_alive(id);
        self.processes.get_mut(id.index()).filter(|process| alive && !process.is_frozen())
    }
}
