//! Decides when the mission is over, and how it ended.

use crate::body::Body;
use crate::end_condition::EndCondition;
use crate::params::{End, PartsRule, WorldParams};
use crate::parts::Parts;
use crate::process::Process;
use crate::stages::Stages;
use crate::stillness::Stillness;
use crate::tuning::STANDSTILL_S;
use crate::unfinished::Unfinished;
use crate::unfinished_text;
use skein_protocol::record::{Outcome, UNFINISHED_MAX};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, SimTime, UnfinishedDrone};

/// What the judge looks at, at the end of a tick.
#[derive(Clone, Copy)]
pub(crate) struct MissionState<'a> {
    /// The bodies, by id.
    pub(crate) bodies: &'a [Body],
    /// Their processes.
    pub(crate) processes: &'a [Process],
    /// Since when they have not moved.
    pub(crate) stillness: &'a Stillness,
    /// Whether there are living drones and the pilots of all of them say that the mission is done.
    pub(crate) all_done: bool,
    /// The parts of the swarm; unused unless each of them has to be in formation by itself.
    pub(crate) parts: &'a Parts,
    /// The obstacle sets.
    pub(crate) stages: &'a Stages,
    /// The time of the tick's end.
    pub(crate) end: SimTime,
    /// Whether a dead drone will get a new process.
    pub(crate) awaits_restarts: bool,
    /// Violations of invariants so far.
    pub(crate) violations: u64,
}

/// How a mission ended.
#[derive(Clone, Debug)]
pub(crate) struct Verdict {
    /// The outcome.
    pub(crate) outcome: Outcome,
    /// Why, for a human reader.
    pub(crate) reason: String,
    /// If the mission is stuck: the drones that keep it from its goal for certain.
    pub(crate) stuck: Vec<DroneId>,
    /// If the time was over: drones that kept the mission from its goal.
    pub(crate) unfinished: Vec<UnfinishedDrone>,
    /// If the time was over and no living drone had moved for long: for how long, s.
    pub(crate) standstill_s: Option<f64>,
}

impl Verdict {
    fn new(outcome: Outcome, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self { outcome, reason, stuck: Vec::new(), unfinished: Vec::new(), standstill_s: None }
    }

    /// It is certain that the mission will not reach its goal, because of these drones.
    fn stuck(drones: Vec<DroneId>, reason: impl Into<String>) -> Self {
        Self { stuck: drones, ..Self::new(Outcome::Stuck, reason) }
    }
}

/// How the mission ended, once it has.
#[derive(Clone, Debug, Default)]
pub(crate) struct MissionJudge {
    condition: EndCondition,
    /// Memory for the living drones, as one part.
    living: [Vec<usize>; 1],
    end: Option<Verdict>,
}

impl MissionJudge {
    /// The judge of a mission among these obstacles, world frame.
    pub(crate) fn among(obstacles: &[ConvexShape]) -> Self {
        Self { condition: EndCondition::among(obstacles), ..Self::default() }
    }

    /// The outcome; `None` while the mission goes on.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        self.end.as_ref().map(|verdict| verdict.outcome)
    }

    /// How the mission ended. A mission that goes on is aborted with this reason.
    pub(crate) fn abort(&mut self, reason: &str) -> Verdict {
        self.end.get_or_insert_with(|| Verdict::new(Outcome::Aborted, reason)).clone()
    }

    /// Ends the mission if its end condition is met, no drone is left, some drone has no way, or the time is over.
    pub(crate) fn judge(&mut self, params: &WorldParams, state: MissionState<'_>) {
        if self.end.is_some() {
            return;
        }
        let verdict = if let Some(reason) = self.reached(params, &state) {
            Verdict::new(Outcome::Reached, reason)
        } else if !state.bodies.iter().any(Body::is_alive) && !state.awaits_restarts {
            let all = (0..state.bodies.len() as u32).map(DroneId).collect();
            Verdict::stuck(all, "no drone is left alive")
        } else if !params.without_way.is_empty() {
            Verdict::stuck(params.without_way.clone(), without_way(&params.without_way))
        } else if state.end >= SimTime::from_secs(params.timeout_s) {
            self.timed_out(params, &state)
        } else {
            return;
        };
        self.end = Some(match state.violations {
            0 => verdict,
            count => {
                let broken = match count {
                    1 => "an invariant was broken".to_owned(),
                    _ => format!("invariants were broken {count} times"),
                };
                let reason = format!("{}, but {broken}", verdict.reason);
                Verdict { outcome: Outcome::Unsafe, reason, stuck: Vec::new(), ..verdict }
            }
        });
    }

    /// The time is over. Says which drones are not done, and whether the swarm stands still.
    fn timed_out(&self, params: &WorldParams, state: &MissionState<'_>) -> Verdict {
        let &MissionState { bodies, processes, stages, stillness, end: now, .. } = state;
        let condition = &self.condition;
        let living = || vec![(0..bodies.len()).filter(|&drone| bodies[drone].is_alive()).collect()];
        let parts = match params.parts {
            PartsRule::Each { .. } => Some(state.parts.settled(now)).filter(|parts| !parts.is_empty()),
            PartsRule::One => None,
        };
        let parts = parts.unwrap_or_else(living);
        let mut unfinished = Unfinished { params, bodies, processes, condition, stages, stillness, now }.drones(&parts);
        let standstill_s = stillness.swarm_still_s(bodies, now).filter(|&still_s| still_s >= STANDSTILL_S);
        let reason = unfinished_text::reason(params.timeout_s, &unfinished, standstill_s);
        unfinished.truncate(UNFINISHED_MAX);
        Verdict { unfinished, standstill_s, ..Verdict::new(Outcome::Timeout, reason) }
    }

    /// Why the mission has reached its end; `None` if it has not.
    fn reached(&mut self, params: &WorldParams, state: &MissionState<'_>) -> Option<String> {
        let living = state.bodies.iter().any(Body::is_alive);
        let met = match params.end {
            End::Time { duration_s } => living && state.end >= SimTime::from_secs(duration_s),
            End::Pilots => state.all_done,
            End::Hold { .. } | End::Goal { .. } => self.is_closed(params, state),
        };
        met.then(|| match params.end {
            End::Time { duration_s } => format!("the mission lasted its {duration_s} s"),
            End::Pilots => "all living drones say that they are done".to_owned(),
            End::Hold { .. } | End::Goal { .. } => match state.parts.count() {
                0 | 1 => "the end condition is met".to_owned(),
                parts => format!("the end condition is met by each of {parts} parts of the swarm"),
            },
        })
    }

    fn is_closed(&mut self, params: &WorldParams, state: &MissionState<'_>) -> bool {
        if let PartsRule::Each { .. } = params.parts {
            return self.condition.is_met(params, state.bodies, state.stages, &state.parts.settled(state.end));
        }
        let [living] = &mut self.living;
        living.clear();
        living.extend((0..state.bodies.len()).filter(|&drone| state.bodies[drone].is_alive()));
        !living.is_empty() && self.condition.is_met(params, state.bodies, state.stages, &self.living)
    }
}

/// Names the drones that have no way to their destination.
fn without_way(drones: &[DroneId]) -> String {
    let (noun, verb) = if drones.len() == 1 { ("drone", "has") } else { ("drones", "have") };
    let ids: Vec<String> = drones.iter().map(|id| id.0.to_string()).collect();
    format!("{noun} {} {verb} no way to the destination: the obstacles leave no gap of two clearances", ids.join(", "))
}
