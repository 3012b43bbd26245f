//! Scheduled faults in the world: the beginning of a tick.

use super::World;
use crate::faults::engine::Turn;
use crate::faults::targets::Scene;
use crate::faults::{FaultEffect, FaultTargets, ProcessCommand};
use skein_protocol::DroneId;
use skein_protocol::record::{EventKind, FaultKind};
use skein_protocol::slot::Slot;

impl World {
    /// What the faults of the current tick do to drones' processes: to be done, in this order, before the tick's
    /// downlink goes out. The world counts it as done.
    pub fn process_commands(&mut self) -> &[ProcessCommand] {
        self.open();
        &self.commands
    }

    /// Whether a drone's process is stopped.
    #[must_use]
    pub fn is_frozen(&self, id: DroneId) -> bool {
        self.processes.get(id.index()).is_some_and(|process| process.frozen)
    }

    /// Opens the tick once: what ends, what is detected, what begins.
    pub(super) fn open(&mut self) {
        if std::mem::replace(&mut self.open, true) {
            return;
        }
        let now = self.now();
        self.commands.clear();
        for turn in self.faults.end(now) {
            self.end_fault(&turn);
        }
        self.blindfold();
        self.stages.detect(&self.around.contacts, now, &mut self.log);
        let scene = Scene { bodies: &self.bodies, processes: &self.processes, stages: &self.stages };
        self.faults.observe(now, &scene);
        let mut begun = false;
        while let Some(turn) = self.next_fault() {
            self.begin_fault(&turn);
            begun = true;
        }
        if begun {
            self.blindfold();
        }
    }

    fn next_fault(&mut self) -> Option<Turn> {
        let now = self.now();
        let scene = Scene { bodies: &self.bodies, processes: &self.processes, stages: &self.stages };
        self.faults.begin(now, &scene)
    }

    /// Who is dead or blind senses no obstacle.
    fn blindfold(&mut self) {
        let (bodies, faults) = (&self.bodies, &self.faults);
        let sees = |drone: u32| bodies[drone as usize].alive && !faults.standing(DroneId(drone)).no_obstacles;
        self.around.contacts.retain(|contact| sees(contact.drone));
    }

    fn begin_fault(&mut self, turn: &Turn) {
        let fault = self.faults.fault(turn.fault);
        let (kind, mut words) = (fault.effect.kind(), fault.effect.words());
        if fault.for_s.is_finite() && kind != FaultKind::Kill {
            words += &format!("{} {} s", if kind == FaultKind::Restart { " after" } else { ", for" }, fault.for_s);
        }
        if is_whole(&fault.targets, &fault.effect) {
            self.log_fault(kind, DroneId::NONE, &words);
            return;
        }
        for &drone in &turn.drones {
            match kind {
                FaultKind::Kill | FaultKind::Restart if self.is_alive(drone) => {
                    self.commands.push(ProcessCommand::Kill(drone));
                    self.mark_dead(drone, kind, true, &words);
                    continue;
                }
                FaultKind::Freeze => {
                    self.commands.push(ProcessCommand::Freeze(drone));
                    self.processes[drone.index()].frozen = true;
                }
                _ => {}
            }
            self.log_fault(kind, drone, &words);
        }
    }

    fn end_fault(&mut self, turn: &Turn) {
        let fault = self.faults.fault(turn.fault);
        let kind = fault.effect.kind();
        if is_whole(&fault.targets, &fault.effect) {
            self.log_over(kind, DroneId::NONE, String::new());
            return;
        }
        for &drone in &turn.drones {
            let detail = match kind {
                FaultKind::Freeze => self.resume(drone),
                FaultKind::Restart => self.restart(drone),
                _ => Some(String::new()),
            };
            if let Some(detail) = detail {
                self.log_over(kind, drone, detail);
            }
        }
    }

    /// `None` if it has been killed meanwhile.
    fn resume(&mut self, drone: DroneId) -> Option<String> {
        let process = &mut self.processes[drone.index()];
        if !std::mem::replace(&mut process.frozen, false) || !self.bodies[drone.index()].alive {
            return None;
        }
        self.commands.push(ProcessCommand::Resume(drone));
        Some("continued".to_owned())
    }

    /// `None` if it has landed meanwhile.
    fn restart(&mut self, drone: DroneId) -> Option<String> {
        let body = &mut self.bodies[drone.index()];
        if body.alive || !body.flies() {
            return None;
        }
        body.revive();
        let incarnation = self.processes[drone.index()].incarnation + 1;
        self.set_incarnation(drone, incarnation);
        self.processes[drone.index()].slot = Slot::default();
        self.commands.push(ProcessCommand::Restart(drone, incarnation));
        Some(format!("a new process, incarnation {incarnation}"))
    }

    fn log_fault(&mut self, kind: FaultKind, target: DroneId, words: &str) {
        let what = EventKind::Fault { kind, target, scheduled: true, detail: words.to_owned() };
        self.log.push(self.now(), what);
    }

    fn log_over(&mut self, kind: FaultKind, target: DroneId, detail: String) {
        self.log.push(self.now(), EventKind::FaultOver { kind, target, detail });
    }
}

/// Whether a fault is told of the swarm, not drone by drone. What is done to processes is told of each.
fn is_whole(targets: &FaultTargets, effect: &FaultEffect) -> bool {
    match effect {
        FaultEffect::Partition(_) => true,
        FaultEffect::Kill | FaultEffect::Freeze | FaultEffect::Restart => false,
        _ => *targets == FaultTargets::All,
    }
}

#[cfg(test)]
mod tests;
