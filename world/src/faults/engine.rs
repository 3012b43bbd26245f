//! Carries out the scheduled faults: on the drones at once, and on their processes by commands to the runtime.

use super::schedule::{FaultChange, FaultSchedule};
use super::view::FaultView;
use crate::drones::DroneTable;
use crate::event_log::EventLog;
use crate::fault_plan::{FaultEffect, FaultPlan, FaultTargets, ProcessCommand};
use crate::stages::Stages;
use skein_protocol::record::{EventKind, FaultKind};
use skein_protocol::{DroneId, SimTime};

/// The fault schedule, and what the faults of the current tick do to processes.
#[derive(Clone, Debug)]
pub(crate) struct FaultEngine {
    schedule: FaultSchedule,
    commands: Vec<ProcessCommand>,
    /// The drones whose pilots failed in the last tick, with the reasons.
    failed: Vec<(DroneId, String)>,
    /// Which fault, by index, has stopped the process of which drone.
    freezes: Vec<(usize, DroneId)>,
}

impl FaultEngine {
    /// The plan for this number of drones, with nothing begun.
    pub(crate) fn new(plan: FaultPlan, drones: usize) -> Self {
        Self {
            schedule: FaultSchedule::new(plan, drones),
            commands: Vec::new(),
            failed: Vec::new(),
            freezes: Vec::new(),
        }
    }

    /// What is in force.
    pub(crate) fn schedule(&self) -> &FaultSchedule {
        &self.schedule
    }

    /// What the runtime has to do to processes in the current tick, in this order.
    pub(crate) fn commands(&self) -> &[ProcessCommand] {
        &self.commands
    }

    /// The pilot of a drone has failed: the drone is killed when the next tick begins.
    pub(crate) fn fail(&mut self, drone: DroneId, reason: String) {
        self.failed.push((drone, reason));
    }

    /// Begins a tick: kills drones whose pilots have failed, and ends the faults that are over.
    pub(crate) fn end_due(&mut self, now: SimTime, drones: &mut DroneTable, log: &mut EventLog) {
        self.commands.clear();
        for (drone, reason) in self.failed.drain(..).filter(|(drone, _)| drones.kill(*drone)) {
            self.commands.push(ProcessCommand::Kill(drone));
            log.push(now, EventKind::Fault { kind: FaultKind::Kill, target: drone, scheduled: false, detail: reason });
        }
        for change in self.schedule.end(now) {
            self.end(&change, now, drones, log);
        }
    }

    /// Begins the faults that are due. Returns whether any began.
    pub(crate) fn begin_due(
        &mut self,
        now: SimTime,
        drones: &mut DroneTable,
        stages: &Stages,
        log: &mut EventLog,
    ) -> bool {
        self.schedule.observe(now, &FaultView { drones, stages });
        let mut begun = false;
        while let Some(change) = self.schedule.begin(now, &FaultView { drones, stages }) {
            self.begin(&change, now, drones, log);
            begun = true;
        }
        begun
    }

    fn begin(&mut self, change: &FaultChange, now: SimTime, drones: &mut DroneTable, log: &mut EventLog) {
        let fault = self.schedule.fault(change.fault);
        let (kind, mut detail) = (fault.effect.kind(), fault.effect.words());
        if fault.for_s.is_finite() && kind != FaultKind::Kill {
            detail += &format!("{} {} s", if kind == FaultKind::Restart { " after" } else { ", for" }, fault.for_s);
        }
        if is_of_swarm(&fault.targets, &fault.effect) {
            log.push(now, EventKind::Fault { kind, target: DroneId::NONE, scheduled: true, detail });
            return;
        }
        for &drone in &change.drones {
            match kind {
                FaultKind::Kill | FaultKind::Restart if drones.kill(drone) => {
                    self.commands.push(ProcessCommand::Kill(drone));
                }
                FaultKind::Freeze => {
                    drones.freeze(drone);
                    self.freezes.push((change.fault, drone));
                    self.commands.push(ProcessCommand::Freeze(drone));
                }
                _ => {}
            }
            log.push(now, EventKind::Fault { kind, target: drone, scheduled: true, detail: detail.clone() });
        }
    }

    fn end(&mut self, change: &FaultChange, now: SimTime, drones: &mut DroneTable, log: &mut EventLog) {
        let fault = self.schedule.fault(change.fault);
        let kind = fault.effect.kind();
        if is_of_swarm(&fault.targets, &fault.effect) {
            log.push(now, EventKind::FaultOver { kind, target: DroneId::NONE, detail: String::new() });
            return;
        }
        for &drone in &change.drones {
            let detail = match kind {
                FaultKind::Freeze => self.resume(change.fault, drone, drones),
                FaultKind::Restart => self.restart(drone, drones),
                _ => Some(String::new()),
            };
            if let Some(detail) = detail {
                log.push(now, EventKind::FaultOver { kind, target: drone, detail });
            }
        }
    }

    /// Continues a process that a fault has stopped. Returns the description of the event; `None` if the process has been killed meanwhile: a new
    /// one may be stopped by another fault.
    fn resume(&mut self, fault: usize, drone: DroneId, drones: &mut DroneTable) -> Option<String> {
        let held = self.freezes.iter().position(|held| *held == (fault, drone))?;
        self.freezes.swap_remove(held);
        if !drones.resume(drone) {
            return None;
        }
        self.commands.push(ProcessCommand::Resume(drone));
        Some("continued".to_owned())
    }

    /// The description of the event; `None` if the drone is landing meanwhile.
    fn restart(&mut self, drone: DroneId, drones: &mut DroneTable) -> Option<String> {
        let incarnation = drones.restart(drone)?;
        // What stopped its last process does not stop the new one.
        self.freezes.retain(|(_, held)| *held != drone);
        self.commands.push(ProcessCommand::Restart(drone, incarnation));
        Some(format!("a new process, incarnation {incarnation}"))
    }
}

/// Whether a fault has one event for the whole swarm. What is done to processes has one event per drone.
fn is_of_swarm(targets: &FaultTargets, effect: &FaultEffect) -> bool {
    match effect {
        FaultEffect::Partition(_) => true,
        FaultEffect::Kill | FaultEffect::Freeze | FaultEffect::Restart => false,
        _ => *targets == FaultTargets::All,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault_plan::{Fault, FaultTime};
    use skein_protocol::{Course, Vec3};

    /// When one drone's process is stopped, in whole seconds, in which it has these faults: effect, time and length, s.
    fn stopped(faults: &[(FaultEffect, f64, f64)]) -> Vec<u32> {
        let targets = FaultTargets::Drones(vec![DroneId(0)]);
        let fault = |(effect, at_s, for_s): &(FaultEffect, f64, f64)| Fault {
            effect: effect.clone(),
            time: FaultTime::At(*at_s),
            targets: targets.clone(),
            for_s: *for_s,
        };
        let plan = FaultPlan { seed: 1, faults: faults.iter().map(fault).collect() };
        let mut drones = DroneTable::new(&[(Vec3::zeros(), Vec3::zeros())]);
        let (mut engine, stages, mut log) =
            (FaultEngine::new(plan, 1), Stages::new(Course::East, &[], 40.0), EventLog::default());
        let mut stopped = false;
        let mut tick = |second: u32| {
            let now = SimTime::from_secs(second.into());
            engine.end_due(now, &mut drones, &mut log);
            engine.begin_due(now, &mut drones, &stages, &mut log);
            for command in engine.commands() {
                stopped = matches!(command, ProcessCommand::Freeze(_));
            }
            stopped
        };
        (0..30).filter(|&second| tick(second)).collect()
    }

    #[test]
    fn the_end_of_one_freeze_does_not_end_another_one() {
        let freeze = |at_s, for_s| (FaultEffect::Freeze, at_s, for_s);
        assert_eq!(
            stopped(&[freeze(1.0, 9.0), freeze(4.0, 20.0)]),
            (1..10).collect::<Vec<_>>(),
            "it is stopped already"
        );
        let restarted = [freeze(1.0, 9.0), (FaultEffect::Restart, 2.0, 1.0), freeze(4.0, 20.0)];
        let expected: Vec<u32> = (1..2).chain(4..24).collect();
        assert_eq!(stopped(&restarted), expected, "the first one stopped another process");
    }
}
