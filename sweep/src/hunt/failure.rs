//! What a mission did wrong, and how near it came to that.

use skein_protocol::record::{Outcome, ViolationKind};
use skein_report::Summary;
use skein_runtime::advice;
use skein_scenario::Scenario;

/// What is wrong with a mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FailureKind {
    /// Two drones came closer than the safe distance.
    Separation,
    /// A drone came closer to an obstacle than the clearance.
    Clearance,
    /// An invariant of the protocol was broken.
    Protocol,
    /// The mission did not reach its goal, although nothing speaks against it.
    NotReached,
}

impl FailureKind {
    /// What fails, as words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Separation => "two drones are too close",
            Self::Clearance => "a drone is too close to an obstacle",
            Self::Protocol => "an invariant of the protocol is broken",
            Self::NotReached => "the goal is not reached",
        }
    }
}

/// A failure of a mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Failure {
    /// What is wrong.
    pub kind: FailureKind,
    /// How bad it is, smaller is worse: the least distance as a share of the distance to keep; 0 for the other kinds.
    pub value: f64,
}

impl Failure {
    /// The failure of a mission; `None` if it did nothing wrong. A mission that arithmetic speaks against, or whose time limit is
    /// shorter than the default one, is not expected to reach its goal.
    pub(super) fn of(summary: &Summary, scenario: &Scenario) -> Option<Self> {
        let danger = Danger::of(summary, scenario);
        let kind = |kind: ViolationKind| match kind {
            ViolationKind::Separation => FailureKind::Separation,
            ViolationKind::Clearance | ViolationKind::Ground => FailureKind::Clearance,
            _ => FailureKind::Protocol,
        };
        if let Some(kind) = summary.violations.iter().map(|violation| kind(violation.kind)).min() {
            let value = match kind {
                FailureKind::Separation => danger.separation,
                FailureKind::Clearance => danger.clearance,
                _ => 0.0,
            };
            return Some(Self { kind, value });
        }
        let failed = matches!(summary.outcome, Outcome::Timeout | Outcome::Stuck) && is_expected_to_reach(scenario);
        failed.then_some(Self { kind: FailureKind::NotReached, value: 0.0 })
    }
}

fn is_expected_to_reach(scenario: &Scenario) -> bool {
    let mut default = scenario.clone();
    default.time.timeout_s = None;
    let in_time = scenario.timeout_s() >= default.timeout_s();
    in_time && advice::warnings(scenario).is_ok_and(|warnings| warnings.is_empty())
}

/// How near a mission came to a failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Danger {
    /// Least separation, in safe distances; infinite for one drone.
    pub(super) separation: f64,
    /// Least clearance, in clearances to keep; infinite without obstacles.
    pub(super) clearance: f64,
    /// Duration, in time limits.
    pub(super) slowness: f64,
}

impl Danger {
    pub(super) fn of(summary: &Summary, scenario: &Scenario) -> Self {
        let share = |least_m: Option<f64>, keep_m: f64| least_m.map_or(f64::INFINITY, |least_m| least_m / keep_m);
        Self {
            separation: share(summary.min_separation_m, scenario.drone.safe_distance_m),
            clearance: share(summary.min_clearance_m, scenario.avoidance.clearance_m),
            slowness: summary.mission_s / scenario.timeout_s(),
        }
    }
}
