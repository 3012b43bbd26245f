//! When the events happened that start faults.

use super::view::FaultView;
use crate::fault_plan::FaultTrigger;
use skein_protocol::slot::Slot;
use skein_protocol::{Ballot, GroupId, Phase, PlanStamp, SimTime};

/// When each event about one obstacle set happened.
#[derive(Clone, Debug, Default)]
struct SetTimes {
    detected: Option<SimTime>,
    /// What each drone obeyed at the detection. Those plans are not for this set.
    before: Vec<PlanStamp>,
    grouped: Option<SimTime>,
    queued: Option<SimTime>,
    gate: Option<SimTime>,
    passed: Option<SimTime>,
    reforming: Option<SimTime>,
}

/// When each event happened, as far as it has.
#[derive(Clone, Debug, Default)]
pub(crate) struct TriggerTimes {
    sets: Vec<SetTimes>,
    /// The group that each drone leads.
    leading: Vec<Option<(GroupId, Ballot)>>,
    elected: Vec<SimTime>,
    group_elected: Vec<SimTime>,
}

impl TriggerTimes {
    /// Looks for events at the beginning of a tick.
    pub(crate) fn observe(&mut self, now: SimTime, view: &FaultView<'_>) {
        self.sets.resize_with(view.stages.count(), SetTimes::default);
        for (number, set) in self.sets.iter_mut().enumerate() {
            set.observe(number, now, view);
        }
        self.observe_leaders(now, view);
    }

    /// When the event happened; `None` if it has not.
    pub(crate) fn of(&self, event: FaultTrigger, stage: usize) -> Option<SimTime> {
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

    fn observe_leaders(&mut self, now: SimTime, view: &FaultView<'_>) {
        self.leading.resize(view.drones.bodies().len(), None);
        for (drone, before) in self.leading.iter_mut().enumerate() {
            let leads =
                view.drones.answer(drone).and_then(|slot| slot.leads().then_some((slot.led, slot.obeyed.ballot)));
            if let Some((group, _)) = leads.filter(|_| *before != leads) {
                self.elected.push(now);
                self.group_elected.extend((group != GroupId::ALL).then_some(now));
            }
            *before = leads;
        }
    }
}

impl SetTimes {
    fn observe(&mut self, number: usize, now: SimTime, view: &FaultView<'_>) {
        let stages = view.stages;
        if self.detected.is_none() && stages.is_detected(number) {
            self.detected = Some(now);
            self.before = view.drones.processes().iter().map(|process| process.slot().obeyed).collect();
        }
        let gate_x_m = stages.centre_x_m(number);
        let note = |moment: &mut Option<SimTime>, happens: bool| {
            if moment.is_none() && happens {
                *moment = Some(now);
            }
        };
        let any = |holds: &dyn Fn(usize, &Slot) -> bool| view.drones.answers().any(|(drone, slot)| holds(drone, slot));
        let past = |drone: usize| stages.along_m(&view.drones.bodies()[drone]) >= gate_x_m;
        if self.detected.is_some() {
            let avoids = |drone: usize, slot: &Slot| {
                slot.phase() == Phase::Avoid && slot.obeyed != self.before[drone] && !past(drone)
            };
            note(&mut self.grouped, any(&avoids));
            let queues = |drone: usize, slot: &Slot| slot.is_queued() && avoids(drone, slot);
            note(&mut self.queued, any(&queues));
        }
        note(
            &mut self.gate,
            view.drones.bodies().iter().enumerate().any(|(drone, body)| body.is_alive() && past(drone)),
        );
        note(&mut self.passed, stages.is_passed(number));
        note(&mut self.reforming, any(&|drone, slot| past(drone) && slot.phase() == Phase::Reform));
    }
}
