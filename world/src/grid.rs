//! Points in square cells, to find the points near a place without looking at all of them.

use skein_protocol::Vec2;

/// Points sorted by square cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Grid {
    cell_m: f64,
    entries: Vec<((i64, i64), u32)>,
}

impl Grid {
    /// Takes points (m) with their numbers. `cell_m` is the greatest distance that will be asked for.
    pub(crate) fn fill(&mut self, cell_m: f64, points: impl Iterator<Item = (u32, Vec2)>) {
        // A little wider, so that rounding never puts two points at that distance two cells apart.
        self.cell_m = (cell_m * 1.000_001).max(f64::MIN_POSITIVE);
        self.entries.clear();
        let cell_m = self.cell_m;
        self.entries.extend(points.map(|(number, point)| (cell(point, cell_m), number)));
        self.entries.sort_unstable();
    }

    /// Calls `visit` with the number of every point in the 3 × 3 cells around `point`. All points within one cell's
    /// length are among them.
    pub(crate) fn each_near(&self, point: Vec2, mut visit: impl FnMut(u32)) {
        let (x, y) = cell(point, self.cell_m);
        for column in x.saturating_sub(1)..=x.saturating_add(1) {
            let from = (column, y.saturating_sub(1));
            let first = self.entries.partition_point(|entry| entry.0 < from);
            let rows = self.entries[first..].iter();
            for entry in rows.take_while(|entry| entry.0 <= (column, y.saturating_add(1))) {
                visit(entry.1);
            }
        }
    }
}

fn cell(point: Vec2, cell_m: f64) -> (i64, i64) {
    ((point.x / cell_m).floor() as i64, (point.y / cell_m).floor() as i64)
}
