//! The end condition of a mission, by the true state and not by what drones believe. A formation is closed if it is closed seen
//! from above: the altitudes of the drones do not matter.

use crate::body::Body;
use crate::grid::Grid;
use crate::params::{End, WorldParams};
use crate::stages::Stages;
use skein_protocol::Vec2;
use skein_protocol::formation::HOLD_SPEED_MPS;

/// Whether the living drones stand in their formation.
#[derive(Clone, Debug, Default)]
pub(crate) struct EndCondition {
    /// The slots of the formation relative to its front slot, m.
    slots: Vec<Vec2>,
    /// Mean of the slots, m.
    middle: Vec2,
    grid: Grid,
    /// Whether a drone stands in each slot.
    taken: Vec<bool>,
    /// Which drones have been past all obstacles. They may turn back later: the leader chooses where the slots are.
    past: Vec<bool>,
}

impl EndCondition {
    /// Whether the end condition is met. Without living drones it never is.
    pub(crate) fn is_met(&mut self, params: &WorldParams, bodies: &[Body], stages: &Stages) -> bool {
        let living = bodies.iter().filter(|body| body.is_alive()).count();
        if living == 0 {
            return false;
        }
        self.form(living, params);
        match params.end {
            End::Hold { stop_x_m } => {
                self.note_past(stages.rear_x_m() + params.planning_distance_m, bodies);
                if !self.holds(bodies) {
                    return false;
                }
                let anchor = self.anchor(bodies, living);
                anchor.x >= stop_x_m - params.arrival_error_m && self.filled(bodies, anchor, params.arrival_error_m)
            }
            End::Goal { front_m } => self.filled(bodies, front_m, params.arrival_error_m),
            // These ends do not depend on the formation.
            End::Time { .. } | End::Pilots => false,
        }
    }

    fn note_past(&mut self, past_x_m: f64, bodies: &[Body]) {
        self.past.resize(bodies.len(), false);
        for (past, body) in self.past.iter_mut().zip(bodies) {
            *past |= body.position().x >= past_x_m;
        }
    }

    /// Whether every living drone has been past every obstacle and is slow.
    fn holds(&self, bodies: &[Body]) -> bool {
        let slow = HOLD_SPEED_MPS * HOLD_SPEED_MPS;
        let mut living = bodies.iter().zip(&self.past).filter(|(body, _)| body.is_alive());
        living.all(|(body, past)| *past && body.velocity().norm_squared() <= slow)
    }

    /// Makes the slots for this number of drones, unless they are made already.
    fn form(&mut self, living: usize, params: &WorldParams) {
        if self.taken.len() == living {
            return;
        }
        self.taken = vec![false; living];
        self.slots = params.shape.slots(living, params.spacing_m);
        self.middle = self.slots.iter().sum::<Vec2>() / self.slots.len().max(1) as f64;
        let cell_m = params.spacing_m.max(params.arrival_error_m);
        self.grid.fill(cell_m, self.slots.iter().enumerate().map(|(i, &slot)| (i as u32, slot)));
    }

    /// Where the front slot is when the formation fits the living drones best (least squares), m.
    fn anchor(&self, bodies: &[Body], living: usize) -> Vec2 {
        let sum: Vec2 = bodies.iter().filter(|body| body.is_alive()).map(|body| body.position().xy()).sum();
        sum / living as f64 - self.middle
    }

    /// Whether each living drone is within `error_m` of a slot that no other drone takes. Only its nearest slot is
    /// tried: slots are farther apart than twice the error.
    fn filled(&mut self, bodies: &[Body], anchor: Vec2, error_m: f64) -> bool {
        self.taken.fill(false);
        bodies.iter().filter(|body| body.is_alive()).all(|body| {
            let place = body.position().xy() - anchor;
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
    use skein_protocol::Vec3;
    use skein_protocol::formation::Shape;

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

    fn is_met(params: &WorldParams, bodies: &[Body], stages: &Stages) -> bool {
        EndCondition::default().is_met(params, bodies, stages)
    }

    fn open() -> Stages {
        Stages::new(&[], 40.0)
    }

    #[test]
    fn a_drone_that_turns_back_to_its_slot_stays_past_the_obstacles() {
        let outline = Outline::new(&rectangle(0.0, 0.0, 10.0, 10.0));
        let stages = Stages::new(&[outline], 40.0);
        let (params, mut condition) = (hold(-1e9), EndCondition::default());
        assert!(!condition.is_met(&params, &formed(Vec2::new(20.0, 0.0)), &stages));
        assert!(condition.is_met(&params, &formed(Vec2::new(500.0, 0.0)), &stages));
        assert!(condition.is_met(&params, &formed(Vec2::new(20.0, 0.0)), &stages));
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
        let behind = |gap: f64| Stages::new(&[Outline::new(&rectangle(last - gap - 10.0, 0.0, 10.0, 5.0))], 40.0);
        assert!(is_met(&hold(0.0), &all, &behind(20.001)));
        assert!(!is_met(&hold(0.0), &all, &behind(19.9)));
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
        let behind = Stages::new(&[Outline::new(&rectangle(500.0, 0.0, 5.0, 5.0))], 40.0);
        assert!(is_met(&goal(425.0), &all, &behind), "an obstacle behind the goal does not have to be passed");
    }

    #[test]
    fn a_shape_with_too_few_slots_is_never_closed() {
        let few = WorldParams { shape: Shape::Offsets(vec![[0.0, 0.0]]), ..hold(-1e9) };
        assert!(!is_met(&few, &formed(Vec2::zeros()), &open()));
        let none = WorldParams { shape: Shape::Offsets(vec![]), ..hold(-1e9) };
        assert!(!is_met(&none, &formed(Vec2::zeros()), &open()));
    }
}
