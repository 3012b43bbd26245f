//! Who takes which slot (paper, Algorithm 5).

use crate::geometry::nearest;
use crate::member::{Member, group_leaders};
use crate::params::Destination;
use crate::plan_bundle::PlanBundle;
use crate::planner::Planner;
use crate::situation::Situation;
use crate::slots::{self, Reformation};
use skein_protocol::payload::{Assignment, NO_ROUTE};
use skein_protocol::{GroupId, Phase, SimTime, Vec2};

/// Slots keep this many safe distances from drones that hang dead in the air.
const DEAD_BERTH: f64 = 1.05;
/// While a slot is too near to one, or to an obstacle, the anchor moves on in such steps, m.
const ANCHOR_STEP_M: f64 = 5.0;
/// So often at most: obstacles beyond all measure do not hold up the leader.
const MAX_ANCHOR_STEPS: u32 = 10_000;
/// A formation in which somebody cannot reach a slot opens its ranks by this, as a factor.
const OPEN_RANKS: f64 = 1.6;
/// Nobody moves faster than this, m/s, …
const STALLED_MPS: f64 = 0.5;
/// … for so long, s: somebody is stuck.
const STALLED_S: f64 = 3.0;

/// What a leader remembers while the formation closes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reform {
    /// Since when the members are others than those planned for.
    changed: Option<SimTime>,
    /// Since when nobody has moved although somebody is not in its slot.
    stalled: Option<SimTime>,
    /// Whether the ranks are open.
    open: bool,
    /// Whether the formation is made round a member that follows nobody, or that is the only one.
    round_one: bool,
}

impl Planner {
    /// Orders to fly in formation: once all are past everything, whenever the members change, and when they are stuck.
    pub(crate) fn formation(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        let obeyed = s.ledger.obeyed().filter(|bundle| bundle.plan.id.ballot == s.ballot);
        let passed = !s.ledger.sets().is_empty();
        let same =
            obeyed.is_some_and(|bundle| bundle.parts.iter().map(|part| part.drone).eq(s.members.iter().map(|m| m.id)));
        if !passed && same {
            self.reform.changed = None;
            return obeyed.filter(|bundle| self.stuck(s, bundle)).and_then(|bundle| {
                let round_one = s.members.iter().any(|m| is_alone(m, s));
                let open = !round_one && !self.reform.open;
                self.reform = Reform { open, round_one, ..Reform::default() };
                self.slots(s, bundle.plan.phase())
            });
        }
        let changed = *self.reform.changed.get_or_insert(s.now);
        if !passed && obeyed.is_some() && s.now.since(changed) < self.params.debounce_s {
            return None;
        }
        self.reform = Reform::default();
        let avoided = s.ledger.obeyed().is_some_and(|bundle| bundle.plan.phase() != Phase::Cruise);
        self.slots(s, if passed || avoided { Phase::Reform } else { Phase::Cruise })
    }

    /// Whether nobody has moved for a while although somebody is not in its slot; also once open ranks are taken.
    fn stuck(&mut self, s: &Situation<'_>, bundle: &PlanBundle) -> bool {
        let anchor = Vec2::from(bundle.plan.anchor_m);
        let error = |m: &Member| match bundle.parts.get(m.id) {
            Some(part) => (anchor + Vec2::from(part.slot_m) - m.position).norm(),
            None => 0.0,
        };
        let worst = s.members.iter().map(error).fold(0.0, f64::max);
        let still = s.members.iter().all(|m| m.speed_mps < STALLED_MPS);
        if !still || bundle.plan.phase() != Phase::Reform || (worst <= self.params.arrival_error_m && !self.reform.open)
        {
            self.reform.stalled = None;
            return false;
        }
        let since = *self.reform.stalled.get_or_insert(s.now);
        s.now.since(since) >= STALLED_S
    }

    fn slots(&self, s: &Situation<'_>, phase: Phase) -> Option<PlanBundle> {
        let close = self.params.shape.slots(s.members.len(), self.params.spacing_m);
        let pinned = s.members.iter().position(|m| self.reform.round_one && is_alone(m, s));
        let (anchor, pin) = match pinned {
            Some(member) => self.anchor_at(s, &close, phase, member),
            None => (self.anchor(s, &close, phase), None),
        };
        let shape = if self.reform.open { opened(&close) } else { close };
        let places: Vec<Vec2> = shape.iter().map(|slot| slot + anchor).collect();
        let positions: Vec<Vec2> = s.members.iter().map(|m| m.position).collect();
        let taken = assign_pinned(self.params.reformation, positions, places, pin)?;
        let plan = self.plan(s, phase, &[], anchor);
        let split: Vec<&Member> = s.members.iter().filter(|m| m.group != GroupId::ALL).collect();
        let groups: Vec<GroupId> = s.members.iter().map(|m| group_of(m, &split)).collect();
        let leaders = group_leaders(s.members, &groups, &self.params.destination);
        let part = |(i, m): (usize, &Member)| Assignment {
            id: plan.id,
            scope: s.scope,
            group: groups[i],
            drone: m.id,
            leader: leaders[i],
            slot_m: shape[taken[i]].into(),
            arrival_s: 0.0,
            route: NO_ROUTE,
            rank: 0,
            reserved: 0,
        };
        Some(PlanBundle { plan, parts: s.members.iter().enumerate().map(part).collect() })
    }

    /// Where the front slot goes: the goal, or where the members are on average, clear of obstacles and of the dead.
    fn anchor(&self, s: &Situation<'_>, shape: &[Vec2], phase: Phase) -> Vec2 {
        if let (Destination::Goal { front_m }, Phase::Reform) = (self.params.destination, phase) {
            return front_m;
        }
        let count = s.members.len().max(1) as f64;
        let mean = |points: &mut dyn Iterator<Item = f64>| points.sum::<f64>() / count;
        let x = mean(&mut s.members.iter().map(|m| m.position.x)) - mean(&mut shape.iter().map(|slot| slot.x));
        let mut anchor = Vec2::new(x, self.params.course_y_m);
        let (mut steps, is_blocked) = (0, self.blocker(s));
        while phase == Phase::Reform && steps < MAX_ANCHOR_STEPS && is_blocked(shape, anchor) {
            anchor.x += ANCHOR_STEP_M;
            steps += 1;
        }
        anchor
    }

    /// Tells whether a slot of a shape with its front slot somewhere is too near to an obstacle or to a dead drone.
    fn blocker<'a>(&self, s: &Situation<'a>) -> impl Fn(&[Vec2], Vec2) -> bool + use<'a> {
        let keep_m = DEAD_BERTH * self.params.safe_distance_m;
        let clear_m = self.params.routes.planning_distance_m;
        let shapes: Vec<(Vec<Vec2>, f64)> =
            s.obstacles.iter().map(|(_, known)| (known.shape.vertices().collect(), known.shape.radius_m)).collect();
        let silent = s.silent;
        let shut = move |slot: Vec2| {
            silent.iter().any(|dead| (slot - dead).norm() < keep_m)
                || shapes.iter().any(|(core, radius_m)| (nearest(core, slot) - slot).norm() < radius_m + clear_m)
        };
        move |shape, front| shape.iter().any(|slot| shut(slot + front))
    }

    /// Where the front slot goes so that a member that goes its own way has a slot, and which one: the one it stands in, or
    /// else the goal's front slot, which is where it goes if it hears nobody.
    fn anchor_at(
        &self,
        s: &Situation<'_>,
        shape: &[Vec2],
        phase: Phase,
        member: usize,
    ) -> (Vec2, Option<(usize, usize)>) {
        let (usual, stands) = (self.anchor(s, shape, phase), s.members[member].position);
        let off = |slot: &usize| (stands - shape[*slot] - usual).norm();
        let nearest_of = |slots: &mut dyn Iterator<Item = usize>| slots.min_by(|a, b| off(a).total_cmp(&off(b)));
        let Destination::Hold { stop_x_m } = self.params.destination else {
            let here = nearest_of(&mut (0..shape.len())).filter(|slot| off(slot) <= self.params.arrival_error_m);
            return (usual, Some((member, here.unwrap_or(0))));
        };
        let is_blocked = self.blocker(s);
        // Who hears nobody, though there were others, may stand in a slot of theirs, whose front is beyond the stop.
        let least_x_m = if s.members.len() == 1 && !s.silent.is_empty() { f64::NEG_INFINITY } else { stop_x_m };
        let free = |slot: &usize| {
            let (anchor, mut others) = (stands - shape[*slot], shape.to_vec());
            others.remove(*slot);
            anchor.x >= least_x_m && !is_blocked(&others, anchor)
        };
        match nearest_of(&mut (0..shape.len()).filter(free)) {
            Some(slot) => (stands - shape[slot], Some((member, slot))),
            None => (usual, None),
        }
    }
}

/// Whether a member goes its own way: it follows nobody, or there is nobody else.
fn is_alone(member: &Member, s: &Situation<'_>) -> bool {
    !member.follows || s.members.len() == 1
}

/// Who takes which slot; `pin`: a member, by place, and the slot it is in already. `None` without a slot for everybody.
fn assign_pinned(
    method: Reformation,
    mut positions: Vec<Vec2>,
    mut places: Vec<Vec2>,
    pin: Option<(usize, usize)>,
) -> Option<Vec<usize>> {
    if let Some((member, slot)) = pin {
        positions.remove(member);
        places.remove(slot);
    }
    let mut taken = slots::assign_by(method, &positions, &places).ok()?;
    if let Some((member, slot)) = pin {
        taken.iter_mut().filter(|other| **other >= slot).for_each(|other| *other += 1);
        taken.insert(member, slot);
    }
    Some(taken)
}

/// The group a member stays in; an orphan, of no group while others are `split`, joins the one of the nearest of them.
fn group_of(member: &Member, split: &[&Member]) -> GroupId {
    if member.group != GroupId::ALL {
        return member.group;
    }
    let near = |m: &Member| (m.position - member.position).norm_squared();
    split.iter().min_by(|a, b| near(a).total_cmp(&near(b)).then(a.id.cmp(&b.id))).map_or(GroupId::ALL, |m| m.group)
}

/// The shape with wider gaps, about its own centre: whoever is shut out finds a way in, and when the ranks close again
/// all move in proportion.
fn opened(shape: &[Vec2]) -> Vec<Vec2> {
    let centre = shape.iter().sum::<Vec2>() / shape.len().max(1) as f64;
    shape.iter().map(|slot| centre + (slot - centre) * OPEN_RANKS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinned_member_keeps_its_slot_and_the_others_share_the_rest() {
        let line = |xs: &[f64]| -> Vec<Vec2> { xs.iter().map(|&x| Vec2::new(x, 0.0)).collect() };
        let (drones, slots) = (line(&[0.0, 10.0, 20.0]), line(&[0.0, 10.0, 20.0]));
        let assign = |pin| assign_pinned(Reformation::Optimal, drones.clone(), slots.clone(), pin);
        assert_eq!(assign(None), Some(vec![0, 1, 2]));
        assert_eq!(assign(Some((2, 0))), Some(vec![1, 2, 0]));
        assert_eq!(assign(Some((0, 1))), Some(vec![1, 0, 2]));
        assert_eq!(assign_pinned(Reformation::Optimal, drones, line(&[0.0]), Some((0, 0))), None);
    }
}
