//! The lines between two drones that sense each other.

use super::sight::{Sight, Who};
use crate::braking_path::BrakingPath;

/// Bound on the rounding error of a distance that two drones compute, m, and on what the commands of a reaction time can take of it.
const ROUNDING_M: f64 = 1e-7;

/// The paths of the two drones of a pair in one tick, in the frame of the drone that remembers them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Paths {
    /// The present tick.
    pub(crate) tick: u64,
    /// The reaction time of both, ticks.
    pub(crate) lag: u32,
    /// Paths are compared at the ticks whose number is a multiple of this.
    pub(crate) stride: u32,
    /// Half of the distance to keep, m.
    pub(crate) half_m: f64,
    /// This drone's braking path from its present state, which the other drone senses.
    pub(crate) sensed: BrakingPath,
    /// This drone's braking path after the commands that it has given. It begins `lag` ticks later.
    pub(crate) given: BrakingPath,
    /// The other drone's braking path from its present state.
    pub(crate) other: BrakingPath,
}

/// The lines to which a drone keeps, because the other drone of the pair does or may do so as well.
#[derive(Clone, Debug, Default)]
pub(crate) struct SightedPair {
    /// The lines to which this drone is bound, the oldest first.
    bound: Vec<Sight>,
    /// Whether the other drone is bound to one of them as well.
    is_known: bool,
    /// Whether the two are so far apart that they keep to their lines whatever they command.
    is_apart: bool,
    /// The sight of the present tick. The drone comes no nearer to its line than what it has commanded takes it.
    newest: Option<Sight>,
}

impl Paths {
    fn sight(&self) -> Sight {
        Sight::new(self.tick, self.sensed, self.other, self.half_m)
    }

    /// Whether this drone binds itself to a line: the commands that it has given keep to it.
    fn bind(&self, line: &Sight) -> bool {
        let begins = self.tick + u64::from(self.lag);
        line.beyond_m(Who::Own, (begins, &self.given), self.stride) >= -2.0 * ROUNDING_M
    }

    /// How much farther than demanded both sensed paths keep from the line, m: the smaller of the two distances.
    fn beyond_m(&self, line: &Sight) -> f64 {
        let own_m = line.beyond_m(Who::Own, (self.tick, &self.sensed), self.stride);
        own_m.min(line.beyond_m(Who::Other, (self.tick, &self.other), self.stride))
    }
}

impl SightedPair {
    /// Whether the pair has not been seen before this tick.
    pub(crate) fn is_new(&self) -> bool {
        self.newest.is_none()
    }

    /// Whether both drones are bound to a common line.
    pub(crate) fn is_known(&self) -> bool {
        self.is_known
    }

    /// The tick in which the drones sensed each other last.
    pub(crate) fn seen(&self) -> Option<u64> {
        self.newest.map(|sight| sight.tick())
    }

    /// The lines that restrict this drone's commands.
    pub(crate) fn lines(&self) -> impl Iterator<Item = &Sight> {
        let near = !self.is_apart;
        self.bound.iter().chain(&self.newest).filter(move |_| near)
    }

    /// The first line of the mission, to which both drones keep by assumption.
    pub(crate) fn begin(&mut self, paths: &Paths) {
        (self.bound, self.is_known) = (vec![paths.sight()], true);
    }

    /// The two drones keep to the bisector of their positions, whatever they have commanded.
    pub(crate) fn meet(&mut self, paths: &Paths) {
        (self.bound, self.is_known) = (vec![paths.sight().resting()], true);
    }

    /// The same, and whatever they command in this tick and in the next one. The line of the last tick is remembered as well: if
    /// rounding lets only one of the two drones find that they have come near, that line is still common.
    pub(crate) fn stay_apart(&mut self, paths: &Paths) {
        let resting = paths.sight().resting();
        let before = self.newest.filter(|_| self.is_apart).unwrap_or(resting);
        *self = Self { bound: vec![before, resting], is_known: true, is_apart: true, newest: Some(resting) };
    }

    /// Finds the lines to which both drones turned out to be bound, and makes the line of this tick if it is time.
    pub(crate) fn come_near(&mut self, paths: &Paths, makes_line: bool) {
        self.is_apart = false;
        self.settle(paths);
        let sight = paths.sight();
        if makes_line && paths.bind(&sight) {
            self.bound.push(sight);
        }
        self.newest = Some(sight);
    }

    /// The lines that are one reaction time old were kept to, or not, by what both drones can sense now. If both are bound to a line,
    /// older lines are void. If one is not, that line is void, because the other drone will not count on it. If rounding may decide,
    /// both stay valid.
    fn settle(&mut self, paths: &Paths) {
        for index in (0..self.bound.len()).rev() {
            if self.bound[index].tick() + u64::from(paths.lag) != paths.tick {
                continue;
            }
            let beyond_m = paths.beyond_m(&self.bound[index]);
            if beyond_m >= -ROUNDING_M {
                self.bound.drain(..index);
                self.is_known = true;
                return;
            }
            if beyond_m < -3.0 * ROUNDING_M && !(index == 0 && self.is_known) {
                self.bound.remove(index);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::braking_path::BrakingLaw;
    use skein_protocol::Vec2;

    const LAW: BrakingLaw = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };
    const LAG: u32 = 10;

    /// A drone at the origin and another one on the x axis, both at rest. `given_m`: where this drone's commands take it.
    fn paths(tick: u64, own_m: f64, given_m: f64, other_m: f64) -> Paths {
        let rest = |x: f64| BrakingPath::new(Vec2::new(x, 0.0), Vec2::zeros(), LAW);
        let (sensed, given, other) = (rest(own_m), rest(given_m), rest(other_m));
        Paths { tick, lag: LAG, stride: 5, half_m: 10.0, sensed, given, other }
    }

    fn ticks(pair: &SightedPair) -> Vec<u64> {
        pair.bound.iter().map(|line| line.tick()).collect()
    }

    #[test]
    fn a_line_to_which_both_kept_replaces_the_older_one() {
        let mut pair = SightedPair::default();
        pair.begin(&paths(0, 0.0, 0.0, 50.0));
        pair.come_near(&paths(20, 0.0, 10.0, 50.0), true);
        assert_eq!(ticks(&pair), [0, 20], "nothing is known of the other drone's commands");
        pair.come_near(&paths(30, 10.0, 10.0, 40.0), false);
        assert_eq!(ticks(&pair), [20]);
    }

    #[test]
    fn a_line_that_the_other_drone_crossed_is_void() {
        let mut pair = SightedPair::default();
        pair.begin(&paths(0, 0.0, 0.0, 50.0));
        pair.come_near(&paths(20, 0.0, 0.0, 50.0), true);
        pair.come_near(&paths(30, 0.0, 0.0, 30.0), false);
        assert_eq!(ticks(&pair), [0]);
    }

    #[test]
    fn a_drone_is_not_bound_to_a_line_that_its_own_commands_cross() {
        let mut pair = SightedPair::default();
        pair.begin(&paths(0, 0.0, 0.0, 50.0));
        pair.come_near(&paths(20, 0.0, 16.0, 50.0), true);
        assert_eq!(ticks(&pair), [0], "the line is at 25 m, and the drone keeps 10 m");
    }

    #[test]
    fn a_drone_that_knows_nothing_of_a_near_neighbour_brakes_until_a_line_is_common() {
        let mut pair = SightedPair::default();
        pair.come_near(&paths(20, 0.0, 0.0, 30.0), true);
        assert!(!pair.is_known());
        pair.come_near(&paths(30, 0.0, 0.0, 30.0), true);
        assert!(pair.is_known());
    }

    #[test]
    fn distant_drones_have_no_lines_and_a_common_one_when_they_come_near() {
        let mut pair = SightedPair::default();
        for tick in 0..5 {
            pair.stay_apart(&paths(tick, 0.0, 0.0, 500.0 - tick as f64));
            assert_eq!(pair.lines().count(), 0);
        }
        pair.come_near(&paths(5, 0.0, 0.0, 100.0), true);
        assert_eq!((pair.is_known(), ticks(&pair)), (true, vec![3, 4, 5]));
    }
}
