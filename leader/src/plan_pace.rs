//! Bounds the rate at which a leader plans anew for one obstacle set. An assignment needs time to arrive, and the members'
//! beacons need time to show it. A plan that changes faster than that is never obeyed.

use crate::member::Member;
use crate::situation::Situation;
use crate::tuning::{MAX_PLAN_DOUBLINGS, PLAN_INTERVAL_S};
use skein_protocol::{Ballot, DroneId, ObstacleId, SimTime};

/// The last plan of a leader for an obstacle set.
#[derive(Clone, Debug, PartialEq)]
struct Made {
    at: SimTime,
    ballot: Ballot,
    set: Vec<ObstacleId>,
    members: Vec<DroneId>,
    /// How often the same plan has been made anew for the same members.
    repeats: u32,
}

/// When a leader made its last plan, and for whom.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlanPace {
    made: Option<Made>,
}

impl PlanPace {
    /// Whether the leader may plan for a set now. The wait since its last plan for the same set doubles as long as the members
    /// stay the same.
    pub(crate) fn allows(&self, s: &Situation<'_>, set: &[ObstacleId]) -> bool {
        self.same(s, set).is_none_or(|made| {
            let repeats = if made.is_for(s.members) { made.repeats } else { 0 };
            let wait_s = (PLAN_INTERVAL_S + 2.0 * s.delay_s) * f64::from(1_u32 << repeats);
            s.now.since(made.at) >= wait_s
        })
    }

    /// Notes that the leader plans for a set now.
    pub(crate) fn note(&mut self, s: &Situation<'_>, set: &[ObstacleId]) {
        let again = self.same(s, set).filter(|made| made.is_for(s.members));
        let repeats = again.map_or(0, |made| (made.repeats + 1).min(MAX_PLAN_DOUBLINGS));
        let members = s.members.iter().map(|member| member.id).collect();
        self.made = Some(Made { at: s.now, ballot: s.ballot, set: set.to_vec(), members, repeats });
    }

    fn same(&self, s: &Situation<'_>, set: &[ObstacleId]) -> Option<&Made> {
        self.made.as_ref().filter(|made| made.ballot == s.ballot && made.set == set)
    }
}

impl Made {
    fn is_for(&self, members: &[Member]) -> bool {
        self.members.iter().eq(members.iter().map(|member| &member.id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ledger::Ledger;
    use crate::obstacles::Obstacles;
    use crate::params::{Between, Destination, PlannerParams, Strategy};
    use crate::routes::RouteParams;
    use crate::slots::Reformation;
    use skein_protocol::formation::Shape;
    use skein_protocol::scale::Scale;
    use skein_protocol::{GroupId, Vec2};

    const TERM: Ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };

    fn params() -> PlannerParams {
        PlannerParams {
            drones: 8,
            strategy: Strategy::PaperRule,
            speed_mps: 10.0,
            headway_s: 4.0,
            by_words: false,
            speed_on_sight_mps: f64::INFINITY,
            routes: RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL },
            between: Between::CloseUp,
            radio_range_m: f64::INFINITY,
            shape: Shape::V,
            spacing_m: 40.0,
            reformation: Reformation::Optimal,
            arrival_error_m: 2.0,
            safe_distance_m: 20.0,
            course_y_m: 0.0,
            destination: Destination::Hold { stop_x_m: f64::INFINITY },
            debounce_s: 0.1,
        }
    }

    fn members(ids: &[u32]) -> Vec<Member> {
        let member = |&id: &u32| Member {
            id: DroneId(id),
            position: Vec2::zeros(),
            speed_mps: 0.0,
            velocity: Vec2::zeros(),
            group: GroupId::ALL,
            follows: true,
            settled: false,
            before: false,
        };
        ids.iter().map(member).collect()
    }

    /// The times (s) at which a leader plans that is asked every 10 ms for 60 s: in this term, with this delay, for these members.
    fn planned_s(ballot: impl Fn(f64) -> Ballot, delay_s: f64, members_at: impl Fn(f64) -> Vec<Member>) -> Vec<f64> {
        let (params, obstacles) = (params(), Obstacles::new(4, 40.0));
        let ledger = Ledger::new(DroneId(0), 4, params.routes);
        let (mut pace, mut planned) = (PlanPace::default(), Vec::new());
        for step in 0..6000 {
            let now_s = 0.01 * f64::from(step);
            let s = Situation {
                params: &params,
                now: SimTime::from_secs(now_s),
                ballot: ballot(now_s),
                scope: GroupId::ALL,
                members: &members_at(now_s),
                others: &[],
                delay_s,
                wide: false,
                silent: &[],
                obstacles: &obstacles,
                ledger: &ledger,
            };
            if pace.allows(&s, &[ObstacleId(0)]) {
                pace.note(&s, &[ObstacleId(0)]);
                planned.push(now_s);
            }
        }
        planned
    }

    #[test]
    fn the_waits_double_up_to_a_limit_while_the_members_stay_the_same() {
        let times = planned_s(|_| TERM, 0.0, |_| members(&[0, 1]));
        let waits: Vec<f64> = times.windows(2).map(|pair| ((pair[1] - pair[0]) * 100.0).round() / 100.0).collect();
        assert_eq!(waits[..6], [0.5, 1.0, 2.0, 4.0, 8.0, 8.0]);
    }

    #[test]
    fn other_members_end_the_waiting_but_not_the_least_wait() {
        let times = planned_s(|_| TERM, 0.0, |now_s| members(&[0, (now_s / 0.02) as u32 + 1]));
        let waits = times.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(waits.clone().all(|wait_s| (0.499..0.511).contains(&wait_s)), "{times:?}");
    }

    #[test]
    fn the_least_wait_grows_by_the_way_there_and_back() {
        let times = planned_s(|_| TERM, 1.0, |_| members(&[0, 1]));
        assert!((times[1] - times[0] - 2.5).abs() < 0.011, "{times:?}");
    }

    #[test]
    fn another_term_plans_at_once() {
        let times =
            planned_s(|now_s| Ballot { round: if now_s < 30.0 { 1 } else { 2 }, ..TERM }, 0.0, |_| members(&[0]));
        assert!(times.iter().any(|&time_s| (time_s - 30.0).abs() < 1e-9), "{times:?}");
    }
}
