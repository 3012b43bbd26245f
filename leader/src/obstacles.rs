//! What a drone knows of obstacles, from its own senses or from messages, and which drones have passed them.

use crate::drone_set::DroneSet;
use crate::geometry::{hull, nearest};
use crate::params::Destination;
use crate::routes::{RouteParams, Routes};
use crate::tuning::{OUTLINE_GROWTH, OUTLINE_GROWTH_M};
use skein_protocol::payload::{MAX_SET, Passed};
use skein_protocol::shape::{ConvexShape, MAX_VERTICES};
use skein_protocol::{DroneId, ObstacleId, SimTime, Vec2};
use std::collections::BTreeMap;

/// Most obstacles that a drone keeps. Further ones are ignored.
pub const MAX_KNOWN: usize = 1024;

/// A known obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Its outline, world frame.
    pub shape: ConvexShape,
    /// The drone that sensed it first.
    pub witness: DroneId,
    /// When this drone learnt of it.
    pub since: SimTime,
    /// How often the outline has grown since then.
    pub growths: u32,
}

/// The known obstacles, and which drones have passed them. Memory is bounded.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    /// Each is apart, because a map has room for many, and most swarms meet few.
    known: BTreeMap<ObstacleId, Box<Known>>,
    passed: BTreeMap<ObstacleId, DroneSet>,
    drones: u32,
    reach_m: f64,
    sets: Vec<Vec<ObstacleId>>,
    /// Those of the sets that are to be passed.
    ahead: Vec<Vec<ObstacleId>>,
    goal_is_in_bay: bool,
    /// Where the mission ends, and the clearances of routes.
    mission: Option<(Destination, RouteParams)>,
    /// How often an outline was learnt or has grown.
    changes: usize,
}

impl Obstacles {
    /// No obstacles yet, in a swarm of `drones`. Obstacles whose extents along the flight are closer than `reach_m` (m)
    /// belong to one set.
    #[must_use]
    pub fn new(drones: u32, reach_m: f64) -> Self {
        Self { drones, reach_m, ..Self::default() }
    }

    /// The same, on a mission that ends here. Sets behind the goal, and sets with the goal among their obstacles, are not to be passed.
    pub(crate) fn bound_for(self, destination: Destination, routes: RouteParams) -> Self {
        Self { mission: Some((destination, routes)), ..self }
    }

    /// Learns of an obstacle, or that its outline reaches farther than was known. Returns whether that is new.
    pub fn learn(&mut self, now: SimTime, id: ObstacleId, shape: ConvexShape, witness: DroneId) -> bool {
        let growth_m = self.growth_m();
        if let Some(known) = self.known.get_mut(&id) {
            let Some(grown) = grown(&known.shape, &shape, growth_m) else { return false };
            (known.shape, known.growths) = (grown, known.growths + 1);
        } else if self.known.len() < MAX_KNOWN {
            self.known.insert(id, Box::new(Known { shape, witness, since: now, growths: 0 }));
        } else {
            return false;
        }
        self.changes += 1;
        self.find_sets();
        true
    }

    /// Whether more of an obstacle is known than this outline of it.
    pub(crate) fn exceed(&self, id: ObstacleId, shape: &ConvexShape) -> bool {
        self.get(id).is_some_and(|known| grown(shape, &known.shape, self.growth_m()).is_some())
    }

    /// Whether an outline has grown since it was learnt.
    pub(crate) fn have_grown(&self) -> bool {
        self.known.values().any(|known| known.growths > 0)
    }

    /// By how much an outline has to reach beyond what is known of it until it counts as grown, m.
    fn growth_m(&self) -> f64 {
        OUTLINE_GROWTH_M.min(OUTLINE_GROWTH * self.reach_m)
    }

    /// How often an outline was learnt or has grown. Where it is the same, all outlines are.
    #[must_use]
    pub fn changes(&self) -> usize {
        self.changes
    }

    /// Hears which obstacles a drone has passed.
    pub fn hear_passed(&mut self, source: DroneId, message: &Passed) {
        self.note_passed(source, set_ids(&message.set, message.set_count));
    }

    /// Notes that a drone has passed these obstacles. That holds even if it turns back later.
    pub fn note_passed(&mut self, drone: DroneId, ids: &[ObstacleId]) {
        if drone.0 >= self.drones {
            return;
        }
        for id in ids.iter().filter(|id| self.known.contains_key(id)) {
            self.passed.entry(*id).or_default().insert(drone);
        }
    }

    /// Whether a drone is noted to have passed an obstacle.
    #[must_use]
    pub fn has_passed(&self, drone: DroneId, id: ObstacleId) -> bool {
        self.passed.get(&id).is_some_and(|drones| drones.contains(drone))
    }

    /// One obstacle.
    #[must_use]
    pub fn get(&self, id: ObstacleId) -> Option<&Known> {
        self.known.get(&id).map(Box::as_ref)
    }

    /// Number of known obstacles.
    #[must_use]
    pub fn count(&self) -> usize {
        self.known.len()
    }

    /// All known obstacles, by id.
    pub fn iter(&self) -> impl Iterator<Item = (ObstacleId, &Known)> + Clone {
        self.known.iter().map(|(&id, known)| (id, known.as_ref()))
    }

    /// The outlines of these obstacles; `None` if one of them is not known.
    #[must_use]
    pub fn shapes(&self, ids: &[ObstacleId]) -> Option<Vec<(ObstacleId, ConvexShape)>> {
        ids.iter().map(|&id| self.get(id).map(|known| (id, known.shape))).collect()
    }

    /// Whether a drone at abscissa `x_m` has passed a set: it is beyond the exit, or it is noted for every obstacle.
    #[must_use]
    pub fn is_past(&self, drone: DroneId, x_m: f64, set: &[ObstacleId], exit_x_m: f64) -> bool {
        x_m >= exit_x_m || set.iter().all(|&id| self.has_passed(drone, id))
    }

    /// Abscissa at which the first obstacle of a set begins, m.
    #[must_use]
    pub fn front_x_m(&self, set: &[ObstacleId]) -> f64 {
        let front = set.iter().filter_map(|&id| self.get(id)).map(|known| known.shape.bounds().0.x);
        front.fold(f64::INFINITY, f64::min)
    }

    /// The exit of a set: the abscissa of its rear edge, plus `beyond_m`, m.
    #[must_use]
    pub fn exit_x_m(&self, set: &[ObstacleId], beyond_m: f64) -> f64 {
        let rear = set.iter().filter_map(|&id| self.get(id)).map(|known| known.shape.bounds().1.x);
        rear.fold(f64::NEG_INFINITY, f64::max) + beyond_m
    }

    /// The obstacle sets, in flight order, each with ascending ids. A set has at most [`MAX_SET`] obstacles; the farther
    /// ones of a larger set form the next one.
    #[must_use]
    pub fn sets(&self) -> &[Vec<ObstacleId>] {
        &self.sets
    }

    /// The obstacle sets that are to be passed, in flight order.
    #[must_use]
    pub fn to_be_passed(&self) -> &[Vec<ObstacleId>] {
        &self.ahead
    }

    /// Whether the goal lies in a bay: among obstacles without a passable gap between them.
    #[must_use]
    pub fn goal_is_in_bay(&self) -> bool {
        self.goal_is_in_bay
    }

    /// Finds the sets, and those that drones have to pass. A goal behind which a set begins is reached before the set. If the goal lies in a bay, a
    /// route past all obstacles of the bay leads away from it.
    fn find_sets(&mut self) {
        self.sets = self.cluster();
        let Some((Destination::Goal { front_m }, params)) = self.mission else {
            self.ahead.clone_from(&self.sets);
            return;
        };
        let begins_m = |set: &Vec<ObstacleId>| self.front_x_m(set) - params.planning_distance_m;
        let bay = |set: &Vec<ObstacleId>| self.is_bay(set, &params, front_m);
        let ahead = self.sets.iter().filter(|set| begins_m(set) < front_m.x && !bay(set)).cloned().collect();
        (self.goal_is_in_bay, self.ahead) = (self.sets.iter().any(bay), ahead);
    }

    /// Whether a point lies among obstacles of a set that leave no passable gap between them. World frame, m.
    fn is_bay(&self, set: &[ObstacleId], params: &RouteParams, point: Vec2) -> bool {
        let extent_m = self.front_x_m(set)..=self.exit_x_m(set, 0.0);
        extent_m.contains(&point.x) && self.shapes(set).is_some_and(|shapes| Routes::enclose(&shapes, params, point))
    }

    fn cluster(&self) -> Vec<Vec<ObstacleId>> {
        let mut extents: Vec<(f64, f64, ObstacleId)> =
            self.iter().map(|(id, known)| (known.shape.bounds().0.x, known.shape.bounds().1.x, id)).collect();
        extents.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let mut sets: Vec<Vec<ObstacleId>> = Vec::new();
        let mut rear = f64::NEG_INFINITY;
        for (front, end, id) in extents {
            match sets.last_mut() {
                Some(set) if front < rear + self.reach_m && set.len() < MAX_SET => set.push(id),
                _ => {
                    sets.push(vec![id]);
                    rear = f64::NEG_INFINITY;
                }
            }
            rear = rear.max(end);
        }
        for set in &mut sets {
            set.sort_unstable();
        }
        sets
    }
}

/// The outline that is known after another part of it was seen; `None` if that part adds nothing that matters to planning.
fn grown(known: &ConvexShape, seen: &ConvexShape, growth_m: f64) -> Option<ConvexShape> {
    if known == seen {
        return None;
    }
    let core: Vec<Vec2> = known.vertices().collect();
    let beyond_m = |v: Vec2| (nearest(&core, v) - v).norm() + seen.radius_m - known.radius_m;
    if seen.vertices().all(|v| beyond_m(v) <= growth_m) {
        return None;
    }
    let mut corners = hull(&core.into_iter().chain(seen.vertices()).collect::<Vec<_>>());
    while corners.len() > MAX_VERTICES {
        let count = corners.len();
        let cut_off_m2 = |i: &usize| {
            let (a, b, c) = (corners[(i + count - 1) % count], corners[*i], corners[(i + 1) % count]);
            (b - a).perp(&(c - b)).abs()
        };
        let flattest = (0..count).min_by(|i, j| cut_off_m2(i).total_cmp(&cut_off_m2(j)))?;
        corners.remove(flattest);
    }
    let shape = ConvexShape::new(&corners, known.radius_m.max(seen.radius_m)).ok()?;
    let (floor_m, top_m) = (known.floor_m.min(seen.floor_m), known.top_m.max(seen.top_m));
    Some(ConvexShape { floor_m, top_m, ..shape })
}

/// The part of a message's obstacle array that is in use.
#[must_use]
pub fn set_ids(set: &[ObstacleId; MAX_SET], count: u32) -> &[ObstacleId] {
    &set[..(count as usize).min(MAX_SET)]
}

/// The obstacle array of a message.
#[must_use]
pub fn set_array(ids: &[ObstacleId]) -> ([ObstacleId; MAX_SET], u32) {
    let mut set = [ObstacleId(0); MAX_SET];
    let count = ids.len().min(MAX_SET);
    set[..count].copy_from_slice(&ids[..count]);
    (set, count as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::Vec2;

    fn disc(x: f64) -> ConvexShape {
        ConvexShape::circle(Vec2::new(x, 0.0), 5.0).unwrap()
    }

    #[test]
    fn obstacles_closer_than_the_reach_form_a_set() {
        let mut obstacles = Obstacles::new(4, 40.0);
        for (id, x) in [(3, 100.0), (1, 140.0), (2, 300.0)] {
            assert!(obstacles.learn(SimTime::ZERO, ObstacleId(id), disc(x), DroneId(0)));
        }
        assert!(!obstacles.learn(SimTime::ZERO, ObstacleId(3), disc(100.0), DroneId(0)));
        assert_eq!(obstacles.sets(), [vec![ObstacleId(1), ObstacleId(3)], vec![ObstacleId(2)]]);
        obstacles.learn(SimTime::ZERO, ObstacleId(0), disc(220.0), DroneId(0));
        assert_eq!(obstacles.sets().len(), 3);
    }

    #[test]
    fn an_outline_grows_with_what_is_seen_of_it() {
        let mut obstacles = Obstacles::new(4, 40.0);
        let mut see = |corners: &[[f64; 2]]| {
            let corners: Vec<Vec2> = corners.iter().map(|&corner| Vec2::from(corner)).collect();
            let shape = ConvexShape::new(&corners, 0.0).unwrap();
            let new = obstacles.learn(SimTime::ZERO, ObstacleId(0), shape, DroneId(0));
            (new, obstacles.get(ObstacleId(0)).unwrap().shape.vertices().map(|v| [v.x, v.y]).collect::<Vec<_>>())
        };
        assert!(see(&[[100.0, 10.0], [100.0, -10.0]]).0);
        assert!(!see(&[[100.0, 11.0], [100.0, -10.0]]).0, "that much does not matter");
        assert_eq!(see(&[[100.0, 30.0], [100.0, 0.0]]).1, [[100.0, -10.0], [100.0, 30.0]]);
        assert_eq!(see(&[[120.0, 30.0], [100.0, 30.0]]).1, [[100.0, -10.0], [120.0, 30.0], [100.0, 30.0]]);
        let arc: Vec<[f64; 2]> =
            (0..16).map(|i| f64::from(i) * 0.39).map(|a| [110.0 + 60.0 * a.cos(), 60.0 * a.sin()]).collect();
        let whole = see(&arc).1;
        assert!(whole.len() <= MAX_VERTICES && whole.iter().all(|v| (v[0] - 110.0).hypot(v[1]) < 60.1), "{whole:?}");
        assert_eq!(obstacles.changes(), 4);
    }

    #[test]
    fn only_known_obstacles_can_be_passed() {
        let mut obstacles = Obstacles::new(4, 40.0);
        obstacles.learn(SimTime::ZERO, ObstacleId(1), disc(0.0), DroneId(0));
        let (set, set_count) = set_array(&[ObstacleId(1), ObstacleId(9)]);
        let message = Passed { stamp: SimTime::ZERO, set_count, set, of: 0 };
        obstacles.hear_passed(DroneId(2), &message);
        obstacles.hear_passed(DroneId(99), &message);
        assert!(obstacles.has_passed(DroneId(2), ObstacleId(1)));
        assert!(!obstacles.has_passed(DroneId(2), ObstacleId(9)) && !obstacles.has_passed(DroneId(99), ObstacleId(1)));
    }

    /// Which of the sets are to be passed, and whether the goal lies in a bay, with a goal at this abscissa on the course line.
    fn with_goal_at(x_m: f64, walls: &[(f64, f64, f64, f64)]) -> (Vec<Vec<u32>>, bool) {
        let routes = RouteParams {
            clearance_m: 15.0,
            half_gap_m: 15.0,
            planning_distance_m: 20.0,
            scale: skein_protocol::scale::Scale::FULL,
        };
        let goal = Destination::Goal { front_m: Vec2::new(x_m, 0.0) };
        let mut obstacles = Obstacles::new(4, 40.0).bound_for(goal, routes);
        for (&(x, y, hx, hy), id) in walls.iter().zip(0..) {
            let wall = ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), 0.0).unwrap();
            obstacles.learn(SimTime::ZERO, ObstacleId(id), wall, DroneId(0));
        }
        let ids = |set: &Vec<ObstacleId>| set.iter().map(|id| id.0).collect();
        (obstacles.to_be_passed().iter().map(ids).collect(), obstacles.goal_is_in_bay())
    }

    #[test]
    fn sets_behind_the_goal_and_bays_around_it_are_not_to_be_passed() {
        let (block, arms) = ((100.0, 0.0, 10.0, 10.0), [(400.0, 60.0, 100.0, 5.0), (400.0, -60.0, 100.0, 5.0)]);
        let back = (505.0, 0.0, 5.0, 65.0);
        let sets = |x_m, walls: &[_]| with_goal_at(x_m, walls);
        assert_eq!(sets(420.0, &[block, arms[0], arms[1]]), (vec![vec![0], vec![1, 2]], false), "a passage");
        assert_eq!(sets(420.0, &[block, arms[0], arms[1], back]), (vec![vec![0]], true), "a bay");
        assert_eq!(
            sets(700.0, &[block, arms[0], arms[1], back]),
            (vec![vec![0], vec![1, 2, 3]], false),
            "beyond the bay"
        );
        assert_eq!(sets(200.0, &[block, arms[0], arms[1], back]), (vec![vec![0]], false), "before the bay");
    }
}
