//! Which bodies are near which.

use crate::body::Body;
use crate::grid::Grid;
use crate::tuning::{NEIGHBOUR_MARGIN, PAIRWISE_MAX_BODIES};
use skein_protocol::Vec3;

/// For each body the other bodies within a radius, and some that are a little farther away; ids ascending. Bodies that have landed have no
/// neighbours and are no drone's neighbours. They are lists as those of Verlet (1967): one search holds until bodies have moved far enough
/// relative to each other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Neighbours {
    /// The bodies as they were when they were searched: where they were, and whether they flew.
    found: Vec<(Vec3, bool)>,
    /// The radius that was searched, m.
    reach_m: f64,
    /// Where each body's entries begin; one more than there are bodies.
    starts: Vec<u32>,
    ids: Vec<u32>,
    grid: Grid,
}

impl Neighbours {
    /// Finds the neighbours of all bodies within `radius_m`, and some that are a little farther away. Reuses the memory of the last search,
    /// and its result if that still holds.
    pub(crate) fn find(&mut self, bodies: &[Body], radius_m: f64) {
        if self.holds(bodies, radius_m) {
            return;
        }
        let reach_m = (1.0 + NEIGHBOUR_MARGIN) * radius_m;
        if bodies.len() <= PAIRWISE_MAX_BODIES {
            self.find_by_pairs(bodies, reach_m);
        } else {
            self.find_by_grid(bodies, reach_m);
        }
        self.reach_m = reach_m;
        self.found.clear();
        self.found.extend(bodies.iter().map(|body| (body.position(), body.flies())));
    }

    /// Whether no two bodies can have come within `radius_m` since the search that did not find them: none has moved farther than half of
    /// the margin, in a frame that moves with the first one.
    fn holds(&self, bodies: &[Body], radius_m: f64) -> bool {
        // A little less, for what is lost by rounding.
        let most_m = 0.499 * (self.reach_m - radius_m);
        let (Some(first), Some((first_found, _))) = (bodies.first(), self.found.first()) else { return false };
        let moved = first.position() - first_found;
        let stays = |(body, (found, flew)): (&Body, &(Vec3, bool))| {
            (body.position() - found - moved).norm_squared() <= most_m * most_m && body.flies() == *flew
        };
        most_m > 0.0 && bodies.len() == self.found.len() && bodies.iter().zip(&self.found).all(stays)
    }

    /// The neighbours of one body, and perhaps some that are a little farther away.
    pub(crate) fn of(&self, body: usize) -> &[u32] {
        &self.ids[self.starts[body] as usize..self.starts[body + 1] as usize]
    }

    fn find_by_pairs(&mut self, bodies: &[Body], radius_m: f64) {
        self.restart();
        for (i, body) in bodies.iter().enumerate() {
            if body.flies() {
                let others = bodies.iter().enumerate().filter(|&(j, other)| j != i && near(body, other, radius_m));
                self.ids.extend(others.map(|(j, _)| j as u32));
            }
            self.starts.push(self.ids.len() as u32);
        }
    }

    fn find_by_grid(&mut self, bodies: &[Body], radius_m: f64) {
        self.restart();
        let flying = bodies.iter().enumerate().filter(|(_, body)| body.flies());
        self.grid.fill(radius_m, flying.map(|(i, body)| (i as u32, body.position().xy())));
        for (i, body) in bodies.iter().enumerate() {
            let first = self.ids.len();
            if body.flies() {
                self.grid.each_near(body.position().xy(), |j| {
                    if j as usize != i && near(body, &bodies[j as usize], radius_m) {
                        self.ids.push(j);
                    }
                });
                self.ids[first..].sort_unstable();
            }
            self.starts.push(self.ids.len() as u32);
        }
    }

    fn restart(&mut self) {
        self.ids.clear();
        self.starts.clear();
        self.starts.push(0);
    }
}

fn near(body: &Body, other: &Body, radius_m: f64) -> bool {
    other.flies() && (other.position() - body.position()).norm_squared() <= radius_m * radius_m
}

/// Square of the least distance of two flying bodies, m²; infinite if fewer than two fly. Looks at every pair.
pub(crate) fn closest_pair_squared(bodies: &[Body]) -> f64 {
    let flying = |body: &&Body| body.flies();
    let mut square = f64::INFINITY;
    for (i, body) in bodies.iter().enumerate().filter(|(_, body)| body.flies()) {
        let others = bodies[i + 1..].iter().filter(flying);
        square = others.map(|other| (other.position() - body.position()).norm_squared()).fold(square, f64::min);
    }
    square
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{Failsafe, WorldParams};
    use crate::testing::{bodies, params};
    use proptest::prelude::*;

    #[test]
    fn landed_bodies_have_no_neighbours() {
        let mut all = bodies(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        let land = WorldParams { failsafe: Failsafe::Land, ..params() };
        for _ in 0..1000 {
            all[1].fail_safe(&land);
        }
        let mut found = Neighbours::default();
        found.find(&all, 5.0);
        assert_eq!((found.of(0), found.of(1), found.of(2)), (&[2][..], &[][..], &[0][..]));
        assert_eq!(closest_pair_squared(&all), 4.0);
    }

    #[test]
    fn an_infinite_radius_finds_all() {
        let all = bodies(&[[0.0, 0.0], [1e9, 0.0]]);
        let mut found = Neighbours::default();
        found.find_by_grid(&all, f64::INFINITY);
        assert_eq!((found.of(0), found.of(1)), (&[1][..], &[0][..]));
    }

    /// Bodies at these places (m), of which some have landed.
    fn landed(places: &[[f64; 2]], down: usize) -> Vec<Body> {
        let mut all = bodies(places);
        let land = WorldParams { failsafe: Failsafe::Land, ..params() };
        for body in all.iter_mut().skip(1).step_by(2).take(down) {
            for _ in 0..1000 {
                body.fail_safe(&land);
            }
        }
        all
    }

    /// How many searches were made while bodies moved by these steps, m, and at the end some landed. After each step no neighbour may be
    /// missing, and the others must be just as near as the margin allows.
    fn searches(places: &[[f64; 2]], steps: &[Vec<[f64; 2]>], radius_m: f64) -> usize {
        let (mut found, mut searches) = (Neighbours::default(), 0);
        let mut places = places.to_vec();
        for (number, step) in steps.iter().enumerate() {
            for (place, step) in places.iter_mut().zip(step) {
                *place = [place[0] + step[0], place[1] + step[1]];
            }
            let all = landed(&places, if number + 1 == steps.len() { 3 } else { 0 });
            searches += usize::from(!found.holds(&all, radius_m));
            found.find(&all, radius_m);
            let mut exact = Neighbours::default();
            exact.find_by_pairs(&all, radius_m);
            for body in 0..all.len() {
                assert!(found.of(body).is_sorted());
                assert!(exact.of(body).iter().all(|near| found.of(body).contains(near)));
                let reach_m = radius_m * (1.0 + 2.0 * NEIGHBOUR_MARGIN);
                let counts =
                    |&near: &u32| near as usize != body && self::near(&all[body], &all[near as usize], reach_m);
                assert!(all[body].flies() || found.of(body).is_empty());
                assert!(found.of(body).iter().all(counts));
            }
        }
        searches
    }

    #[test]
    fn a_formation_is_searched_once_however_far_it_flies() {
        let places: Vec<[f64; 2]> = (0..40).map(|i| [f64::from(i % 7) * 35.0, f64::from(i / 7) * 35.0]).collect();
        // The last tick is one in which drones land.
        let steps = vec![vec![[0.4, 0.1]; 40]; 2000];
        assert_eq!(searches(&places, &steps, 66.0), 2);
        let meet: Vec<Vec<[f64; 2]>> =
            vec![(0..40).map(|i| if i % 2 == 0 { [0.4, 0.0] } else { [-0.4, 0.0] }).collect(); 100];
        let met = searches(&places, &meet, 66.0);
        assert!((5..30).contains(&met), "{met} searches");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn no_neighbour_is_missed_while_bodies_move(
            places in prop::collection::vec([-100f64..100.0, -100f64..100.0], 1..80),
            steps in prop::collection::vec(prop::collection::vec([-3f64..3.0, -3f64..3.0], 80), 1..20),
            radius in 0f64..90.0,
        ) {
            searches(&places, &steps, radius);
        }

        #[test]
        fn the_grid_finds_what_comparing_all_pairs_finds(
            positions in prop::collection::vec([-200f64..200.0, -200f64..200.0], 0..150),
            radius in 0f64..90.0,
        ) {
            let all = bodies(&positions);
            let (mut by_grid, mut by_pairs) = (Neighbours::default(), Neighbours::default());
            by_grid.find_by_grid(&all, radius);
            by_pairs.find_by_pairs(&all, radius);
            prop_assert_eq!(&by_grid.starts, &by_pairs.starts);
            prop_assert_eq!(&by_grid.ids, &by_pairs.ids);
        }
    }
}
