//! Which faults begin and end in a tick, which are in force, and what they do to each drone.

use super::keyed_rng::KeyedRng;
use super::targets;
use super::triggers::TriggerTimes;
use super::view::FaultView;
use crate::fault_plan::{Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime};
use crate::sensor_fault::SensorFault;
use skein_protocol::{DroneId, SimTime, Tick, Vec2};
use std::borrow::Cow;

/// A fault in force.
#[derive(Clone, Debug)]
struct Active {
    /// The fault's index in the plan.
    fault: usize,
    /// The drones it affects, in ascending order.
    drones: Vec<DroneId>,
    /// When it began.
    since: SimTime,
    /// The first instant at which it is over.
    until: SimTime,
}

impl Active {
    fn has(&self, drone: DroneId) -> bool {
        self.drones.binary_search(&drone).is_ok()
    }
}

/// A fault that begins or ends in the current tick.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FaultChange {
    /// The fault's index in the plan.
    pub(crate) fault: usize,
    /// The drones it affects.
    pub(crate) drones: Vec<DroneId>,
}

/// The plan, and which of its faults have begun and ended.
#[derive(Clone, Debug)]
pub(crate) struct FaultSchedule {
    plan: FaultPlan,
    triggers: TriggerTimes,
    /// Indices of the faults that have not begun.
    waiting: Vec<usize>,
    active: Vec<Active>,
    /// What is in force for each drone, without what changes from tick to tick: noise, and errors that drift.
    standing: Vec<SensorFault>,
}

impl FaultSchedule {
    /// The plan for this number of drones, with nothing begun.
    pub(crate) fn new(plan: FaultPlan, drones: usize) -> Self {
        let waiting = (0..plan.faults.len()).collect();
        let standing = vec![SensorFault::default(); drones];
        Self { plan, triggers: TriggerTimes::default(), waiting, active: Vec::new(), standing }
    }

    /// The fault with this index in the plan.
    pub(crate) fn fault(&self, place: usize) -> &Fault {
        &self.plan.faults[place]
    }

    /// Ends the faults that are over. Gives them in the order in which they began.
    pub(crate) fn end(&mut self, now: SimTime) -> Vec<FaultChange> {
        let mut over = Vec::new();
        self.active.retain(|active| {
            let holds = active.until > now;
            if !holds {
                over.push(FaultChange { fault: active.fault, drones: active.drones.clone() });
            }
            holds
        });
        if !over.is_empty() {
            self.settle();
        }
        over
    }

    /// Looks for events if any fault waits for one.
    pub(crate) fn observe(&mut self, now: SimTime, view: &FaultView<'_>) {
        if self.waiting.iter().any(|&place| matches!(self.plan.faults[place].time, FaultTime::On { .. })) {
            self.triggers.observe(now, view);
        }
    }

    /// Begins the next fault that is due and gives it. Call it until it gives `None`, and apply each fault before the
    /// next call. A fault whose role no drone has keeps waiting. Drones that the fault cannot affect are left out.
    pub(crate) fn begin(&mut self, now: SimTime, view: &FaultView<'_>) -> Option<FaultChange> {
        let found = (0..self.waiting.len()).find_map(|index| {
            let place = self.waiting[index];
            let fault = &self.plan.faults[place];
            if !self.is_due(fault, now) {
                return None;
            }
            let drones = self.affected(place, view);
            (!drones.is_empty() || !waits_for_role(fault)).then_some((index, FaultChange { fault: place, drones }))
        });
        let (index, change) = found?;
        self.waiting.remove(index);
        let fault = &self.plan.faults[change.fault];
        if !change.drones.is_empty() && fault.effect != FaultEffect::Kill {
            let until = now.after(fault.for_s);
            self.active.push(Active { fault: change.fault, drones: change.drones.clone(), since: now, until });
            self.settle();
        }
        Some(change)
    }

    /// Whether a restart of this drone is in force.
    pub(crate) fn awaits_restart(&self, drone: DroneId) -> bool {
        let restarts = |active: &&Active| self.plan.faults[active.fault].effect == FaultEffect::Restart;
        self.active.iter().filter(restarts).any(|active| active.has(drone))
    }

    /// Whether a restart of any drone is in force.
    pub(crate) fn awaits_restarts(&self) -> bool {
        self.active.iter().any(|active| self.plan.faults[active.fault].effect == FaultEffect::Restart)
    }

    /// How a drone's senses differ from the truth in a tick that begins now.
    pub(crate) fn sensor_fault(&self, drone: DroneId, (tick, now): (Tick, SimTime)) -> Cow<'_, SensorFault> {
        let mut sensor_fault = Cow::Borrowed(&self.standing[drone.index()]);
        for active in self.active.iter().filter(|active| active.has(drone)) {
            let lasted_s = now.since(active.since);
            match &self.plan.faults[active.fault].effect {
                FaultEffect::Noise(noise) => {
                    let mut rng = self.rng(active.fault, u64::from(drone.0), tick);
                    let sensor_fault = sensor_fault.to_mut();
                    sensor_fault.position_error_m += noise.position_bias_m + rng.vector(noise.position_std_m);
                    sensor_fault.velocity_error_mps += noise.velocity_bias_mps + rng.vector(noise.velocity_std_mps);
                }
                FaultEffect::Gnss(drift) => sensor_fault.to_mut().gnss_error_m += drift.after_m(lasted_s),
                FaultEffect::Clock(drift) => sensor_fault.to_mut().clock_error_s += drift.after_s(lasted_s),
                _ => {}
            }
        }
        sensor_fault
    }

    /// How a drone's senses differ from the truth, without what changes from tick to tick.
    pub(crate) fn standing(&self, drone: DroneId) -> &SensorFault {
        &self.standing[drone.index()]
    }

    /// The wind on a drone in the tick that begins now, m/s².
    pub(crate) fn wind_mps2(&self, drone: DroneId, now: SimTime) -> Vec2 {
        let mut sum = Vec2::zeros();
        for active in self.active.iter().filter(|active| active.has(drone)) {
            if let FaultEffect::Wind(wind) = &self.plan.faults[active.fault].effect {
                let gust = (now.secs() / wind.gust_s).floor() as u64;
                let mut rng = self.rng(active.fault, u64::from(drone.0), gust);
                sum += wind.acceleration_mps2 + rng.vector(wind.gust_mps2);
            }
        }
        sum
    }

    fn rng(&self, fault: usize, drone: u64, time: u64) -> KeyedRng {
        KeyedRng::new(self.plan.seed, [fault as u64, drone, time])
    }

    fn is_due(&self, fault: &Fault, now: SimTime) -> bool {
        match fault.time {
            FaultTime::At(at_s) => now >= SimTime::from_secs(at_s),
            FaultTime::On { event, stage, after_s } => {
                self.triggers.of(event, stage).is_some_and(|at| now >= at.after(after_s))
            }
        }
    }

    /// The drones that a fault can affect now, in ascending order.
    fn affected(&self, place: usize, view: &FaultView<'_>) -> Vec<DroneId> {
        let fault = &self.plan.faults[place];
        let (bodies, processes) = (view.drones.bodies(), view.drones.processes());
        let mut drones = match &fault.effect {
            // Dead drones stay on their side.
            FaultEffect::Partition(sides) => {
                return sorted(sides.concat().into_iter().filter(|drone| drone.index() < bodies.len()).collect());
            }
            _ => targets::resolve(&fault.targets, view, self.rng(place, u64::MAX, 0)),
        };
        drones.retain(|&drone| {
            let (body, process) = (&bodies[drone.index()], &processes[drone.index()]);
            match fault.effect {
                FaultEffect::Freeze => body.is_alive() && !process.is_frozen(),
                FaultEffect::Restart => body.flies() && !self.awaits_restart(drone),
                _ => body.is_alive(),
            }
        });
        sorted(drones)
    }

    /// Computes anew what is in force for each drone.
    fn settle(&mut self) {
        self.standing.fill(SensorFault::default());
        for active in &self.active {
            let effect = &self.plan.faults[active.fault].effect;
            if let FaultEffect::Partition(sides) = effect {
                let number = self.plan.partition_number(active.fault);
                for (side, drones) in sides.iter().enumerate() {
                    for drone in drones.iter().filter(|drone| active.has(**drone)) {
                        self.standing[drone.index()].link_faults.partitions.join(number, side);
                    }
                }
                continue;
            }
            for drone in &active.drones {
                self.standing[drone.index()].add(effect);
            }
        }
    }
}

/// Whether a fault waits for a drone with a role. Faults for drones named by id, for all, and partitions do not.
fn waits_for_role(fault: &Fault) -> bool {
    !matches!(fault.targets, FaultTargets::Drones(_) | FaultTargets::All)
        && !matches!(fault.effect, FaultEffect::Partition(_))
}

fn sorted(mut drones: Vec<DroneId>) -> Vec<DroneId> {
    drones.sort_unstable();
    drones.dedup();
    drones
}

#[cfg(test)]
mod tests;
