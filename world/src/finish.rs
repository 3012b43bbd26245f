//! When the mission is over: by the world's truth, not by what drones believe.

use crate::body::Body;
use crate::grid::Grid;
use crate::params::{End, WorldParams};
use crate::stages::Stages;
use skein_protocol::Vec2;

/// A formation that is held moves no faster, m/s.
const HOLD_SPEED_MPS: f64 = 1.0;

/// The formation of the living drones, and whether they stand in it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Finish {
    slots: Vec<Vec2>,
    /// Mean of the slots, m.
    middle: Vec2,
    grid: Grid,
    taken: Vec<bool>,
    /// Which drones have been past all obstacles: where the slots then are is the leader's choice.
    past: Vec<bool>,
}

impl Finish {
    /// Whether the end condition is met; never with nobody alive.
    pub fn met(&mut self, params: &WorldParams, bodies: &[Body], stages: &Stages) -> bool {
        let living = bodies.iter().filter(|body| body.alive).count();
        if living == 0 {
            return false;
        }
        self.form(living, params);
        match params.end {
            End::Hold { stop_x_m } => {
                self.note_past(stages.rear_x_m + params.planning_distance_m, bodies);
                self.holds(bodies) && {
                    let anchor = self.anchor(bodies, living);
                    anchor.x >= stop_x_m - params.arrival_error_m && self.filled(bodies, anchor, params.arrival_error_m)
                }
            }
            End::Goal { front_m } => stages.all_passed() && self.filled(bodies, front_m, params.arrival_error_m),
        }
    }

    fn note_past(&mut self, past_x_m: f64, bodies: &[Body]) {
        self.past.resize(bodies.len(), false);
        self.past.iter_mut().zip(bodies).for_each(|(past, body)| *past |= body.position.x >= past_x_m);
    }

    /// Whether every living drone has been past every obstacle and is slow.
    fn holds(&self, bodies: &[Body]) -> bool {
        let slow = HOLD_SPEED_MPS * HOLD_SPEED_MPS;
        let mut living = bodies.iter().zip(&self.past).filter(|(body, _)| body.alive);
        living.all(|(body, past)| *past && body.velocity.norm_squared() <= slow)
    }

    /// Makes the slots of so many drones, unless they are at hand.
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

    /// Where the front slot is when the formation fits the living drones best.
    fn anchor(&self, bodies: &[Body], living: usize) -> Vec2 {
        let sum: Vec2 = bodies.iter().filter(|body| body.alive).map(|body| body.position).sum();
        sum / living as f64 - self.middle
    }

    /// Whether each living drone is within `error_m` of a slot of its own. Its nearest slot is the only candidate:
    /// slots are farther apart than twice the error.
    fn filled(&mut self, bodies: &[Body], anchor: Vec2, error_m: f64) -> bool {
        self.taken.fill(false);
        bodies.iter().filter(|body| body.alive).all(|body| {
            let place = body.position - anchor;
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

    /// Eight drones at rest in a nested V with its front at this point.
    fn formed(front: Vec2) -> Vec<Body> {
        starts(8).into_iter().map(|(slot, _)| Body::new(slot + front, Vec2::zeros())).collect()
    }

    fn hold(stop_x_m: f64) -> WorldParams {
        WorldParams { end: End::Hold { stop_x_m }, ..params() }
    }

    fn met(params: &WorldParams, bodies: &[Body], stages: &Stages) -> bool {
        Finish::default().met(params, bodies, stages)
    }

    fn open() -> Stages {
        Stages::new(&[], 40.0)
    }

    #[test]
    fn a_drone_that_turns_back_to_its_slot_has_still_been_past() {
        let outline = Outline::new(&rectangle(0.0, 0.0, 10.0, 10.0));
        let stages = Stages::new(&[outline], 40.0);
        let (params, mut finish) = (hold(-1e9), Finish::default());
        assert!(!finish.met(&params, &formed(Vec2::new(20.0, 0.0)), &stages));
        assert!(finish.met(&params, &formed(Vec2::new(500.0, 0.0)), &stages));
        assert!(finish.met(&params, &formed(Vec2::new(20.0, 0.0)), &stages));
    }

    #[test]
    fn a_closed_formation_at_rest_holds_beyond_the_stop() {
        let all = formed(Vec2::new(100.0, 7.0));
        assert!(met(&hold(100.0), &all, &open()));
        assert!(met(&hold(100.7), &all, &open()));
        assert!(!met(&hold(101.0), &all, &open()));
    }

    #[test]
    fn drones_may_swap_slots_but_not_share_one() {
        let mut all = formed(Vec2::zeros());
        let (a, b) = (all[2].position, all[6].position);
        (all[2].position, all[6].position) = (b, a);
        assert!(met(&hold(0.0), &all, &open()));
        all[2].position = a;
        assert!(!met(&hold(-100.0), &all, &open()));
    }

    #[test]
    fn the_error_is_that_after_the_best_translation() {
        let mut all = formed(Vec2::zeros());
        // Moves the mean by an eighth: the error left is 7/8 of the shift.
        all[3].position.y += 0.9;
        assert!(met(&hold(0.0), &all, &open()));
        all[3].position.y += 0.03;
        assert!(!met(&hold(0.0), &all, &open()));
    }

    #[test]
    fn a_fast_drone_or_one_beside_an_obstacle_is_not_done() {
        let mut all = formed(Vec2::zeros());
        all[7].velocity.y = 1.01;
        assert!(!met(&hold(0.0), &all, &open()));
        all[7].velocity.y = 1.0;
        assert!(met(&hold(0.0), &all, &open()));
        let last = all.iter().map(|body| body.position.x).fold(f64::INFINITY, f64::min);
        let behind = |gap: f64| Stages::new(&[Outline::new(&rectangle(last - gap - 10.0, 0.0, 10.0, 5.0))], 40.0);
        assert!(met(&hold(0.0), &all, &behind(20.001)));
        assert!(!met(&hold(0.0), &all, &behind(19.9)));
    }

    #[test]
    fn the_dead_leave_their_slots() {
        let mut all = formed(Vec2::zeros());
        all[7].alive = false;
        all[7].position.y += 500.0;
        assert!(met(&hold(0.0), &all, &open()), "the slots of seven are the first seven of eight");
        all.iter_mut().for_each(|body| body.alive = false);
        assert!(!met(&hold(0.0), &all, &open()));
    }

    #[test]
    fn a_goal_is_a_place() {
        let goal = |x| WorldParams { end: End::Goal { front_m: Vec2::new(x, 0.0) }, ..params() };
        let all = formed(Vec2::new(425.0, 0.5));
        assert!(met(&goal(425.0), &all, &open()));
        assert!(!met(&goal(424.0), &all, &open()));
        let mut unpassed = Stages::new(&[Outline::new(&rectangle(100.0, 0.0, 5.0, 5.0))], 40.0);
        assert!(!met(&goal(425.0), &all, &unpassed));
        unpassed.pass(&all, skein_protocol::SimTime::ZERO, &mut crate::log::Log::default());
        assert!(met(&goal(425.0), &all, &unpassed));
    }

    #[test]
    fn a_shape_with_too_few_slots_is_never_closed() {
        let few = WorldParams { shape: Shape::Offsets(vec![[0.0, 0.0]]), ..hold(-1e9) };
        assert!(!met(&few, &formed(Vec2::zeros()), &open()));
        let none = WorldParams { shape: Shape::Offsets(vec![]), ..hold(-1e9) };
        assert!(!met(&none, &formed(Vec2::zeros()), &open()));
    }
}
