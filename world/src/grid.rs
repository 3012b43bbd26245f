//! Who is near whom, without looking at every pair.

use crate::body::Body;
use skein_protocol::Vec2;

/// Up to so many bodies it is cheaper to look at every pair.
const FEW: usize = 64;

/// Points sorted by square cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    cell_m: f64,
    entries: Vec<((i64, i64), u32)>,
}

impl Grid {
    /// Takes points with their numbers; `cell_m` is the greatest distance that will be asked for.
    pub fn fill(&mut self, cell_m: f64, points: impl Iterator<Item = (u32, Vec2)>) {
        // A shade wider, so that rounding never puts two points at that distance two cells apart.
        self.cell_m = (cell_m * 1.000_001).max(f64::MIN_POSITIVE);
        self.entries.clear();
        let cell_m = self.cell_m;
        self.entries.extend(points.map(|(number, point)| (cell(point, cell_m), number)));
        self.entries.sort_unstable();
    }

    /// Calls `visit` with every point in the 3 × 3 cells around `point`: all within a cell's length are among them.
    pub fn each_near(&self, point: Vec2, mut visit: impl FnMut(u32)) {
        let (x, y) = cell(point, self.cell_m);
        for column in x.saturating_sub(1)..=x.saturating_add(1) {
            let from = (column, y.saturating_sub(1));
            let first = self.entries.partition_point(|entry| entry.0 < from);
            let rows = self.entries[first..].iter();
            rows.take_while(|entry| entry.0 <= (column, y.saturating_add(1))).for_each(|entry| visit(entry.1));
        }
    }
}

fn cell(point: Vec2, cell_m: f64) -> (i64, i64) {
    ((point.x / cell_m).floor() as i64, (point.y / cell_m).floor() as i64)
}

/// For each body the others within a radius, ids ascending. Bodies that do not fly have none and are nobody's.
#[derive(Clone, Debug, Default)]
pub(crate) struct Neighbours {
    /// Where each body's entries begin; one more than there are bodies.
    starts: Vec<u32>,
    ids: Vec<u32>,
    grid: Grid,
}

impl Neighbours {
    /// Finds them anew, in the memory of the last time.
    pub fn find(&mut self, bodies: &[Body], radius_m: f64) {
        if bodies.len() <= FEW { self.find_by_pairs(bodies, radius_m) } else { self.find_by_grid(bodies, radius_m) }
    }

    /// Those of one body.
    pub fn of(&self, body: usize) -> &[u32] {
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
        self.grid.fill(radius_m, flying.map(|(i, body)| (i as u32, body.position)));
        for (i, body) in bodies.iter().enumerate() {
            let first = self.ids.len();
            if body.flies() {
                self.grid.each_near(body.position, |j| {
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
    other.flies() && (other.position - body.position).norm_squared() <= radius_m * radius_m
}

/// Square of the least distance of two flying bodies, m²; infinite if there are not two. Looks at every pair.
pub(crate) fn closest_pair_squared(bodies: &[Body]) -> f64 {
    let flying = |body: &&Body| body.flies();
    let mut square = f64::INFINITY;
    for (i, body) in bodies.iter().enumerate().filter(|(_, body)| body.flies()) {
        let others = bodies[i + 1..].iter().filter(flying);
        square = others.map(|other| (other.position - body.position).norm_squared()).fold(square, f64::min);
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
    fn landed_bodies_are_nobodys_neighbours() {
        let mut all = bodies(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]);
        let land = WorldParams { failsafe: Failsafe::Land, ..params() };
        (0..1000).for_each(|_| all[1].fail_safe(&land));
        let mut found = Neighbours::default();
        found.find(&all, 5.0);
        assert_eq!((found.of(0), found.of(1), found.of(2)), (&[2][..], &[][..], &[0][..]));
        assert_eq!(closest_pair_squared(&all), 4.0);
    }

    #[test]
    fn an_endless_radius_finds_all() {
        let all = bodies(&[[0.0, 0.0], [1e9, 0.0]]);
        let mut found = Neighbours::default();
        found.find_by_grid(&all, f64::INFINITY);
        assert_eq!((found.of(0), found.of(1)), (&[1][..], &[0][..]));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn the_grid_finds_what_all_pairs_find(
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
