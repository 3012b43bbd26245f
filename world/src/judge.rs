//! Decides when the mission is over, and how it ended.

use crate::body::Body;
use crate::end_condition::EndCondition;
use crate::params::{End, PartsRule, WorldParams};
use crate::parts::Parts;
use crate::stages::Stages;
use skein_protocol::record::Outcome;
use skein_protocol::{DroneId, SimTime};

/// What the judge looks at, at the end of a tick.
#[derive(Clone, Copy)]
pub(crate) struct MissionState<'a> {
    /// The bodies, by id.
    pub(crate) bodies: &'a [Body],
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

/// How the mission ended, once it has.
#[derive(Clone, Debug, Default)]
pub(crate) struct MissionJudge {
    condition: EndCondition,
    /// Memory for the living drones, as one part.
    living: [Vec<usize>; 1],
    end: Option<(Outcome, String)>,
}

impl MissionJudge {
    /// The outcome; `None` while the mission goes on.
    pub(crate) fn outcome(&self) -> Option<Outcome> {
        self.end.as_ref().map(|(outcome, _)| *outcome)
    }

    /// The outcome with its reason. A mission that goes on is aborted with this reason.
    pub(crate) fn abort(&mut self, reason: &str) -> (Outcome, String) {
        self.end.get_or_insert_with(|| (Outcome::Aborted, reason.to_owned())).clone()
    }

    /// Ends the mission if its end condition is met, no drone is left, some drone has no way, or the time is over.
    pub(crate) fn judge(&mut self, params: &WorldParams, state: MissionState<'_>) {
        if self.end.is_some() {
            return;
        }
        let (outcome, reason) = if let Some(reason) = self.reached(params, &state) {
            (Outcome::Reached, reason)
        } else if !state.bodies.iter().any(Body::is_alive) && !state.awaits_restarts {
            (Outcome::Timeout, "no drone is left alive".to_owned())
        } else if !params.without_way.is_empty() {
            (Outcome::Stuck, without_way(&params.without_way))
        } else if state.end >= SimTime::from_secs(params.timeout_s) {
            (Outcome::Timeout, format!("the time of {} s is over", params.timeout_s))
        } else {
            return;
        };
        self.end = Some(match state.violations {
            0 => (outcome, reason),
            count => (Outcome::Unsafe, format!("{reason}, but invariants were broken {count} times")),
        });
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
