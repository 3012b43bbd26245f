//! The end condition of a mission, by the true state and not by what drones believe. A formation is closed if it is closed seen
//! from above: the altitudes of the drones do not matter.

use crate::body::Body;
use crate::goal_slots;
use crate::grid::Grid;
use crate::params::{End, WorldParams};
use crate::stages::Stages;
use skein_protocol::Vec2;
use skein_protocol::formation::GoalGround;
use skein_protocol::shape::ConvexShape;

/// Whether the living drones stand in their formation.
#[derive(Clone, Debug, Default)]
pub(crate) struct EndCondition {
    obstacles: Vec<ConvexShape>,
    /// The slots of the formation relative to its front slot, m.
    slots: Vec<Vec2>,
    /// Mean of the slots, m.
    middle: Vec2,
    grid: Grid,
    /// Whether a drone stands in each slot.
    taken: Vec<bool>,
    /// The greatest abscissa that each drone has had, m. It may turn back later: the leader chooses where the slots are.
    reached_x_m: Vec<f64>,
    /// Beyond this abscissa all obstacles are passed, m. Drones plan to stop farther away, but may not have seen an outline as a whole.
    past_x_m: f64,
    /// Memory for the places of the drones, world frame, m.
    places: Vec<Vec2>,
    /// Where dead drones hang, world frame, m.
    dead: Vec<Vec2>,
    /// The greatest size of a formation at the goal, for this number of living drones and these dead ones.
    most: Option<(usize, Vec<Vec2>, usize)>,
}

impl EndCondition {
    /// The end condition of a mission among these obstacles, world frame.
    pub(crate) fn among(obstacles: &[ConvexShape]) -> Self {
        Self { obstacles: obstacles.to_vec(), ..Self::default() }
    }

    /// What keeps slots at the goal free where these drones hang dead, world frame, m.
    pub(crate) fn ground<'a>(&'a self, params: &WorldParams, dead: &'a [Vec2]) -> GoalGround<'a> {
        goal_slots::ground(params, dead, &self.obstacles)
    }

    /// Whether the end condition is met by each of these sets of living drones, which together are all of them. Without living
    /// drones it never is.
    pub(crate) fn is_met(
        &mut self,
        params: &WorldParams,
        bodies: &[Body],
        stages: &Stages,
        parts: &[Vec<usize>],
    ) -> bool {
        if let End::Hold { .. } = params.end {
            // Where an outline ends that is sensed in part, no drone knows.
            let in_part = params.sensors.view_m.is_some();
            self.past_x_m = if in_part { stages.begun_x_m() } else { stages.past_x_m() };
            self.note_reached(bodies);
            if !self.holds(params, bodies) {
                return false;
            }
        }
        !parts.is_empty() && parts.iter().all(|part| self.is_closed(params, bodies, part))
    }

    /// Whether the drone has been past all obstacles. Only known with [`End::Hold`].
    pub(crate) fn is_past(&self, drone: usize) -> bool {
        self.reached_x_m.get(drone).is_some_and(|x_m| *x_m >= self.past_x_m)
    }

    /// Whether the drone is slow enough for a formation that is held.
    pub(crate) fn is_slow(params: &WorldParams, body: &Body) -> bool {
        body.velocity().norm_squared() <= params.hold_speed_mps * params.hold_speed_mps
    }

    /// Whether these drones stand in their formation.
    fn is_closed(&mut self, params: &WorldParams, bodies: &[Body], part: &[usize]) -> bool {
        let mut places = std::mem::take(&mut self.places);
        places.clear();
        places.extend(part.iter().map(|&drone| bodies[drone].position().xy()));
        self.dead.clear();
        self.dead.extend(goal_slots::dead(bodies));
        let closed = self.are_closed(params, &places);
        self.places = places;
        closed
    }

    /// Whether the drones at these places stand in their formation.
    fn are_closed(&mut self, params: &WorldParams, places: &[Vec2]) -> bool {
        match params.end {
            End::Hold { stop_x_m } => {
                self.form(places.len(), params);
                let anchor = self.anchor(places);
                anchor.x >= stop_x_m - params.arrival_error_m && self.filled(places, anchor, params.arrival_error_m)
            }
            End::Goal { front_m } => {
                let most = self.most_at_goal(params, places.len());
                (places.len()..=most).any(|size| self.fill_at_goal(params, places, front_m, size))
            }
            // These ends do not depend on the formation.
            End::Time { .. } | End::Pilots => false,
        }
    }

    /// [`goal_slots::most`], found anew only if drones have died or a dead one has moved.
    fn most_at_goal(&mut self, params: &WorldParams, drones: usize) -> usize {
        if self.dead.is_empty() {
            return drones;
        }
        match &self.most {
            Some((of, dead, most)) if *of == drones && *dead == self.dead => *most,
            _ => {
                let most = goal_slots::most(params, drones, &self.ground(params, &self.dead));
                self.most = Some((drones, self.dead.clone(), most));
                most
            }
        }
    }

    fn note_reached(&mut self, bodies: &[Body]) {
        self.reached_x_m.resize(bodies.len(), f64::NEG_INFINITY);
        for (reached_x_m, body) in self.reached_x_m.iter_mut().zip(bodies) {
            *reached_x_m = reached_x_m.max(body.position().x);
        }
    }

    /// Whether every living drone has been past every obstacle and is slow.
    fn holds(&self, params: &WorldParams, bodies: &[Body]) -> bool {
        let mut living = bodies.iter().enumerate().filter(|(_, body)| body.is_alive());
        living.all(|(drone, body)| self.is_past(drone) && Self::is_slow(params, body))
    }

    /// Makes the slots for this number of drones, unless they are made already.
    fn form(&mut self, drones: usize, params: &WorldParams) {
        if self.taken.len() == drones {
            return;
        }
        self.taken = vec![false; drones];
        self.slots = goal_slots::all(params, drones);
        self.middle = self.slots.iter().sum::<Vec2>() / self.slots.len().max(1) as f64;
        let cell_m = params.spacing_m.max(params.arrival_error_m);
        self.grid.fill(cell_m, self.slots.iter().enumerate().map(|(i, &slot)| (i as u32, slot)));
    }

    /// Whether the drones at these places stand in slots of a formation of this size with its front slot at the goal, and no slot before
    /// the last one that is taken is free, except beside dead drones and, once a drone has died, beside obstacles.
    fn fill_at_goal(&mut self, params: &WorldParams, places: &[Vec2], front_m: Vec2, size: usize) -> bool {
        self.form(size, params);
        if !self.filled(places, front_m, params.arrival_error_m) {
            return false;
        }
        let last = self.taken.iter().rposition(|&taken| taken).unwrap_or_default();
        let ground = self.ground(params, &self.dead);
        let slots = self.slots.iter().zip(&self.taken).take(last);
        slots.filter(|(_, taken)| !**taken).all(|(slot, _)| goal_slots::may_be_free(params, front_m + slot, &ground))
    }

    /// Where the front slot is when the formation fits the drones at these places best (least squares), m.
    fn anchor(&self, places: &[Vec2]) -> Vec2 {
        places.iter().sum::<Vec2>() / places.len() as f64 - self.middle
    }

    /// Whether each of the drones at these places is within `error_m` of a slot that no other one takes. Only its nearest slot
    /// is tried: slots are farther apart than twice the error.
    fn filled(&mut self, places: &[Vec2], anchor: Vec2, error_m: f64) -> bool {
        self.taken.fill(false);
        places.iter().all(|place| {
            let place = place - anchor;
            let mut best: Option<(f64, usize)> = None;
            self.grid.each_near(place, |slot| {
                let square = (self.slots[slot as usize] - place).norm_squared();
                if best.is_none_or(|(least, _)| square < least) {
                    best = Some((square, slot as usize));
                }
            });
            let close = best.filter(|&(square, _)| square <= error_m * error_m);
            close.is_some_and(|(_, slot)| !std::mem::replace(&mut self.taken[slot], true))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::testing::{params, rectangle, starts};
    use skein_protocol::formation::Shape;
    use skein_protocol::shape::ConvexShape;
    use skein_protocol::{Course, Vec3};

    /// Eight drones at rest in a nested V with its front at this point, m.
    fn formed(front: Vec2) -> Vec<Body> {
        let front = Vec3::new(front.x, front.y, 0.0);
        starts(8).into_iter().map(|(slot, _)| Body::new(slot + front, Vec3::zeros())).collect()
    }

    /// The body, shifted to the left by this, m.
    fn moved(body: Body, left_m: f64) -> Body {
        Body::new(body.position() + Vec3::new(0.0, left_m, 0.0), body.velocity())
    }

    fn hold(stop_x_m: f64) -> WorldParams {
        WorldParams { end: End::Hold { stop_x_m }, ..params() }
    }

    fn living(bodies: &[Body]) -> Vec<Vec<usize>> {
        vec![(0..bodies.len()).filter(|&i| bodies[i].is_alive()).collect()]
    }

    fn is_met(params: &WorldParams, bodies: &[Body], stages: &Stages) -> bool {
        EndCondition::default().is_met(params, bodies, stages, &living(bodies))
    }

    #[test]
    fn each_part_has_a_formation_of_its_own() {
        // The second four drones stand in a formation of four, far from the first four.
        let mut all = formed(Vec2::new(100.0, 0.0));
        for drone in 4..8 {
            let place = all[drone - 4].position() + Vec3::new(300.0, 20.0, 0.0);
            all[drone] = Body::new(place, Vec3::zeros());
        }
        let halves = [vec![0, 1, 2, 3], vec![4, 5, 6, 7]];
        let met = |params: &WorldParams, all: &[Body], parts: &[Vec<usize>]| {
            EndCondition::default().is_met(params, all, &open(), parts)
        };
        assert!(met(&hold(100.0), &all, &halves) && !is_met(&hold(-1e9), &all, &open()));
        assert!(!met(&hold(101.0), &all, &halves), "the first part is not far enough");
        assert!(!met(&hold(-1e9), &all, &[]), "it is not known which drones are a part");
        all[6] = moved(all[6], 2.0);
        assert!(!met(&hold(100.0), &all, &halves));
    }

    fn open() -> Stages {
        Stages::new(Course::East, &[], 40.0)
    }

    /// With one obstacle, which a drone has sensed.
    fn sensed(shape: &ConvexShape) -> Stages {
        Stages::sensed(&[Outline::new(shape)], 40.0)
    }

    #[test]
    fn an_obstacle_that_no_drone_senses_does_not_have_to_be_passed() {
        let all = formed(Vec2::zeros());
        // Beside the formation, ahead of it, and both.
        let beside = rectangle(-50.0, 400.0, 20.0, 1.0);
        let ahead = rectangle(300.0, 0.0, 20.0, 20.0);
        let long = rectangle(450.0, 400.0, 500.0, 1.0);
        for shape in [beside, ahead, long] {
            assert!(is_met(&hold(0.0), &all, &Stages::new(Course::East, &[Outline::new(&shape)], 40.0)));
            assert!(!is_met(&hold(0.0), &all, &sensed(&shape)));
        }
    }

    #[test]
    fn a_drone_that_turns_back_to_its_slot_stays_past_the_obstacles() {
        let stages = sensed(&rectangle(0.0, 0.0, 10.0, 10.0));
        let (params, mut condition) = (hold(-1e9), EndCondition::default());
        let mut is_met = |all: &[Body]| condition.is_met(&params, all, &stages, &living(all));
        assert!(!is_met(&formed(Vec2::new(0.0, 0.0))));
        assert!(is_met(&formed(Vec2::new(500.0, 0.0))));
        assert!(is_met(&formed(Vec2::new(0.0, 0.0))));
    }

    #[test]
    fn a_closed_formation_at_rest_ends_the_mission_beyond_the_stop() {
        let all = formed(Vec2::new(100.0, 7.0));
        assert!(is_met(&hold(100.0), &all, &open()));
        assert!(is_met(&hold(100.7), &all, &open()));
        assert!(!is_met(&hold(101.0), &all, &open()));
    }

    #[test]
    fn drones_may_swap_slots_but_not_share_one() {
        let mut all = formed(Vec2::zeros());
        let (a, b) = (all[2], all[6]);
        (all[2], all[6]) = (b, a);
        assert!(is_met(&hold(0.0), &all, &open()));
        all[2] = a;
        assert!(!is_met(&hold(-100.0), &all, &open()));
    }

    #[test]
    fn the_slot_error_is_measured_after_the_best_translation() {
        let mut all = formed(Vec2::zeros());
        // The mean moves by an eighth of the shift: the error left is 7/8 of the shift.
        all[3] = moved(all[3], 0.9);
        assert!(is_met(&hold(0.0), &all, &open()));
        all[3] = moved(all[3], 0.03);
        assert!(!is_met(&hold(0.0), &all, &open()));
    }

    #[test]
    fn a_fast_drone_or_one_beside_an_obstacle_prevents_the_end() {
        let mut all = formed(Vec2::zeros());
        all[7] = Body::new(all[7].position(), Vec3::new(0.0, 1.01, 0.0));
        assert!(!is_met(&hold(0.0), &all, &open()));
        all[7] = Body::new(all[7].position(), Vec3::new(0.0, 1.0, 0.0));
        assert!(is_met(&hold(0.0), &all, &open()));
        let last = all.iter().map(|body| body.position().x).fold(f64::INFINITY, f64::min);
        let behind = |gap: f64| sensed(&rectangle(last - gap - 10.0, 0.0, 10.0, 5.0));
        assert!(is_met(&hold(0.0), &all, &behind(0.001)));
        assert!(!is_met(&hold(0.0), &all, &behind(-0.1)));
    }

    #[test]
    fn dead_drones_leave_their_slots() {
        let mut all = formed(Vec2::zeros());
        all[7] = moved(all[7], 500.0);
        all[7].kill();
        assert!(is_met(&hold(0.0), &all, &open()), "seven drones have the first seven of eight slots");
        all.iter_mut().for_each(Body::kill);
        assert!(!is_met(&hold(0.0), &all, &open()));
    }

    #[test]
    fn a_goal_is_met_at_its_place_alone() {
        let goal = |x| WorldParams { end: End::Goal { front_m: Vec2::new(x, 0.0) }, ..params() };
        let all = formed(Vec2::new(425.0, 0.5));
        assert!(is_met(&goal(425.0), &all, &open()));
        assert!(!is_met(&goal(424.0), &all, &open()));
        let behind = Stages::new(Course::East, &[Outline::new(&rectangle(500.0, 0.0, 5.0, 5.0))], 40.0);
        assert!(is_met(&goal(425.0), &all, &behind), "an obstacle behind the goal does not have to be passed");
    }

    #[test]
    fn a_slot_at_the_goal_is_left_free_beside_a_dead_drone_only() {
        let goal = WorldParams { end: End::Goal { front_m: Vec2::zeros() }, ..params() };
        let without_fourth = |moved_m: f64| {
            let mut all = formed(Vec2::zeros());
            all[3] = moved(all[3], moved_m);
            all[3].kill();
            all
        };
        assert!(is_met(&goal, &without_fourth(0.0), &open()), "it hangs in its slot");
        assert!(is_met(&goal, &without_fourth(0.9 * params().safe_distance_m), &open()));
        assert!(!is_met(&goal, &without_fourth(500.0), &open()), "the last drone could take its slot");
        assert!(!is_met(&hold(0.0), &without_fourth(0.0), &open()), "a formation that is held moves on");
    }

    #[test]
    fn slots_at_the_goal_are_left_free_beside_an_obstacle_once_a_drone_has_died() {
        let goal = WorldParams { shape: Shape::Column, end: End::Goal { front_m: Vec2::zeros() }, ..params() };
        let standing = |slot: f64| Body::new(Vec3::new(-slot * goal.spacing_m, 0.0, 0.0), Vec3::zeros());
        let met = |slots: &[f64], obstacles: &[ConvexShape], killed: Option<usize>| {
            let mut all: Vec<Body> = slots.iter().map(|&slot| standing(slot)).collect();
            killed.into_iter().for_each(|drone| all[drone].kill());
            EndCondition::among(obstacles).is_met(&goal, &all, &open(), &living(&all))
        };
        let in_fourth = [ConvexShape::circle(Vec2::new(-3.0 * goal.spacing_m, 0.0), 1.0).unwrap()];
        assert!(met(&[0.0, 1.0, 2.0, 4.0], &in_fourth, Some(1)));
        assert!(!met(&[0.0, 1.0, 2.0, 4.0], &[], Some(1)), "the fourth slot is free");
        assert!(!met(&[0.0, 1.0, 2.0, 4.0], &in_fourth, None), "no drone has died");
        // A leader may take every slot for blocked, because all are closer to the wall than it plans paths.
        let nine = ConvexShape::circle(Vec2::new(-7.0 * goal.spacing_m, 0.0), 4.0 * goal.spacing_m).unwrap();
        let beside = rectangle(0.0, goal.clearance_m + 1.1, 5000.0, 1.0);
        assert!(met(&[0.0, 1.0, 2.0, 12.0], &[nine, beside], Some(1)));
    }

    #[test]
    fn a_shape_with_too_few_slots_is_never_closed() {
        let few = WorldParams { shape: Shape::Offsets(vec![[0.0, 0.0]]), ..hold(-1e9) };
        assert!(!is_met(&few, &formed(Vec2::zeros()), &open()));
        let none = WorldParams { shape: Shape::Offsets(vec![]), ..hold(-1e9) };
        assert!(!is_met(&none, &formed(Vec2::zeros()), &open()));
    }
}
