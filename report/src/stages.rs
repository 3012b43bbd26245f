//! How each obstacle set was passed: by which routes, in which groups, under which plan.

use crate::facts::{ObstacleSet, RunFacts};
use crate::summary::{Stage, StageGroup};
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::payload::{MAX_SET, NO_ROUTE, Plan};
use skein_protocol::record::DroneRow;
use skein_protocol::{Course, GroupId, Message, Phase, PlanStamp, horizontal};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// More than arrivals lose on their way between leaders, which is in single precision, s.
const ROUNDING_S: f64 = 1e-3;

/// Follows all stages of a mission. A stage is an obstacle set that the swarm passes.
pub(crate) struct Stages {
    course: Course,
    stages: Vec<Progress>,
    plans: BTreeMap<PlanStamp, AvoidPlan>,
    /// By plan: the longest free flight to the gate that an assignment names, s.
    free_flights_s: BTreeMap<PlanStamp, f64>,
}

/// What is known of one stage so far.
struct Progress {
    set: ObstacleSet,
    detected_s: Option<f64>,
    passed_s: Option<f64>,
    /// For each drone, how it passes the set, or how it passed the gate.
    flown: Vec<Option<Flown>>,
    /// For each drone, whether it is past the gate.
    beyond: Vec<bool>,
}

/// How a drone passes a set.
#[derive(Clone, Copy)]
struct Flown {
    /// The plan that it obeys.
    stamp: PlanStamp,
    group: GroupId,
    route: u16,
    /// The drone that led it.
    leader: Option<u32>,
}

/// A plan to avoid a set, as its leader sent it first.
struct AvoidPlan {
    group: GroupId,
    obstacles: Vec<u32>,
    routes: u32,
    candidates: u32,
    /// When the plan was made, s.
    made_s: f64,
    predicted_s: Option<f64>,
}

impl Stages {
    /// For a run with these facts, before its first tick.
    pub(crate) fn new(facts: &RunFacts) -> Self {
        let drones = facts.drones as usize;
        let stage = |set| Progress {
            set,
            detected_s: None,
            passed_s: None,
            flown: vec![None; drones],
            beyond: vec![false; drones],
        };
        let stages = facts.sets().into_iter().map(stage).collect();
        Self { course: facts.course, stages, plans: BTreeMap::new(), free_flights_s: BTreeMap::new() }
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

    /// Takes the rows of a tick. Until a drone is past the gate, its plan and route may change.
    pub(crate) fn take_rows(&mut self, rows: &[DroneRow]) {
        for (drone, row) in rows.iter().enumerate().filter(|(_, row)| row.alive()) {
            let queued = row.is_queued() && row.route != NO_ROUTE;
            let plan = self.plans.get(&row.obeyed).filter(|_| queued);
            let ahead = self.stages.iter_mut().filter(|stage| stage.beyond.get(drone) == Some(&false));
            for stage in ahead {
                if plan.is_some_and(|plan| plan.obstacles.iter().any(|id| stage.set.obstacles.contains(id))) {
                    let (stamp, group, route) = (row.obeyed, row.group, row.route);
                    let before = stage.flown[drone].filter(|flown| flown.group == group).and_then(|flown| flown.leader);
                    let leader = leader(rows, row).or(before);
                    stage.flown[drone] = Some(Flown { stamp, group, route, leader });
                }
                stage.beyond[drone] = self.course.along(horizontal(row.position_m)) >= stage.set.gate_x_m;
            }
        }
    }

    /// The stages of the summary.
    pub(crate) fn finish(self) -> Vec<Stage> {
        self.stages.iter().map(|stage| self.summary(stage)).collect()
    }

    fn summary(&self, stage: &Progress) -> Stage {
        let plans = self.last_plans(stage);
        let routes = plans.iter().map(|plan| plan.routes).max();
        let split = routes.map(|routes| stage.split(routes));
        let predicted = plans.iter().filter_map(|plan| Some(plan.made_s + plan.predicted_s?)).max_by(f64::total_cmp);
        Stage {
            obstacles: stage.set.obstacles.clone(),
            detected_s: stage.detected_s,
            passed_s: stage.passed_s,
            pass_time_s: stage.passed_s.zip(stage.detected_s).map(|(passed, detected)| passed - detected),
            routes,
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
        for plan in stage.flown.iter().flatten().filter_map(|flown| self.plans.get(&flown.stamp)) {
            let newest = last.entry(plan.group).or_insert(plan);
            if plan.made_s > newest.made_s {
                *newest = plan;
            }
        }
        last.into_values().collect()
    }

    fn groups(&self, stage: &Progress) -> Vec<StageGroup> {
        let mut groups: BTreeMap<(GroupId, u16), Vec<u32>> = BTreeMap::new();
        for (drone, flown) in stage.passed_by() {
            groups.entry((flown.group, flown.route)).or_default().push(drone);
        }
        let group = |((group, route), drones): (_, Vec<u32>)| {
            let leader = stage.leader(&drones);
            StageGroup { name: GroupId::to_string(&group), route, leader, drones }
        };
        groups.into_iter().map(group).collect()
    }
}

impl Progress {
    /// The drones past the gate, and how they passed it.
    fn passed_by(&self) -> impl Iterator<Item = (u32, Flown)> + '_ {
        let flown = self.flown.iter().zip(&self.beyond).zip(0..);
        flown.filter_map(|((flown, beyond), drone)| flown.filter(|_| *beyond).map(|flown| (drone, flown)))
    }

    /// The drone that led most of these drones to the gate; of several, the one with the least number.
    fn leader(&self, drones: &[u32]) -> Option<u32> {
        let mut followers: BTreeMap<u32, usize> = BTreeMap::new();
        for leader in drones.iter().filter_map(|&drone| self.flown[drone as usize]?.leader) {
            *followers.entry(leader).or_default() += 1;
        }
        followers.into_iter().max_by_key(|&(leader, count)| (count, Reverse(leader))).map(|(leader, _)| leader)
    }

    /// Number of drones that passed by each route.
    fn split(&self, routes: u32) -> Vec<u32> {
        let mut split = vec![0; routes as usize];
        for (_, flown) in self.passed_by() {
            if let Some(count) = split.get_mut(usize::from(flown.route)) {
                *count += 1;
            }
        }
        split
    }
}

impl AvoidPlan {
    fn new(plan: &Plan) -> Self {
        let count = (plan.set_count as usize).min(MAX_SET);
        Self {
            group: plan.group,
            obstacles: plan.set[..count].iter().map(|id| id.0).collect(),
            // The index of a route is a u16; a frame with more routes is invalid.
            routes: plan.routes.min(u32::from(NO_ROUTE)),
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
