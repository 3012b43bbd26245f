//! Which faults are due in a tick, which are in force, and what those do to each drone.

use super::chance::Chance;
use super::moments::Moments;
use super::targets::Scene;
use super::{Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime};
use crate::senses::SensorFault;
use skein_protocol::{DroneId, SimTime, Tick, Vec2};

/// A fault in force.
#[derive(Clone, Debug)]
struct Active {
    /// Its place in the plan.
    fault: usize,
    /// In ascending order.
    drones: Vec<DroneId>,
    /// The first instant at which it is over.
    until: SimTime,
}

/// A fault that begins or ends.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turn {
    /// Its place in the plan.
    pub fault: usize,
    /// Whom it meets.
    pub drones: Vec<DroneId>,
}

/// The plan and how far it is carried out.
#[derive(Clone, Debug)]
pub(crate) struct Engine {
    plan: FaultPlan,
    moments: Moments,
    /// Places of faults that have not begun.
    waiting: Vec<usize>,
    active: Vec<Active>,
    /// What is in force for each drone, but for noise, which is drawn anew in each tick.
    standing: Vec<SensorFault>,
}

impl Engine {
    /// For a swarm of so many drones.
    pub fn new(plan: FaultPlan, drones: usize) -> Self {
        let waiting = (0..plan.faults.len()).collect();
        let standing = vec![SensorFault::default(); drones];
        Self { plan, moments: Moments::default(), waiting, active: Vec::new(), standing }
    }

    /// A fault of the plan.
    pub fn fault(&self, place: usize) -> &Fault {
        &self.plan.faults[place]
    }

    /// Takes out the faults that are over, in the order in which they began.
    pub fn end(&mut self, now: SimTime) -> Vec<Turn> {
        let mut over = Vec::new();
        self.active.retain(|active| {
            let holds = active.until > now;
            if !holds {
                over.push(Turn { fault: active.fault, drones: active.drones.clone() });
            }
            holds
        });
        if !over.is_empty() {
            self.settle();
        }
        over
    }

    /// Looks for events, if a fault waits for one.
    pub fn observe(&mut self, now: SimTime, scene: &Scene<'_>) {
        if self.waiting.iter().any(|&place| matches!(self.plan.faults[place].time, FaultTime::On { .. })) {
            self.moments.observe(now, scene);
        }
    }

    /// Begins the next fault that is due, and gives it: to be called until there is none, the world having followed each.
    /// A role that nobody has is waited for; drones named that it cannot meet are left out.
    pub fn begin(&mut self, now: SimTime, scene: &Scene<'_>) -> Option<Turn> {
        let found = (0..self.waiting.len()).find_map(|index| {
            let place = self.waiting[index];
            let fault = &self.plan.faults[place];
            if !self.is_due(fault, now) {
                return None;
            }
            let drones = self.meets(place, scene);
            let role = !matches!(fault.targets, FaultTargets::Drones(_) | FaultTargets::All)
                && !matches!(fault.effect, FaultEffect::Partition(_));
            (!drones.is_empty() || !role).then_some((index, Turn { fault: place, drones }))
        });
        let (index, turn) = found?;
        self.waiting.remove(index);
        let fault = &self.plan.faults[turn.fault];
        if !turn.drones.is_empty() && fault.effect != FaultEffect::Kill {
            let until = now.after(fault.for_s);
            self.active.push(Active { fault: turn.fault, drones: turn.drones.clone(), until });
            self.settle();
        }
        Some(turn)
    }

    /// Whether a dead drone is to get a new process.
    pub fn awaits_restart(&self, drone: DroneId) -> bool {
        let restarts = |active: &&Active| self.plan.faults[active.fault].effect == FaultEffect::Restart;
        self.active.iter().filter(restarts).any(|active| active.has(drone))
    }

    /// Whether any is.
    pub fn awaits_restarts(&self) -> bool {
        self.active.iter().any(|active| self.plan.faults[active.fault].effect == FaultEffect::Restart)
    }

    /// What a drone is told differently from the truth in a tick.
    pub fn sensor_fault(&self, drone: DroneId, tick: Tick) -> SensorFault {
        let mut sensor_fault = self.standing[drone.index()];
        for active in self.active.iter().filter(|active| active.has(drone)) {
            if let FaultEffect::Noise(noise) = &self.plan.faults[active.fault].effect {
                let mut chance = self.chance(active.fault, u64::from(drone.0), tick);
                sensor_fault.position_error_m += noise.position_bias_m + chance.vector(noise.position_std_m);
                sensor_fault.velocity_error_mps += noise.velocity_bias_mps + chance.vector(noise.velocity_std_mps);
            }
        }
        sensor_fault
    }

    /// What of its radio is cut.
    pub fn standing(&self, drone: DroneId) -> &SensorFault {
        &self.standing[drone.index()]
    }

    /// What blows a drone about in the tick that begins now, m/s².
    pub fn wind_mps2(&self, drone: DroneId, now: SimTime) -> Vec2 {
        let mut sum = Vec2::zeros();
        for active in self.active.iter().filter(|active| active.has(drone)) {
            if let FaultEffect::Wind(wind) = &self.plan.faults[active.fault].effect {
                let gust = (now.secs() / wind.gust_s).floor() as u64;
                let mut chance = self.chance(active.fault, u64::from(drone.0), gust);
                sum += wind.acceleration_mps2 + chance.vector(wind.gust_mps2);
            }
        }
        sum
    }

    fn chance(&self, fault: usize, who: u64, when: u64) -> Chance {
        Chance::new(self.plan.seed, [fault as u64, who, when])
    }

    fn is_due(&self, fault: &Fault, now: SimTime) -> bool {
        match fault.time {
            FaultTime::At(at_s) => now >= SimTime::from_secs(at_s),
            FaultTime::On { event, stage, after_s } => {
                self.moments.of(event, stage).is_some_and(|moment| now >= moment.after(after_s))
            }
        }
    }

    /// Those whom a fault can meet now, in ascending order.
    fn meets(&self, place: usize, scene: &Scene<'_>) -> Vec<DroneId> {
        let fault = &self.plan.faults[place];
        let mut drones = match &fault.effect {
            // Sides are sides, whoever lives.
            FaultEffect::Partition(sides) => {
                return sorted(sides.concat().into_iter().filter(|drone| drone.index() < scene.bodies.len()).collect());
            }
            _ => scene.meets(&fault.targets, self.chance(place, u64::MAX, 0)),
        };
        drones.retain(|&drone| {
            let (body, process) = (&scene.bodies[drone.index()], &scene.processes[drone.index()]);
            match fault.effect {
                FaultEffect::Freeze => body.alive && !process.frozen,
                FaultEffect::Restart => body.flies() && !self.awaits_restart(drone),
                _ => body.alive,
            }
        });
        sorted(drones)
    }

    /// Works out anew what is in force for each drone.
    fn settle(&mut self) {
        self.standing.fill(SensorFault::default());
        for active in &self.active {
            let effect = &self.plan.faults[active.fault].effect;
            if let FaultEffect::Partition(sides) = effect {
                let number = self.plan.partition_number(active.fault);
                for (side, drones) in sides.iter().enumerate() {
                    let known = drones.iter().filter(|drone| active.has(**drone));
                    known.for_each(|drone| self.standing[drone.index()].cuts.partitions.join(number, side));
                }
                continue;
            }
            active.drones.iter().for_each(|drone| self.standing[drone.index()].add(effect));
        }
    }
}

impl Active {
    fn has(&self, drone: DroneId) -> bool {
        self.drones.binary_search(&drone).is_ok()
    }
}

impl SensorFault {
    fn add(&mut self, effect: &FaultEffect) {
        match effect {
            FaultEffect::Slow(extra_s) => self.extra_reaction_s += extra_s,
            FaultEffect::Deaf => self.cuts.deaf = 1,
            FaultEffect::Mute => self.cuts.mute = 1,
            FaultEffect::Blind { obstacles, ranging } => {
                self.no_obstacles |= obstacles;
                self.no_ranging |= ranging;
            }
            FaultEffect::Kill
            | FaultEffect::Freeze
            | FaultEffect::Restart
            | FaultEffect::Partition(_)
            | FaultEffect::Noise(_)
            | FaultEffect::Wind(_) => {}
        }
    }
}

impl FaultPlan {
    /// The number of a partition among the plan's partitions.
    fn partition_number(&self, place: usize) -> usize {
        self.faults[..place].iter().filter(|fault| matches!(fault.effect, FaultEffect::Partition(_))).count()
    }
}

fn sorted(mut drones: Vec<DroneId>) -> Vec<DroneId> {
    drones.sort_unstable();
    drones.dedup();
    drones
}

#[cfg(test)]
mod tests;
