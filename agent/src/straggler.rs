//! A drone that no other drone hears is given no slot in the formation. It joins behind the last slot on its own.

use crate::guidance::anchor;
use crate::tuning::UNHEARD_S;
use skein_protocol::formation::Shape;
use skein_protocol::payload::Plan;
use skein_protocol::{GroupId, MessageRef, Phase, SimTime, Vec2};

/// What a drone knows of the others' formation, and since when none of them follows it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Straggler {
    /// The latest formation of the whole swarm, in any term.
    formation: Option<Plan>,
    unfollowed_since: Option<SimTime>,
}

/// What the drone itself obeys.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OwnPlan {
    /// Whether the drone leads and no other drone shows its term. In a group of one drone this is always so.
    pub(crate) unfollowed: bool,
    /// When the plan was made by which the drone passes obstacles, or its part of the swarm goes on by itself; `None` if it obeys another kind
    /// of plan.
    pub(crate) apart_since: Option<SimTime>,
}

impl Straggler {
    /// Notes the formation that a message announces, in a swarm of `drones`.
    pub(crate) fn hear(&mut self, drones: u32, message: MessageRef<'_>) {
        let MessageRef::Plan(plan) = message else { return };
        let later = self.formation.is_none_or(|known| plan.stamp > known.stamp);
        if later && plan.members <= drones && plan.phase() != Phase::Avoid && plan.group == GroupId::ALL {
            self.formation = Some(*plan);
        }
    }

    /// The place behind the others' formation (world frame, m) and its velocity (m/s), once the drone has been
    /// unfollowed for [`UNHEARD_S`]: the last slot of a formation with one drone more.
    pub(crate) fn slot(&mut self, now: SimTime, own: OwnPlan, shape: &Shape, spacing_m: f64) -> Option<(Vec2, Vec2)> {
        self.unfollowed_since = own.unfollowed.then(|| self.unfollowed_since.unwrap_or(now));
        let unheard = self.unfollowed_since.is_some_and(|since| now.since(since) >= UNHEARD_S);
        // A formation from before the obstacles is behind the drone, where others are still passing, or in front of the obstacles.
        let current = |plan: &&Plan| own.apart_since.is_none_or(|since| plan.stamp > since);
        let plan = self.formation.as_ref().filter(|_| unheard).filter(current)?;
        let (front, velocity) = anchor(plan, now);
        Some((front + *shape.slots(plan.members as usize + 1, spacing_m).last()?, velocity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_drone_that_is_not_heard_takes_the_next_slot_until_it_is_followed() {
        let plan = Plan { phase: Phase::Reform.to_wire(), members: 2, anchor_m: [50.0, 7.0], ..Plan::zeroed() };
        let shape = Shape::Offsets(vec![[0.0, 0.0], [-10.0, 0.0], [-20.0, 5.0]]);
        let mut straggler = Straggler::default();
        let slot = |straggler: &mut Straggler, now_s, unfollowed| {
            let own = OwnPlan { unfollowed, apart_since: None };
            straggler.slot(SimTime::from_secs(now_s), own, &shape, 10.0)
        };
        assert_eq!(slot(&mut straggler, 0.0, true), None);
        assert_eq!(slot(&mut straggler, 6.0, true), None, "it knows of no formation");
        straggler.hear(3, MessageRef::Plan(&Plan { members: u32::MAX, stamp: SimTime::from_secs(1.0), ..plan }));
        assert_eq!(slot(&mut straggler, 6.0, true), None, "a formation of more drones than the swarm has");
        straggler.hear(3, MessageRef::Plan(&plan));
        assert_eq!(slot(&mut straggler, 6.1, true), Some((Vec2::new(30.0, 12.0), Vec2::zeros())));
        assert_eq!(slot(&mut straggler, 6.2, false), None);
        assert_eq!(slot(&mut straggler, 6.3, true), None, "it may last a moment only");
    }

    #[test]
    fn a_drone_does_not_return_to_a_formation_from_before_its_obstacles() {
        let made = |stamp_s| Plan {
            stamp: SimTime::from_secs(stamp_s),
            phase: Phase::Reform.to_wire(),
            members: 1,
            ..Plan::zeroed()
        };
        let shape = Shape::Offsets(vec![[0.0, 0.0], [-10.0, 0.0]]);
        let own = OwnPlan { unfollowed: true, apart_since: Some(SimTime::from_secs(2.0)) };
        let mut straggler = Straggler::default();
        straggler.hear(3, MessageRef::Plan(&made(1.0)));
        straggler.slot(SimTime::from_secs(3.0), own, &shape, 10.0);
        assert_eq!(straggler.slot(SimTime::from_secs(60.0), own, &shape, 10.0), None);
        straggler.hear(3, MessageRef::Plan(&made(50.0)));
        assert!(straggler.slot(SimTime::from_secs(60.0), own, &shape, 10.0).is_some());
    }
}
