//! The routes by which drones passed an obstacle set, as their tracks show.

use crate::facts::RunFacts;
use crate::obstacle_set::ObstacleSet;
use skein_protocol::Vec2;
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::shape::ConvexShape;

/// Notes on which side of each obstacle of a set each drone passes. Obstacles without a passable gap between them count as one. A set of k
/// obstacles has k + 1 routes (paper, E5).
pub(crate) struct FlownRoutes {
    /// The centres of the obstacles' bounding boxes in the frame of the course, m. The centre of the bounding box of a convex shape is inside
    /// the shape, so it tells on which side of the shape a point abreast of it is.
    centres_m: Vec<Vec2>,
    /// For each drone and obstacle, whether the drone passed to the left of it.
    left: Vec<Vec<Option<bool>>>,
}

impl FlownRoutes {
    /// The routes past a set of a run with these facts, before its first tick.
    pub(crate) fn new(facts: &RunFacts, set: &ObstacleSet) -> Self {
        let mut centres_m: Vec<Vec2> = envelopes(facts, set).iter().filter_map(|ids| centre(facts, ids)).collect();
        // The number of a route is below `NO_ROUTE`.
        centres_m.truncate(usize::from(NO_ROUTE) - 1);
        let left = vec![vec![None; centres_m.len()]; facts.drones as usize];
        Self { centres_m, left }
    }

    /// Number of routes.
    pub(crate) fn count(&self) -> u32 {
        self.centres_m.len() as u32 + 1
    }

    /// Takes where a drone was at the end of the last tick and where it is now, in the frame of the course, m. If a drone flies past an obstacle
    /// several times, the last time counts.
    pub(crate) fn take(&mut self, drone: usize, before: Option<Vec2>, now: Vec2) {
        for (centre, left) in self.centres_m.iter().zip(&mut self.left[drone]) {
            if now.x >= centre.x && before.is_none_or(|before| before.x < centre.x) {
                *left = Some(now.y > centre.y);
            }
        }
    }

    /// The route of a drone that is now here, in the frame of the course, m: the number of obstacles on its right.
    pub(crate) fn of(&self, drone: usize, now: Vec2) -> u16 {
        let sides = self.centres_m.iter().zip(&self.left[drone]);
        sides.filter(|(centre, left)| left.unwrap_or(now.y > centre.y)).count() as u16
    }
}

/// The obstacles of a set that are in the way at the formation's altitude, those without a passable gap between them together. Folders of earlier
/// versions do not say which these are; then each obstacle is one of its own.
fn envelopes(facts: &RunFacts, set: &ObstacleSet) -> Vec<Vec<u32>> {
    let of_set = |ids: &&Vec<u32>| ids.iter().all(|id| set.obstacles.contains(id));
    if facts.scene.sets.iter().all(|outline| outline.envelopes.is_empty()) {
        let in_the_way = |id: &&u32| {
            let shape = facts.obstacles.get(**id as usize);
            shape.is_some_and(|shape| shape.blocks(facts.scene.altitude_m, facts.planning_distance_m))
        };
        return set.obstacles.iter().filter(in_the_way).map(|&id| vec![id]).collect();
    }
    facts.scene.sets.iter().flat_map(|outline| &outline.envelopes).filter(of_set).cloned().collect()
}

/// The centre of the bounding box of these obstacles, in the frame of the course, m.
fn centre(facts: &RunFacts, ids: &[u32]) -> Option<Vec2> {
    let bounds = |&id: &u32| facts.obstacles.get(id as usize).map(ConvexShape::bounds);
    let (low, high) = ids.iter().filter_map(bounds).reduce(|(low, high), (a, b)| (low.inf(&a), high.sup(&b)))?;
    Some(facts.course.from_world((low + high) / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_facts::SetOutline;
    use crate::testing::facts;
    use skein_protocol::Course;

    /// The route of a drone that flies along this track.
    fn flown(facts: &RunFacts, track: &[[f64; 2]]) -> (u16, u32) {
        let mut routes = FlownRoutes::new(facts, &facts.sets()[0]);
        let place = |point: &[f64; 2]| facts.course.from_world((*point).into());
        let mut before = None;
        for now in track.iter().map(place) {
            routes.take(0, before, now);
            before = Some(now);
        }
        (routes.of(0, before.unwrap()), routes.count())
    }

    fn columns(course: Course) -> RunFacts {
        let column = |x: f64, y: f64| ConvexShape::circle(course.to_world(Vec2::new(x, y)), 5.0).unwrap();
        RunFacts { course, obstacles: vec![column(100.0, 60.0), column(110.0, 0.0), column(90.0, -60.0)], ..facts(1) }
    }

    #[test]
    fn a_route_is_numbered_by_the_obstacles_on_its_right() {
        for course in Course::ALL {
            let facts = columns(course);
            let track = |ordinates: [f64; 3]| -> Vec<[f64; 2]> {
                let points = [50.0, 105.0, 150.0].into_iter().zip(ordinates);
                points.map(|(x, y)| course.to_world(Vec2::new(x, y)).into()).collect()
            };
            for (y, route) in [(-90.0, 0), (-30.0, 1), (30.0, 2), (90.0, 3)] {
                assert_eq!(flown(&facts, &track([0.0, y, y])), (route, 4), "{course:?}, {y} m");
            }
            assert_eq!(
                flown(&facts, &track([0.0, 30.0, -200.0])),
                (1, 4),
                "right of the middle one, behind the left one"
            );
        }
    }

    #[test]
    fn a_drone_that_turns_back_and_passes_again_flew_the_last_route() {
        let facts = columns(Course::East);
        assert_eq!(flown(&facts, &[[50.0, 0.0], [105.0, 30.0], [50.0, 30.0], [50.0, -90.0], [150.0, -90.0]]), (0, 4));
        assert_eq!(
            flown(&facts, &[[50.0, 0.0], [105.0, 30.0], [50.0, 90.0]]),
            (2, 4),
            "on its way back it does not pass"
        );
    }

    #[test]
    fn obstacles_without_a_gap_count_as_one_and_those_at_other_altitudes_not() {
        let mut facts = columns(Course::East);
        let outline = |envelopes: &[&[u32]]| SetOutline {
            envelopes: envelopes.iter().map(|ids| ids.to_vec()).collect(),
            ..SetOutline::default()
        };
        facts.scene.sets = vec![outline(&[&[0, 1]])];
        assert_eq!(flown(&facts, &[[50.0, 0.0], [150.0, 20.0]]), (0, 2));
        assert_eq!(flown(&facts, &[[50.0, 0.0], [150.0, 40.0]]), (1, 2));
    }
}
