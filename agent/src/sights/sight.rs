//! What two drones sensed of each other in one tick, and the line that both compute from it.

use crate::braking_path::BrakingPath;
use skein_protocol::Vec2;

/// The braking paths of two drones from the states that both sensed in one tick. In each later tick, the line between the two drones
/// is the perpendicular bisector of the two positions on these paths. Positions are in a frame of the drone that remembers them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sight {
    tick: u64,
    half_m: f64,
    own: BrakingPath,
    other: BrakingPath,
}

/// Which of the two drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    /// The drone that remembers the sight.
    Own,
    /// The other drone.
    Other,
}

/// The line of one tick, and the side of this drone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bisector {
    /// Unit normal. It points to this drone's side.
    pub(crate) normal: Vec2,
    /// Component of the line's points along the normal, m.
    pub(crate) offset_m: f64,
    /// Distance that each of the two drones keeps from the line, m: half of the distance to keep, or half of what there is if the
    /// two are nearer already.
    pub(crate) keep_m: f64,
}

impl Sight {
    /// The sight of tick `tick`, with the braking paths of both drones from that tick on. `half_m`: half of the distance to keep, m.
    pub(crate) fn new(tick: u64, own: BrakingPath, other: BrakingPath, half_m: f64) -> Self {
        Self { tick, half_m, own, other }
    }

    /// The sight of two drones that rest where these are: its line does not move.
    pub(crate) fn resting(&self) -> Self {
        Self { own: self.own.resting(), other: self.other.resting(), ..*self }
    }

    /// The tick in which the two drones sensed each other.
    pub(crate) fn tick(&self) -> u64 {
        self.tick
    }

    /// The first tick from which on the line does not move any more.
    pub(crate) fn rests(&self) -> u64 {
        self.tick + u64::from(self.own.ticks().max(self.other.ticks()))
    }

    /// The line in tick `tick`.
    pub(crate) fn bisector(&self, tick: u64) -> Bisector {
        let ticks = tick.saturating_sub(self.tick).min(self.rests() - self.tick) as u32;
        let (here, there) = (self.own.at(ticks), self.other.at(ticks));
        let (offset, distance_m) = (here - there, (here - there).norm());
        let normal = if distance_m > 1e-9 { offset / distance_m } else { Vec2::x() };
        Bisector { normal, offset_m: normal.dot(&(here + there)) / 2.0, keep_m: self.half_m.min(distance_m / 2.0) }
    }

    /// How much farther than demanded a path keeps from the line, on the side of `who`, at the compared ticks, m; negative if it is too
    /// near. `begins`: the tick in which the path begins. The compared ticks are the multiples of `stride`.
    pub(crate) fn beyond_m(&self, who: Who, (begins, path): (u64, &BrakingPath), stride: u32) -> f64 {
        let stride = u64::from(stride.max(1));
        let last = self.rests().max(begins + u64::from(path.ticks()));
        let mut tick = begins.next_multiple_of(stride);
        let mut least_m = f64::INFINITY;
        loop {
            let line = self.bisector(tick);
            let along_m = line.normal.dot(&path.at((tick - begins) as u32)) - line.offset_m;
            least_m = least_m.min(if who == Who::Own { along_m } else { -along_m } - line.keep_m);
            if tick >= last {
                return least_m;
            }
            tick += stride;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::braking_path::BrakingLaw;

    const LAW: BrakingLaw = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };

    #[test]
    fn the_line_stays_in_the_middle_of_two_braking_paths() {
        let own = BrakingPath::new(Vec2::zeros(), Vec2::new(10.0, 0.0), LAW);
        let other = BrakingPath::new(Vec2::new(50.0, 0.0), Vec2::zeros(), LAW);
        let sight = Sight::new(8, own, other, 12.0);
        assert!((sight.bisector(8).offset_m + 25.0).abs() < 1e-9, "the normal points to this drone");
        assert!((sight.bisector(1000).offset_m + 30.0).abs() < 1e-9, "this drone stops after 10 m");
        assert!((sight.beyond_m(Who::Own, (8, &own), 4) - 8.0).abs() < 1e-9);
        assert!((sight.beyond_m(Who::Other, (8, &other), 4) - 8.0).abs() < 1e-9);
        assert!(sight.beyond_m(Who::Other, (8, &own), 4) < -20.0, "it is on the other side");
        assert!((sight.resting().bisector(1000).offset_m + 25.0).abs() < 1e-9);
    }

    #[test]
    fn drones_that_are_too_near_come_no_nearer() {
        let at = |x: f64| BrakingPath::new(Vec2::new(x, 0.0), Vec2::zeros(), LAW);
        let sight = Sight::new(0, at(0.0), at(8.0), 12.0);
        assert!(sight.beyond_m(Who::Own, (0, &at(0.0)), 4).abs() < 1e-9);
        assert!(sight.beyond_m(Who::Own, (0, &at(0.5)), 4) < -0.4);
    }
}
