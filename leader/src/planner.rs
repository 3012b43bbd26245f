//! What a leader decides: when to plan, and for which drones (paper, Algorithms 1, 3 and 5). It knows what its own senses
//! and messages have told it.

use crate::avoidance;
use crate::formation_planner::FormationPlanner;
use crate::grouping::is_without_queues;
use crate::joint_planner::JointPlanner;
use crate::onward::OnwardPlanner;
use crate::params::LeadingParams;
use crate::plan_bundle::PlanBundle;
use crate::plan_pace::PlanPace;
use crate::situation::Situation;
use crate::survey::Survey;
use crate::task::{Task, learnt};
use skein_protocol::payload::Arrivals;
use skein_protocol::{DroneId, GroupId, ObstacleId, SimTime};

/// The planner of one drone. It decides only while the drone leads.
#[derive(Clone, Debug)]
pub(crate) struct Planner {
    joint: JointPlanner,
    formation: FormationPlanner,
    onward: OnwardPlanner,
    pace: PlanPace,
    /// Index of the alternative, of those decided on last, that is flown until a choice is made.
    interim: usize,
}

impl Planner {
    /// A planner that has decided nothing yet.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let joint = JointPlanner::new(params);
        let (formation, onward) = (FormationPlanner::default(), OnwardPlanner::default());
        Self { joint, formation, onward, pace: PlanPace::default(), interim: 0 }
    }

    /// Hears when a drone of another group can be where.
    pub(crate) fn hear(&mut self, now: SimTime, row: &Arrivals) {
        self.joint.hear(now, row);
    }

    /// Index of the alternative, of those decided on last, that is flown until a choice is made.
    pub(crate) fn interim(&self) -> usize {
        self.interim
    }

    /// A new plan, if there is something to decide; or alternatives for a rollout, the shortest paths first, the paper's
    /// rule second. Messages to other leaders go into `say`.
    pub(crate) fn decide(&mut self, s: &Situation<'_>, say: &mut Vec<Arrivals>) -> Vec<PlanBundle> {
        self.joint.answer_others(s, say);
        if let Some(bundle) = self.joint.chosen(s) {
            return vec![bundle];
        }
        match Task::next(s) {
            Task::Avoid(set) => {
                let due = s.now.since(learnt(s, &set)) >= s.params.debounce_s && self.pace.allows(s, &set);
                let bundles = due.then(|| self.avoid(s, &set, say)).flatten().unwrap_or_default();
                if !bundles.is_empty() {
                    self.pace.note(s, &set);
                }
                bundles
            }
            Task::Form if s.scope == GroupId::ALL => self.formation.decide(s).into_iter().collect(),
            Task::Form => self.onward.decide(s).into_iter().collect(),
            Task::Wait => Vec::new(),
        }
    }

    fn avoid(&mut self, s: &Situation<'_>, set: &[ObstacleId], say: &mut Vec<Arrivals>) -> Option<Vec<PlanBundle>> {
        let others = s.others_before(set);
        if self.joint.waits(s, set, &others) {
            return None;
        }
        let survey = Survey::new(s, set)?;
        self.interim = 0;
        if others.is_empty() || is_without_queues(s, survey.routes()) {
            return avoidance::alternatives(s, set, &survey);
        }
        let joint = self.joint.decide(s, set, &others, &survey, say)?;
        self.interim = joint.interim;
        Some(joint.bundles)
    }

    /// Announces the routes of a bundle to the leaders of other groups, if it assigns their drones too. Then reduces the
    /// bundle to this leader's own members.
    pub(crate) fn announce_choice(&mut self, now: SimTime, bundle: &mut PlanBundle, own: impl Fn(DroneId) -> bool) {
        self.joint.announce_choice(now, bundle, own);
    }
}
