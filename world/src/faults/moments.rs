//! When the events were that faults wait for: seen at the beginning of each tick.

use super::FaultTrigger;
use super::targets::Scene;
use skein_protocol::slot::Slot;
use skein_protocol::{Ballot, GroupId, Phase, PlanStamp, SimTime};

/// What was seen of one obstacle set.
#[derive(Clone, Debug, Default)]
struct Set {
    detected: Option<SimTime>,
    /// What each drone obeyed then: no plan for this set.
    before: Vec<PlanStamp>,
    grouped: Option<SimTime>,
    queued: Option<SimTime>,
    gate: Option<SimTime>,
    passed: Option<SimTime>,
    reforming: Option<SimTime>,
}

/// All that was seen so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moments {
    sets: Vec<Set>,
    /// What each drone leads.
    leading: Vec<Option<(GroupId, Ballot)>>,
    elected: Vec<SimTime>,
    group_elected: Vec<SimTime>,
}

impl Moments {
    /// Looks at the beginning of a tick.
    pub fn observe(&mut self, now: SimTime, scene: &Scene<'_>) {
        self.sets.resize_with(scene.stages.count(), Set::default);
        for (number, set) in self.sets.iter_mut().enumerate() {
            set.observe(number, now, scene);
        }
        self.observe_leaders(now, scene);
    }

    /// When the event was, if it was.
    pub fn of(&self, event: FaultTrigger, stage: usize) -> Option<SimTime> {
        let set = self.sets.get(stage);
        match event {
            FaultTrigger::Detected => set?.detected,
            FaultTrigger::Grouped => set?.grouped,
            FaultTrigger::Queued => set?.queued,
            FaultTrigger::Gate => set?.gate,
            FaultTrigger::Passed => set?.passed,
            FaultTrigger::Reforming => set?.reforming,
            FaultTrigger::LeaderElected => self.elected.get(stage).copied(),
            FaultTrigger::GroupLeaderElected => self.group_elected.get(stage).copied(),
        }
    }

    fn observe_leaders(&mut self, now: SimTime, scene: &Scene<'_>) {
        self.leading.resize(scene.bodies.len(), None);
        for (drone, before) in self.leading.iter_mut().enumerate() {
            let leads =
                scene.answering(drone).and_then(|slot| (slot.leads()).then_some((slot.led, slot.obeyed.ballot)));
            if let Some((group, _)) = leads.filter(|_| *before != leads) {
                self.elected.push(now);
                self.group_elected.extend((group != GroupId::ALL).then_some(now));
            }
            *before = leads;
        }
    }
}

impl Set {
    fn observe(&mut self, number: usize, now: SimTime, scene: &Scene<'_>) {
        let stages = scene.stages;
        if self.detected.is_none() && stages.is_detected(number) {
            self.detected = Some(now);
            self.before = scene.processes.iter().map(|process| process.slot.obeyed).collect();
        }
        let gate_x_m = stages.centre_x_m(number);
        let note = |moment: &mut Option<SimTime>, happens: bool| {
            if moment.is_none() && happens {
                *moment = Some(now);
            }
        };
        let any = |holds: &dyn Fn(usize, &Slot) -> bool| {
            (0..scene.bodies.len()).any(|drone| scene.answering(drone).is_some_and(|slot| holds(drone, slot)))
        };
        let past = |drone: usize| scene.bodies[drone].position.x >= gate_x_m;
        if self.detected.is_some() {
            let avoids = |drone: usize, slot: &Slot| {
                slot.phase() == Phase::Avoid && slot.obeyed != self.before[drone] && !past(drone)
            };
            note(&mut self.grouped, any(&avoids));
            let queues = |drone: usize, slot: &Slot| slot.is_queued() && avoids(drone, slot);
            note(&mut self.queued, any(&queues));
        }
        note(&mut self.gate, scene.bodies.iter().enumerate().any(|(drone, body)| body.alive && past(drone)));
        note(&mut self.passed, stages.is_passed(number));
        note(&mut self.reforming, any(&|drone, slot| past(drone) && slot.phase() == Phase::Reform));
    }
}
