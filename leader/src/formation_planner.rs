//! Which drone takes which slot of the formation (paper, Algorithm 5).

use crate::draft::draft;
use crate::formation_pace::FormationPace;
use crate::geometry::{nearest, separation};
use crate::member::{Member, group_leaders};
use crate::params::Destination;
use crate::plan_bundle::PlanBundle;
use crate::silent::Silent;
use crate::situation::Situation;
use crate::slots::{self, Reformation, TooFewSlots};
use crate::tuning::{ANCHOR_STEP_M, DEAD_S, FRONT_LOST_S, MAX_WAYS_DRONES, OPEN_RANKS, OPENINGS, STALLED_S};
use crate::visibility::VisibilityMap;
use skein_protocol::formation::{GoalGround, HOLD_SPEED_MPS, SLOT_BERTH};
use skein_protocol::payload::{Assignment, MAX_SET, NO_ROUTE, Plan};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{GroupId, ObstacleId, Phase, SimTime, Vec2};
use std::{iter, slice};

/// Most steps by which the anchor moves on. Obstacles without end do not hold up the leader.
const MAX_ANCHOR_STEPS: u32 = 10_000;
/// Distances that differ by less than this are equal, m.
const ROUNDING_M: f64 = 1e-6;
/// The time after which members at rest are stuck doubles at most this often: from 3 s to 96 s.
const MAX_DOUBLINGS: u32 = 5;

/// What a leader remembers while the formation closes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FormationPlanner {
    /// Since when the members differ from those planned for.
    changed: Option<SimTime>,
    /// Since when all members are at rest although one is not in its slot.
    stalled: Option<SimTime>,
    /// Whether the ranks are open.
    open: bool,
    /// Whether the members have changed their slots since the ranks were last closed.
    swapped: bool,
    /// Whether drones were still shut out of their slots after the ranks had been open. From then on slots are assigned by
    /// [`Reformation::Optimal`], whatever the scenario's method.
    shut_out: bool,
    /// How often the ranks were closed again since the formation began to close.
    closings: u32,
    /// Whether a drone that was shut out has been given the slot that is nearest to it since the ranks were last closed.
    pushed: bool,
    /// Whether the formation is built around a member that follows no leader, or that is the only one.
    pinned: bool,
    pace: FormationPace,
    /// Number of slots that the newest plan keeps for drones that may be out of reach.
    kept: usize,
    /// Since when this drone, which hears no other, cannot come to the front slot at the goal.
    front_taken: Option<SimTime>,
}

/// A member that is to have a certain slot. Both are indices.
#[derive(Clone, Copy, Debug)]
struct Pin {
    member: usize,
    slot: usize,
}

impl FormationPlanner {
    /// A plan to fly in formation: once all have passed all obstacles, whenever the members change, and when they are
    /// stuck.
    pub(crate) fn decide(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        let plan = self.choose(s);
        if let Some(bundle) = &plan {
            self.kept = if bundle.plan.phase() == Phase::Reform { missing(s) } else { 0 };
        }
        plan
    }

    fn choose(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        self.front_taken = is_front_taken(s).then(|| self.front_taken.unwrap_or(s.now));
        let obeyed = s.ledger.obeyed().filter(|bundle| bundle.plan.id.ballot == s.ballot);
        let passed = !s.ledger.sets().is_empty();
        let same =
            obeyed.is_some_and(|bundle| bundle.parts.iter().map(|part| part.drone).eq(s.members.iter().map(|m| m.id)));
        if !passed && same && missing(s) >= self.kept {
            self.changed = None;
            if obeyed.is_some_and(|bundle| has_stopped_short(bundle, s) || cruises_into_bay(bundle, s)) {
                return self.assign(s, Phase::Reform);
            }
            if obeyed.is_some_and(|bundle| ends_before_obstacle(bundle, s)) && self.pace.allows(s) {
                self.pace.note(s);
                return self.assign(s, Phase::Reform);
            }
            if let Some(plan) = obeyed.and_then(|bundle| self.avoid_dead(s, bundle)) {
                return Some(plan);
            }
            return obeyed.filter(|bundle| self.is_stuck(s, bundle)).and_then(|bundle| self.loosen(s, bundle));
        }
        let changed = *self.changed.get_or_insert(s.now);
        if !passed && obeyed.is_some() && (s.now.since(changed) < s.params.debounce_s || !self.pace.allows(s)) {
            return None;
        }
        self.pace.note(s);
        *self = Self { pace: self.pace, front_taken: self.front_taken, ..Self::default() };
        // A part of the swarm cruises only between obstacle sets.
        let parted = |plan: &Plan| plan.group != GroupId::ALL;
        let avoided = s.ledger.obeyed().is_some_and(|b| b.plan.phase() != Phase::Cruise || parted(&b.plan));
        let reform = passed || avoided || s.obstacles.goal_is_in_bay();
        self.assign(s, if reform { Phase::Reform } else { Phase::Cruise })
    }

    /// Whether the front slot at the goal is taken for ever, as far as this drone can tell, which hears no other.
    fn is_front_lost(&self, s: &Situation<'_>) -> bool {
        self.front_taken.is_some_and(|since| s.now.since(since) >= FRONT_LOST_S)
    }

    /// The plan with other slots, if a dead drone has come to rest beside a slot at the goal, or not as near to one as it seemed; or the plan with
    /// slots farther on, if a drone that hangs beside one has turned out to be dead.
    fn avoid_dead(&mut self, s: &Situation<'_>, bundle: &PlanBundle) -> Option<PlanBundle> {
        if self.open || s.silent.is_empty() || bundle.plan.phase() != Phase::Reform || !self.pace.allows(s) {
            return None;
        }
        if let Destination::Hold { .. } = s.params.destination {
            let plan =
                (s.params.radio_range_m.is_finite() && hits_dead(bundle, s)).then(|| self.assign(s, Phase::Reform))?;
            self.pace.note(s);
            return plan;
        }
        let free = slots_of(s, Phase::Reform, self.is_front_lost(s));
        if bundle.parts.iter().all(|part| free.contains(&part.slot_m.into())) {
            return None;
        }
        let plan = self.assign(s, Phase::Reform).filter(|plan| takes_other_slots(plan, bundle))?;
        self.pace.note(s);
        Some(plan)
    }

    /// Whether all members have been at rest for a while although one is not in its slot, or although the ranks are open. A formation that
    /// cruises can be stuck once it has stopped.
    fn is_stuck(&mut self, s: &Situation<'_>, bundle: &PlanBundle) -> bool {
        let (anchor, _) = bundle.plan.anchor_at(s.now);
        let stands = match bundle.plan.phase() {
            Phase::Reform => true,
            Phase::Cruise => bundle.plan.anchor_stops().is_some_and(|stops| s.now >= stops),
            Phase::Avoid => false,
        };
        let error = |m: &Member| match bundle.parts.get(m.id) {
            Some(part) => (anchor + Vec2::from(part.slot_m) - m.position).norm(),
            None => 0.0,
        };
        let hold_mps = s.params.routes.scale.speed(HOLD_SPEED_MPS);
        let worst = s.members.iter().map(error).fold(0.0, f64::max);
        let still = s.members.iter().all(|m| m.speed_mps < hold_mps);
        if !still || !stands || (worst <= s.params.arrival_error_m && !self.open) {
            self.stalled = None;
            return false;
        }
        let since = *self.stalled.get_or_insert(s.now);
        s.now.since(since) >= self.patience_s()
    }

    /// Whether members have been stuck since the formation began to close: a drone may hang in a slot where the leader does not see it.
    fn was_stuck(&self) -> bool {
        self.swapped || self.open || self.shut_out
    }

    /// For how long all members are at rest before they are stuck, s. Drones that only move once others have answered them over a slow
    /// radio may rest for longer than usual. Therefore the time doubles whenever the ranks have opened and closed in vain.
    fn patience_s(&self) -> f64 {
        let doublings = self.closings.saturating_sub(1).min(MAX_DOUBLINGS);
        STALLED_S * f64::from(1_u32 << doublings)
    }

    /// The plan for members that are stuck. A drone that has reached its slot may shut others out of theirs: first each takes the slot that
    /// is best from where it stands now. If that changes nothing, the ranks open, and then they close again, with the slots that are best
    /// for all. If that does not help either, a drone that is shut out takes the slot that is nearest to it, and the drone there goes on.
    fn loosen(&mut self, s: &Situation<'_>, bundle: &PlanBundle) -> Option<PlanBundle> {
        let pinned = s.members.iter().any(|m| is_alone(m, s));
        let shut_out = self.shut_out || self.open;
        let closings = self.closings + u32::from(self.open);
        let (pace, front_taken) = (self.pace, self.front_taken);
        let fresh = Self { pinned, shut_out, closings, pace, front_taken, ..Self::default() };
        if !pinned && !self.open && !self.swapped {
            let swapped = Self { swapped: true, ..fresh };
            let plan = swapped.assign(s, Phase::Reform);
            if plan.as_ref().is_some_and(|plan| takes_other_slots(plan, bundle)) {
                *self = swapped;
                return plan;
            }
        }
        if !pinned && !self.open && self.closings > 0 && !self.pushed {
            let pushed = Self { pushed: true, ..fresh };
            let pin = |places: &[Vec2]| nearest_for_shut_out(s, bundle, places);
            let plan = pushed.assign_with(s, Phase::Reform, pin);
            if plan.as_ref().is_some_and(|plan| takes_other_slots(plan, bundle)) {
                *self = pushed;
                return plan;
            }
        }
        *self = Self { open: !pinned && !self.open, ..fresh };
        self.assign(s, Phase::Reform)
    }

    /// The plan that assigns the slots. `None` without a slot for every member.
    fn assign(&self, s: &Situation<'_>, phase: Phase) -> Option<PlanBundle> {
        self.assign_with(s, phase, |_| None)
    }

    /// The same. `given`: the slot of one member, if it is chosen beforehand, from the places of the slots, world frame, m.
    fn assign_with(
        &self,
        s: &Situation<'_>,
        phase: Phase,
        given: impl Fn(&[Vec2]) -> Option<Pin>,
    ) -> Option<PlanBundle> {
        let close = slots_of(s, phase, self.is_front_lost(s));
        let occupied = if self.was_stuck() { Occupied::of(s) } else { Occupied::seen(s) };
        let (anchor, pin) = match s.members.iter().position(|m| self.pinned && is_alone(m, s)) {
            Some(member) => anchor_for(s, &close, phase, member),
            None => (anchor(s, &close, phase, &occupied), None),
        };
        let shape = if self.open { opened(&close, anchor, &occupied) } else { close };
        let places: Vec<Vec2> = shape.iter().map(|slot| slot + anchor).collect();
        let positions: Vec<Vec2> = s.members.iter().map(|m| m.position).collect();
        let method = if self.shut_out { Reformation::Optimal } else { s.params.reformation };
        let pin = pin.or_else(|| given(&places));
        let ways = if phase == Phase::Reform { ways(s) } else { None };
        let taken = assign_pinned(positions, places, pin, |positions, places| match &ways {
            Some(map) => slots::assign_along(method, positions, places, |a, b| way_m(map, a, b)),
            None => slots::assign_by(method, positions, places),
        })?;
        let passed = if phase == Phase::Reform { newest_passed(s) } else { Vec::new() };
        let mut plan = draft(s, phase, &passed, anchor);
        if phase == Phase::Reform && anchor.x < plan.anchor_stop_x_m {
            let stop = Vec2::new(plan.anchor_stop_x_m, anchor.y);
            plan.anchor_stop_x_m = clear_anchor(s, &shape, stop, &occupied).x;
        }
        let split: Vec<&Member> = s.members.iter().filter(|m| m.group != GroupId::ALL).collect();
        let groups: Vec<GroupId> = s.members.iter().map(|m| group_of(m, &split)).collect();
        let leaders = group_leaders(s.members, &groups, &s.params.destination);
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
}

/// The obstacles that all members have passed, as far as the leader knows obstacles, ascending: when the formation closes, all sets that
/// it knows are passed. If they are more than a plan can name, those that end farthest on.
fn newest_passed(s: &Situation<'_>) -> Vec<ObstacleId> {
    let mut ids: Vec<ObstacleId> = s.obstacles.to_be_passed().iter().flatten().copied().collect();
    let rear_m = |id: &ObstacleId| s.exit_x_m(slice::from_ref(id));
    ids.sort_by(|a, b| rear_m(b).total_cmp(&rear_m(a)).then(a.cmp(b)));
    ids.truncate(MAX_SET);
    ids.sort_unstable();
    ids
}

/// The slots of the members, relative to the front slot, m. At the goal, slots beside which a dead drone hangs are left free, and no slot is added
/// beside an obstacle. A drone that hears no other flies to the front slot, unless that one has been `taken` for long: if the others live, they
/// leave it to that drone.
fn slots_of(s: &Situation<'_>, phase: Phase, taken: bool) -> Vec<Vec2> {
    let (shape, spacing_m) = (&s.params.shape, s.params.spacing_m);
    let count = s.members.len() + if phase == Phase::Reform { missing(s) } else { 0 };
    match s.params.destination {
        Destination::Goal { front_m } if phase == Phase::Reform && (s.members.len() > 1 || taken) => {
            let (dead, obstacles) = (dead(s), s.obstacles.iter().map(|(_, known)| known.shape).collect::<Vec<_>>());
            let (safe_distance_m, clearance_m) = (s.params.safe_distance_m, s.params.routes.clearance_m);
            let ground = GoalGround { dead: &dead, obstacles: &obstacles, safe_distance_m, clearance_m };
            shape.free_slots(count, spacing_m, &ground, |slot| front_m + slot)
        }
        Destination::Goal { .. } => shape.slots(s.members.len(), spacing_m),
        Destination::Hold { .. } => shape.slots(count, spacing_m),
    }
}

/// Whether a silent drone is so near to the front slot at the goal that a drone which hears no other cannot come there.
fn is_front_taken(s: &Situation<'_>) -> bool {
    let Destination::Goal { front_m } = s.params.destination else { return false };
    s.members.len() == 1 && s.silent.iter().any(|silent| (silent.place - front_m).norm() < s.params.safe_distance_m)
}

/// Where the front slot goes: the goal; or the mean position of the members, moved on until it is clear of obstacles and
/// of dead drones. With a limited range, drones that are missing may be out of reach: the members do not wait farther on than where
/// all parts of the swarm come. They wait there if one of them has an obstacle ahead.
fn anchor(s: &Situation<'_>, shape: &[Vec2], phase: Phase, occupied: &Occupied) -> Vec2 {
    if let (Destination::Goal { front_m }, Phase::Reform) = (s.params.destination, phase) {
        return front_m;
    }
    let x = mean_x_m(s.members.iter().map(|m| m.position)) - mean_x_m(shape.iter().copied());
    if phase != Phase::Reform {
        return Vec2::new(x, s.params.course_y_m);
    }
    let misses = s.params.radio_range_m.is_finite() && !s.silent.is_empty();
    // All parts of the swarm are to close at one place.
    let x = if misses { x.min(meeting_x_m(s, shape)).max(past_x_m(s, shape)) } else { x };
    let x = if is_before_obstacle(s) { x.max(past_x_m(s, shape)) } else { x };
    clear_anchor(s, shape, Vec2::new(x, s.params.course_y_m), occupied)
}

/// The mean abscissa of these points, m; 0 without points.
fn mean_x_m(points: impl ExactSizeIterator<Item = Vec2>) -> f64 {
    let count = points.len().max(1) as f64;
    points.map(|point| point.x).sum::<f64>() / count
}

/// The least abscissa of the front slot beyond the stop for which all slots lie past all known obstacles, m.
fn meeting_x_m(s: &Situation<'_>, shape: &[Vec2]) -> f64 {
    past_x_m(s, shape).max(s.params.destination.stop_x_m())
}

/// The least abscissa of the front slot for which all slots lie past all known obstacles, m; −∞ without obstacles.
fn past_x_m(s: &Situation<'_>, shape: &[Vec2]) -> f64 {
    let last = shape.iter().map(|slot| slot.x).fold(0.0, f64::min);
    let past = |rear_m: f64| rear_m + s.params.routes.planning_distance_m - last;
    let rears = s.obstacles.iter().map(|(_, known)| known.shape.bounds().1.x);
    rears.map(past).fold(f64::NEG_INFINITY, f64::max)
}

/// The anchor, moved on until the slots of the shape are clear of obstacles and of dead drones.
pub(crate) fn moved_on(s: &Situation<'_>, shape: &[Vec2], anchor: Vec2) -> Vec2 {
    clear_anchor(s, shape, anchor, &Occupied::of(s))
}

fn clear_anchor(s: &Situation<'_>, shape: &[Vec2], mut anchor: Vec2, occupied: &Occupied) -> Vec2 {
    let mut steps = 0;
    while steps < MAX_ANCHOR_STEPS && shape.iter().any(|slot| occupied.blocks(slot + anchor)) {
        anchor.x += s.params.routes.scale.length(ANCHOR_STEP_M);
        steps += 1;
    }
    anchor
}

/// Where no slot can be: near obstacles and near dead drones.
struct Occupied {
    keep_m: f64,
    clear_m: f64,
    /// The vertices of each obstacle's core, m, and the radius around it, m.
    shapes: Vec<(Vec<Vec2>, f64)>,
    /// Where drones hang that are dead, as far as the leader knows.
    dead: Vec<Vec2>,
}

impl Occupied {
    fn of(s: &Situation<'_>) -> Self {
        let core = |shape: &ConvexShape| (shape.vertices().collect(), shape.radius_m);
        Self {
            keep_m: SLOT_BERTH * s.params.safe_distance_m,
            clear_m: s.params.routes.planning_distance_m,
            shapes: s.obstacles.iter().map(|(_, known)| core(&known.shape)).collect(),
            dead: dead(s),
        }
    }

    /// The same, but of dead drones only those that are known to hang where they are. A drone that was not heard for long may be anywhere.
    fn seen(s: &Situation<'_>) -> Self {
        let hang = s.silent.iter().filter(|silent| s.params.radio_range_m.is_infinite() || silent.hangs);
        Self { dead: hang.map(|silent| silent.place).collect(), ..Self::of(s) }
    }

    /// Whether a slot is too near to an obstacle or to a dead drone. World frame, m.
    fn blocks(&self, slot: Vec2) -> bool {
        self.is_near_dead(slot)
            || self.shapes.iter().any(|(core, radius_m)| (nearest(core, slot) - slot).norm() < radius_m + self.clear_m)
    }

    fn is_near_dead(&self, place: Vec2) -> bool {
        self.dead.iter().any(|dead| (place - dead).norm() < self.keep_m)
    }

    /// Whether a straight way leads nearer to an obstacle than a slot can be and than it begins, or its end is too near to a dead
    /// drone. World frame, m.
    fn blocks_way(&self, from: Vec2, to: Vec2) -> bool {
        let nearer = |(core, radius_m): &(Vec<Vec2>, f64)| {
            let begins_m = (nearest(core, from) - from).norm();
            separation(&[from, to], core).norm() < begins_m.min(radius_m + self.clear_m) - ROUNDING_M
        };
        self.is_near_dead(to) || self.shapes.iter().any(nearer)
    }
}

/// Number of drones that may be out of reach. The formation has slots for them, so that they need not be made room for when they come back.
fn missing(s: &Situation<'_>) -> usize {
    s.silent.iter().filter(|silent| !is_dead(s, silent)).count()
}

/// Where dead drones hang, world frame, m.
fn dead(s: &Situation<'_>) -> Vec<Vec2> {
    s.silent.iter().filter(|silent| is_dead(s, silent)).map(|silent| silent.place).collect()
}

/// Whether a silent drone counts as dead. With a limited range, one that has not been silent for long may be out of reach. Then it does not stay
/// where it was.
fn is_dead(s: &Situation<'_>, silent: &Silent) -> bool {
    s.params.radio_range_m.is_infinite() || silent.hangs || s.now.since(silent.since) >= DEAD_S
}

/// Where the front slot goes so that a member that follows no leader has a slot, and which slot that is: the one it
/// stands in, or else the goal's front slot, to which it flies if it hears no other drone.
fn anchor_for(s: &Situation<'_>, shape: &[Vec2], phase: Phase, member: usize) -> (Vec2, Option<Pin>) {
    let occupied = Occupied::of(s);
    let (usual, stands) = (anchor(s, shape, phase, &occupied), s.members[member].position);
    let off = |slot: &usize| (stands - shape[*slot] - usual).norm();
    let nearest_of = |slots: &mut dyn Iterator<Item = usize>| slots.min_by(|a, b| off(a).total_cmp(&off(b)));
    let Destination::Hold { stop_x_m } = s.params.destination else {
        let here = nearest_of(&mut (0..shape.len())).filter(|slot| off(slot) <= s.params.arrival_error_m);
        return (usual, Some(Pin { member, slot: here.unwrap_or(0) }));
    };
    // A drone that hears no other, though there were others, may stand in a slot whose front is beyond the stop.
    let least_x_m = if s.members.len() == 1 && !s.silent.is_empty() { f64::NEG_INFINITY } else { stop_x_m };
    let free = |slot: &usize| {
        let (anchor, mut others) = (stands - shape[*slot], shape.to_vec());
        others.remove(*slot);
        anchor.x >= least_x_m && !others.iter().any(|other| occupied.blocks(other + anchor))
    };
    match nearest_of(&mut (0..shape.len()).filter(free)) {
        Some(slot) => (stands - shape[slot], Some(Pin { member, slot })),
        None => (usual, None),
    }
}

/// The member that is farthest from its slot, and the slot that is nearest to it. `places`: of the slots, world frame, m.
fn nearest_for_shut_out(s: &Situation<'_>, bundle: &PlanBundle, places: &[Vec2]) -> Option<Pin> {
    let (anchor, _) = bundle.plan.anchor_at(s.now);
    let off_m =
        |m: &Member| bundle.parts.get(m.id).map_or(0.0, |part| (anchor + Vec2::from(part.slot_m) - m.position).norm());
    let members = s.members.iter().enumerate();
    let (member, shut_out) = members.max_by(|(_, a), (_, b)| off_m(a).total_cmp(&off_m(b)))?;
    let away_m = |slot: &usize| (places[*slot] - shut_out.position).norm();
    let slot = (0..places.len()).min_by(|a, b| away_m(a).total_cmp(&away_m(b)))?;
    Some(Pin { member, slot })
}

/// Whether a drone has another slot than before.
fn takes_other_slots(plan: &PlanBundle, before: &PlanBundle) -> bool {
    plan.parts.iter().any(|part| before.parts.get(part.drone).is_none_or(|old| old.slot_m != part.slot_m))
}

/// Whether the swarm has cruised up to its goal without any obstacle on the way, and its anchor stands beside the goal.
fn has_stopped_short(bundle: &PlanBundle, s: &Situation<'_>) -> bool {
    let Destination::Goal { front_m } = s.params.destination else { return false };
    let (anchor, velocity) = bundle.plan.anchor_at(s.now);
    bundle.plan.phase() == Phase::Cruise && velocity == Vec2::zeros() && (anchor - front_m).norm() > 0.0
}

/// Whether the swarm cruises towards a goal that lies in a bay. Its formation would be pushed against the walls.
fn cruises_into_bay(bundle: &PlanBundle, s: &Situation<'_>) -> bool {
    bundle.plan.phase() == Phase::Cruise && s.obstacles.goal_is_in_bay()
}

/// Whether a member has an obstacle ahead that the formation leaves behind it.
fn is_before_obstacle(s: &Situation<'_>) -> bool {
    s.members.iter().any(|m| m.before)
}

/// Whether a member has an obstacle ahead, and its formation closes before the end of it.
fn ends_before_obstacle(bundle: &PlanBundle, s: &Situation<'_>) -> bool {
    let planned = || bundle.parts.iter().map(|part| part.slot_m.into()).collect::<Vec<Vec2>>();
    let (anchor, _) = bundle.plan.anchor_at(s.now);
    is_before_obstacle(s) && anchor.x < past_x_m(s, &planned()) - ROUNDING_M
}

/// Whether a dead drone hangs beside a slot of a formation.
fn hits_dead(bundle: &PlanBundle, s: &Situation<'_>) -> bool {
    let (anchor, _) = bundle.plan.anchor_at(s.now);
    let occupied = Occupied::seen(s);
    bundle.parts.iter().any(|part| occupied.is_near_dead(anchor + Vec2::from(part.slot_m)))
}

/// Whether a member acts on its own: it does not follow this leader, or there is no other drone.
fn is_alone(member: &Member, s: &Situation<'_>) -> bool {
    !member.follows || s.members.len() == 1
}

/// The map of the ways to the slots, if these do not lead there straight: if the goal lies in a bay. `None` for swarms in which the search of a way
/// from each drone to each slot would take long.
fn ways(s: &Situation<'_>) -> Option<VisibilityMap> {
    if !s.obstacles.goal_is_in_bay() || s.members.len() > MAX_WAYS_DRONES {
        return None;
    }
    let mut map = VisibilityMap::new(s.params.routes.clearance_m);
    s.obstacles.iter().for_each(|(_, known)| map.add(&known.shape));
    Some(map)
}

/// The length of the way between two points, m: the distance if there is none.
fn way_m(map: &VisibilityMap, from: Vec2, to: Vec2) -> f64 {
    map.path(from, to).map_or_else(|| (to - from).norm(), |(_, length_m)| length_m)
}

/// The slot of each member, by index. `None` without a slot for every member. `assign` chooses the slots of those that are not given one.
fn assign_pinned(
    mut positions: Vec<Vec2>,
    mut places: Vec<Vec2>,
    pin: Option<Pin>,
    assign: impl Fn(&[Vec2], &[Vec2]) -> Result<Vec<usize>, TooFewSlots>,
) -> Option<Vec<usize>> {
    if let Some(Pin { member, slot }) = pin {
        positions.remove(member);
        places.remove(slot);
    }
    let mut taken = assign(&positions, &places).ok()?;
    if let Some(Pin { member, slot }) = pin {
        for other in taken.iter_mut().filter(|other| **other >= slot) {
            *other += 1;
        }
        taken.insert(member, slot);
    }
    Some(taken)
}

/// The group a member stays in. A member of no part, while others are `split`, joins the part of the nearest of them.
fn group_of(member: &Member, split: &[&Member]) -> GroupId {
    if member.group != GroupId::ALL {
        return member.group;
    }
    let near = |m: &Member| (m.position - member.position).norm_squared();
    split.iter().min_by(|a, b| near(a).total_cmp(&near(b)).then(a.id.cmp(&b.id))).map_or(GroupId::ALL, |m| m.group)
}

/// The shape, widened about its own centre, or else about the corner or the side of its bounding box for which the fewest drones meet
/// an obstacle on the way. If some meet one in any case, it is widened by less. `front`: position of the front slot, world frame, m. A
/// drone that is shut out finds a way in. When the ranks close again, all drones move in proportion.
fn opened(shape: &[Vec2], front: Vec2, occupied: &Occupied) -> Vec<Vec2> {
    let centre = shape.iter().sum::<Vec2>() / shape.len().max(1) as f64;
    let (low, high) = shape.iter().fold((centre, centre), |(low, high), slot| (low.inf(slot), high.sup(slot)));
    let middle = (low + high) / 2.0;
    let xs = [middle.x, low.x, high.x];
    let sides = xs.into_iter().flat_map(|x| [middle.y, low.y, high.y].map(|y| Vec2::new(x, y)));
    let widened = |(fixed, factor): (Vec2, f64)| move |slot: &Vec2| fixed + (slot - fixed) * factor;
    let met = |way: &(Vec2, f64)| {
        let meets = |slot: &&Vec2| occupied.blocks_way(*slot + front, widened(*way)(slot) + front);
        shape.iter().filter(meets).count()
    };
    let about = iter::once(centre).chain(sides);
    let factors = (0..OPENINGS).map(|less| OPEN_RANKS - (OPEN_RANKS - 1.0) * f64::from(less) / f64::from(OPENINGS));
    let ways = factors.flat_map(|factor| about.clone().map(move |fixed| (fixed, factor)));
    // Of equals the first: the widest, about the centre.
    let way = ways.min_by_key(met).unwrap_or((centre, 1.0));
    shape.iter().map(widened(way)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinned_member_keeps_its_slot_and_the_others_share_the_rest() {
        let line = |xs: &[f64]| -> Vec<Vec2> { xs.iter().map(|&x| Vec2::new(x, 0.0)).collect() };
        let (drones, slots) = (line(&[0.0, 10.0, 20.0]), line(&[0.0, 10.0, 20.0]));
        let optimal = |drones: &[Vec2], slots: &[Vec2]| slots::assign(drones, slots);
        let assign = |pin| assign_pinned(drones.clone(), slots.clone(), pin, optimal);
        assert_eq!(assign(None), Some(vec![0, 1, 2]));
        assert_eq!(assign(Some(Pin { member: 2, slot: 0 })), Some(vec![1, 2, 0]));
        assert_eq!(assign(Some(Pin { member: 0, slot: 1 })), Some(vec![1, 0, 2]));
        let front = Some(Pin { member: 0, slot: 0 });
        assert_eq!(assign_pinned(drones.clone(), line(&[0.0]), front, optimal), None);
    }

    /// Slots in a square whose sides are 10 m, and an obstacle of 2 m by 200 m at x = `wall_x_m`.
    fn opened_beside(wall_x_m: f64) -> Vec<Vec2> {
        let square = [(0.0, -5.0), (0.0, 5.0), (-10.0, -5.0), (-10.0, 5.0)].map(|(x, y)| Vec2::new(x, y));
        let wall = [(-1.0, -100.0), (1.0, -100.0), (1.0, 100.0), (-1.0, 100.0)];
        let wall = wall.map(|(x, y)| Vec2::new(x + wall_x_m, y)).to_vec();
        let occupied = Occupied { keep_m: 5.0, clear_m: 1.0, shapes: vec![(wall, 0.0)], dead: Vec::new() };
        opened(&square, Vec2::zeros(), &occupied)
    }

    #[test]
    fn ranks_open_away_from_walls() {
        let xs = |slots: Vec<Vec2>| [slots[0].x, slots[3].x];
        assert_eq!(xs(opened_beside(50.0)), [3.0, -13.0], "about the centre");
        assert_eq!(xs(opened_beside(4.0)), [0.0, -16.0], "a wall in front");
        assert_eq!(xs(opened_beside(-14.0)), [6.0, -10.0], "a wall behind");
        assert_eq!(xs(opened_beside(2.5)), [0.0, -16.0], "no slot is beyond the wall");
        assert_eq!(xs(opened_beside(1.5)), [0.0, -16.0], "a slot that stands near the wall comes no nearer");
    }
}
