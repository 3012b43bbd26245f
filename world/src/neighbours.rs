//! Which bodies are near which.

use crate::body::Body;
use crate::grid::Grid;
use crate::tuning::PAIRWISE_MAX_BODIES;

/// For each body the other bodies within a radius, ids ascending. Bodies that have landed have no neighbours and are
/// no drone's neighbours.
#[derive(Clone, Debug, Default)]
pub(crate) struct Neighbours {
    /// Where each body's entries begin; one more than there are bodies.
    starts: Vec<u32>,
    ids: Vec<u32>,
    grid: Grid,
}

impl Neighbours {
    /// Finds the neighbours of all bodies within `radius_m`. Reuses the memory of the last search.
    pub(crate) fn find(&mut self, bodies: &[Body], radius_m: f64) {
        if bodies.len() <= PAIRWISE_MAX_BODIES {
            self.find_by_pairs(bodies, radius_m);
        } else {
            self.find_by_grid(bodies, radius_m);
        }
    }

    /// The neighbours of one body.
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
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
