//! What a group does that has passed an obstacle set while the swarm is not to close up before its destination: it closes its
//! own ranks and flies straight to the part of the final formation that its members will take.

use crate::draft::draft;
use crate::formation_planner::moved_on;
use crate::member::Member;
use crate::params::{Between, Destination, PlannerParams};
use crate::plan_bundle::PlanBundle;
use crate::situation::Situation;
use crate::slots;
use skein_protocol::payload::{Assignment, NO_ROUTE, Plan};
use skein_protocol::{DroneId, GroupId, Phase, SimTime, Vec2};

/// Whether groups go on by themselves: the formation, closed where the drones are on average, would have to fly on. `drones`:
/// where all living drones are, world frame, m.
pub(crate) fn is_under_way(params: &PlannerParams, drones: impl Iterator<Item = Vec2> + Clone) -> bool {
    let count = drones.clone().count();
    if params.between == Between::CloseUp || count == 0 {
        return false;
    }
    let shape = params.shape.slots(count, params.spacing_m);
    let anchor_x_m = (drones.map(|at| at.x).sum::<f64>() - shape.iter().map(|slot| slot.x).sum::<f64>()) / count as f64;
    anchor_x_m < params.destination.stop_x_m() - params.arrival_error_m
}

/// What the leader of a group remembers between two sets.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OnwardPlanner {
    /// Since when the members differ from those planned for.
    changed: Option<SimTime>,
}

impl OnwardPlanner {
    /// A plan to go on, once the group has passed all obstacles and whenever its members change. `None` for the whole swarm.
    pub(crate) fn decide(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        let all = s.members.iter().chain(s.others).map(|m| m.position);
        if s.scope == GroupId::ALL || !is_under_way(s.params, all) {
            return None;
        }
        let obeyed = s.ledger.obeyed().filter(|bundle| bundle.plan.id.ballot == s.ballot);
        let going_on = obeyed.filter(|bundle| bundle.plan.phase() == Phase::Cruise);
        let planned_for = going_on.map(|bundle| bundle.parts.iter().map(|part| part.drone));
        if planned_for.is_some_and(|drones| drones.eq(s.members.iter().map(|m| m.id))) {
            self.changed = None;
            return None;
        }
        let changed = *self.changed.get_or_insert(s.now);
        if going_on.is_some() && s.now.since(changed) < s.params.debounce_s {
            return None;
        }
        self.changed = None;
        go_on(s)
    }
}

/// The plan by which the group flies on. `None` without a slot for every drone.
fn go_on(s: &Situation<'_>) -> Option<PlanBundle> {
    let shape = s.params.shape.slots(s.members.len() + s.others.len(), s.params.spacing_m);
    let places = places(s, &shape)?;
    let count = places.len() as f64;
    let anchor = s.members.iter().zip(&places).map(|(m, place)| m.position - place).sum::<Vec2>() / count;
    let end = match s.params.destination {
        Destination::Goal { front_m } => front_m,
        Destination::Hold { stop_x_m } => moved_on(s, &shape, Vec2::new(stop_x_m, s.params.course_y_m)),
    };
    let way = (end - anchor).try_normalize(1e-9).filter(|way| way.x > 0.0).unwrap_or_default();
    let anchor_mps = (way * s.params.speed_mps).into();
    let plan = Plan { anchor_mps, anchor_stop_x_m: end.x, ..draft(s, Phase::Cruise, &[], anchor) };
    let leader = |m: &Member| s.ledger.obeyed().and_then(|bundle| bundle.parts.get(m.id)).map(|part| part.leader);
    let part = |(m, place): (&Member, &Vec2)| Assignment {
        id: plan.id,
        scope: s.scope,
        group: if s.scope.contains(m.group) { m.group } else { s.scope },
        drone: m.id,
        leader: leader(m).unwrap_or(DroneId::NONE),
        slot_m: (*place).into(),
        arrival_s: 0.0,
        route: NO_ROUTE,
        rank: 0,
        reserved: 0,
    };
    Some(PlanBundle { plan, parts: s.members.iter().zip(&places).map(part).collect() })
}

/// The slots of the members if the whole swarm closed up where it is now, relative to its front slot, m.
fn places(s: &Situation<'_>, shape: &[Vec2]) -> Option<Vec<Vec2>> {
    let mut all: Vec<&Member> = s.members.iter().chain(s.others).collect();
    all.sort_by_key(|m| m.id);
    let positions: Vec<Vec2> = all.iter().map(|m| m.position).collect();
    let count = all.len() as f64;
    let anchor = (positions.iter().sum::<Vec2>() - shape.iter().sum::<Vec2>()) / count;
    let slots: Vec<Vec2> = shape.iter().map(|slot| slot + anchor).collect();
    let taken = slots::assign_by(s.params.reformation, &positions, &slots).ok()?;
    let of = |m: &Member| all.binary_search_by_key(&m.id, |one| one.id).ok().map(|i| shape[taken[i]]);
    s.members.iter().map(of).collect()
}
