//! How each obstacle set was passed: by which routes, in which groups, under which plan.
//!
//! The routes are those that were flown: they follow from the tracks of the drones. A plan may be for a part of a set, and then it numbers
//! other routes.

use crate::facts::RunFacts;
use crate::flown_routes::FlownRoutes;
use crate::obstacle_set::ObstacleSet;
use crate::summary::{Stage, StageGroup};
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::payload::{MAX_SET, NO_ROUTE, Plan};
use skein_protocol::record::DroneRow;
use skein_protocol::{Course, GroupId, Message, Phase, PlanStamp, Vec2, horizontal};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// More than arrivals lose on their way between leaders, which is in single precision, s.
const ROUNDING_S: f64 = 1e-3;

/// Follows all stages of a mission. A stage is an obstacle set that the swarm passes.
pub(crate) struct Stages {
    course: Course,
    stages: Vec<Progress>,
    /// Where each drone was at the end of the last tick, in the frame of the course, m.
    places: Vec<Option<Vec2>>,
    plans: BTreeMap<PlanStamp, AvoidPlan>,
    /// By plan: the longest free flight to the gate that an assignment names, s.
    free_flights_s: BTreeMap<PlanStamp, f64>,
}

/// What is known of one stage so far.
struct Progress {
    set: ObstacleSet,
    detected_s: Option<f64>,
    passed_s: Option<f64>,
    /// For each drone that flies under a plan for the set or has passed the gate, in what company.
    flown: Vec<Option<Flown>>,
    /// For each drone, whether it is past the gate.
    beyond: Vec<bool>,
    /// For each drone, whether it has flown past the gate. A drone that starts behind the gate has not.
    passed: Vec<bool>,
    routes: FlownRoutes,
}

/// In what company a drone passes a set.
#[derive(Clone, Copy)]
struct Flown {
    /// The plan that it obeys; none if it passed without a plan for the set.
    stamp: Option<PlanStamp>,
    group: GroupId,
    /// The drone that led it.
    leader: Option<u32>,
}

/// A plan to avoid a set, as its leader sent it first.
struct AvoidPlan {
    group: GroupId,
    obstacles: Vec<u32>,
    candidates: u32,
    /// When the plan was made, s.
    made_s: f64,
    predicted_s: Option<f64>,
}

impl Stages {
    /// For a run with these facts, before its first tick.
    pub(crate) fn new(facts: &RunFacts) -> Self {
        let drones = facts.drones as usize;
        let stage = |set: ObstacleSet| Progress {
            routes: FlownRoutes::new(facts, &set),
            set,
            detected_s: None,
            passed_s: None,
            flown: vec![None; drones],
            beyond: vec![false; drones],
            passed: vec![false; drones],
        };
        let stages = facts.sets().into_iter().map(stage).collect();
        let (plans, free_flights_s) = Default::default();
        Self { course: facts.course, stages, places: vec![None; drones], plans, free_flights_s }
    }

    /// Notes that a living drone senses the set for the first time. Returns whether it is the first set that any drone
    /// senses.
    pub(crate) fn detected(&mut self, stage: u32, t_s: f64) -> bool {
        let first = self.stages.iter().all(|stage| stage.detected_s.is_none());
        let known = self.stages.get_mut(stage as usize);
        known.is_some_and(|stage| stage.detected_s.replace(stage.detected_s.unwrap_or(t_s)).is_none()) && first
    }

    /// Notes that the last living drone is past the set.
    pub(crate) fn passed(&mut self, stage: u32, t_s: f64) {
        if let Some(stage) = self.stages.get_mut(stage as usize) {
            stage.passed_s.get_or_insert(t_s);
        }
    }

    /// Whether all sets are passed; true without obstacles.
    pub(crate) fn all_passed(&self) -> bool {
        self.stages.iter().all(|stage| stage.passed_s.is_some())
    }

    /// Whether the mission has obstacles.
    pub(crate) fn any(&self) -> bool {
        !self.stages.is_empty()
    }

    /// Takes the plans and assignments that were sent in a tick.
    pub(crate) fn take_frames(&mut self, frames: &[AirFrame]) {
        let kinds = [Topic::Plan as u16, Topic::Assignment as u16];
        for frame in frames.iter().filter(|frame| kinds.contains(&frame.frame.kind)) {
            match Message::decode(&frame.frame) {
                Ok(Message::Plan(plan)) if plan.phase() == Phase::Avoid => {
                    self.plans.entry(plan.id).or_insert_with(|| AvoidPlan::new(&plan));
                }
                Ok(Message::Assignment(part)) if part.route != NO_ROUTE => {
                    let longest_s = self.free_flights_s.entry(part.id).or_insert(part.arrival_s);
                    *longest_s = longest_s.max(part.arrival_s);
                }
                // Frames that no receiver can decode are no plans.
                _ => {}
            }
        }
    }

    /// Takes the rows of a tick. Until a drone is past the gate, its plan may change.
    pub(crate) fn take_rows(&mut self, rows: &[DroneRow]) {
        for (drone, row) in rows.iter().enumerate().filter(|(_, row)| row.alive()) {
            let Some(before) = self.places.get_mut(drone) else { continue };
            let place = self.course.from_world(horizontal(row.position_m));
            let before = before.replace(place);
            let queued = row.is_queued() && row.route != NO_ROUTE;
            let plan = self.plans.get(&row.obeyed).filter(|_| queued);
            for stage in &mut self.stages {
                stage.routes.take(drone, before, place);
                if stage.beyond[drone] {
                    continue;
                }
                if plan.is_some_and(|plan| plan.obstacles.iter().any(|id| stage.set.obstacles.contains(id))) {
                    stage.flies_with(drone, rows, Some(row.obeyed));
                }
                stage.beyond[drone] = place.x >= stage.set.gate_x_m;
                if stage.beyond[drone] && before.is_some() {
                    stage.passed[drone] = true;
                    if stage.flown[drone].is_none() {
                        stage.flies_with(drone, rows, None);
                    }
                }
            }
        }
    }

    /// The stages of the summary.
    pub(crate) fn finish(self) -> Vec<Stage> {
        self.stages.iter().map(|stage| self.summary(stage)).collect()
    }

    fn summary(&self, stage: &Progress) -> Stage {
        let plans = self.last_plans(stage);
        let split = stage.detected_s.map(|_| self.split(stage));
        let predicted = plans.iter().filter_map(|plan| Some(plan.made_s + plan.predicted_s?)).max_by(f64::total_cmp);
        Stage {
            obstacles: stage.set.obstacles.clone(),
            detected_s: stage.detected_s,
            passed_s: stage.passed_s,
            pass_time_s: stage.passed_s.zip(stage.detected_s).map(|(passed, detected)| passed - detected),
            routes: Some(stage.routes.count()),
            split_left_right: split.as_deref().and_then(left_right),
            split,
            predicted_s: predicted.zip(stage.detected_s).map(|(instant, detected)| instant - detected),
            forecasts_too_short: self.forecasts_too_short(stage),
            candidates_rehearsed: plans.iter().map(|plan| plan.candidates).max(),
            groups: stage.detected_s.map(|_| self.groups(stage)),
        }
    }

    /// Number of plans for the set whose forecast is shorter than the free flight of one of their drones. `None` without plans.
    fn forecasts_too_short(&self, stage: &Progress) -> Option<u32> {
        let set = &stage.set.obstacles;
        let plans = self.plans.iter().filter(|(_, plan)| plan.obstacles.iter().any(|id| set.contains(id)));
        let mut plans = plans.peekable();
        plans.peek()?;
        let free_s = |stamp: &PlanStamp| self.free_flights_s.get(stamp).map_or(0.0, |free_s| free_s - ROUNDING_S);
        let short = plans.filter(|(stamp, plan)| plan.predicted_s.is_some_and(|forecast_s| forecast_s < free_s(stamp)));
        Some(short.count() as u32)
    }

    /// The last plan for each group, among the plans under which drones passed the set.
    fn last_plans(&self, stage: &Progress) -> Vec<&AvoidPlan> {
        let mut last: BTreeMap<GroupId, &AvoidPlan> = BTreeMap::new();
        for plan in stage.flown.iter().flatten().filter_map(|flown| self.plans.get(&flown.stamp?)) {
            let newest = last.entry(plan.group).or_insert(plan);
            if plan.made_s > newest.made_s {
                *newest = plan;
            }
        }
        last.into_values().collect()
    }

    /// The drones that passed the gate of a stage, each with its group and the route that it flew.
    fn passed_by<'a>(&'a self, stage: &'a Progress) -> impl Iterator<Item = (u32, GroupId, u16)> + 'a {
        let one = |drone: usize| {
            let flown = stage.flown[drone].filter(|_| stage.passed[drone])?;
            Some((drone as u32, flown.group, stage.routes.of(drone, self.places[drone]?)))
        };
        (0..stage.flown.len()).filter_map(one)
    }

    /// Number of drones that passed by each route.
    fn split(&self, stage: &Progress) -> Vec<u32> {
        let mut split = vec![0; stage.routes.count() as usize];
        for (_, _, route) in self.passed_by(stage) {
            split[usize::from(route)] += 1;
        }
        split
    }

    fn groups(&self, stage: &Progress) -> Vec<StageGroup> {
        let mut groups: BTreeMap<(GroupId, u16), Vec<u32>> = BTreeMap::new();
        for (drone, group, route) in self.passed_by(stage) {
            groups.entry((group, route)).or_default().push(drone);
        }
        let group = |((group, route), drones): (_, Vec<u32>)| {
            let leader = stage.leader(&drones);
            StageGroup { name: GroupId::to_string(&group), route, leader, drones }
        };
        groups.into_iter().map(group).collect()
    }
}

impl Progress {
    /// Notes in what company a drone flies now, and under which plan for the set.
    fn flies_with(&mut self, drone: usize, rows: &[DroneRow], stamp: Option<PlanStamp>) {
        let group = rows[drone].group;
        let before = self.flown[drone].filter(|flown| flown.group == group).and_then(|flown| flown.leader);
        self.flown[drone] = Some(Flown { stamp, group, leader: leader(rows, &rows[drone]).or(before) });
    }

    /// The drone that led most of these drones to the gate; of several, the one with the least number.
    fn leader(&self, drones: &[u32]) -> Option<u32> {
        let mut followers: BTreeMap<u32, usize> = BTreeMap::new();
        for leader in drones.iter().filter_map(|&drone| self.flown[drone as usize]?.leader) {
            *followers.entry(leader).or_default() += 1;
        }
        followers.into_iter().max_by_key(|&(leader, count)| (count, Reverse(leader))).map(|(leader, _)| leader)
    }
}

impl AvoidPlan {
    fn new(plan: &Plan) -> Self {
        let count = (plan.set_count as usize).min(MAX_SET);
        Self {
            group: plan.group,
            obstacles: plan.set[..count].iter().map(|id| id.0).collect(),
            candidates: plan.candidates,
            made_s: plan.stamp.secs(),
            predicted_s: plan.predicted_s.is_finite().then_some(plan.predicted_s),
        }
    }
}

/// The drone that leads this drone: the claimant of the term that it obeys, if that drone leads a group with it.
fn leader(rows: &[DroneRow], row: &DroneRow) -> Option<u32> {
    let claimant = row.term.claimant;
    let leads = rows.get(claimant.index()).filter(|leader| leader.alive() && leader.leads());
    leads.filter(|leader| row.term.is_some() && leader.led.contains(row.group)).map(|_| claimant.0)
}

/// The split past a set with exactly two routes, as `[left, right]`.
fn left_right(split: &[u32]) -> Option<[u32; 2]> {
    match split {
        [right, left] => Some([*left, *right]),
        _ => None,
    }
}
