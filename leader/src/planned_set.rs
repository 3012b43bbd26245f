//! An obstacle set that is being passed.

use crate::roster::Roster;
use crate::routes::Routes;
use crate::set_place::SetPlace;
use crate::tuning::CROWD_DRONES;
use skein_protocol::{GroupId, ObstacleId, PlanStamp, SimTime};

/// An obstacle set that is being passed: its routes, and which drone flies which.
#[derive(Clone, Debug)]
pub struct PlannedSet {
    /// Its obstacles, ascending.
    pub ids: Vec<ObstacleId>,
    /// Its short name: [`skein_protocol::payload::set_tag`].
    pub tag: u32,
    /// The plan that gave the assignments.
    pub stamp: PlanStamp,
    /// When that plan was made.
    pub made: SimTime,
    /// Number of drones that the plan is for.
    pub members: u32,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The routes past the set.
    pub routes: Routes,
    /// Where the drones fly, as far as heard.
    pub parts: Roster<SetPlace>,
}

impl PlannedSet {
    /// Whether the drones on a route pass side by side, as a crowd, instead of one behind another: they are many, as far as heard, and there
    /// is room beside the route.
    #[must_use]
    pub fn passes_as_crowd(&self, route: usize) -> bool {
        let ranks = self.parts.iter().filter(|part| usize::from(part.route) == route).map(|part| part.rank);
        !self.routes.is_between(route) && ranks.max().is_some_and(|last| usize::from(last) + 1 >= CROWD_DRONES)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::routes::RouteParams;
    use skein_protocol::scale::Scale;
    use skein_protocol::shape::ConvexShape;
    use skein_protocol::{DroneId, Vec2};

    /// Two circles with a gap, and these places: routes and ranks.
    fn set(places: &[(u16, u16)]) -> PlannedSet {
        let circle = |y_m| ConvexShape::circle(Vec2::new(100.0, y_m), 20.0).unwrap();
        let params = RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL };
        let part = |(drone, &(route, rank))| SetPlace {
            drone: DroneId(drone),
            leader: DroneId(0),
            group: GroupId::ALL,
            route,
            rank,
        };
        PlannedSet {
            ids: vec![ObstacleId(0), ObstacleId(1)],
            tag: 1,
            stamp: PlanStamp::default(),
            made: SimTime::ZERO,
            members: 200,
            scope: GroupId::ALL,
            routes: Routes::new(&[(ObstacleId(0), circle(-60.0)), (ObstacleId(1), circle(60.0))], &params),
            parts: (0..).zip(places).map(part).collect(),
        }
    }

    #[test]
    fn only_many_drones_on_an_outermost_route_are_a_crowd() {
        let crowds = |places: &[(u16, u16)]| [0, 1, 2].map(|route| set(places).passes_as_crowd(route));
        let queue = |route, drones| (0..drones).map(move |rank| (route, rank));
        let on_each = |drones| [0, 1, 2].into_iter().flat_map(|route| queue(route, drones)).collect::<Vec<_>>();
        assert_eq!(crowds(&on_each(32)), [false; 3]);
        assert_eq!(crowds(&on_each(33)), [true, false, true]);
        assert_eq!(crowds(&queue(2, 33).collect::<Vec<_>>()), [false, false, true]);
        assert_eq!(crowds(&[(0, 32)]), [true, false, false], "a rank tells how many are before it");
        assert_eq!(crowds(&[]), [false; 3]);
    }
}
