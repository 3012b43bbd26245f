//! An exact solver of the assignment problem: the Hungarian method with potentials, O(rows² · columns). All parts of the
//! project that need such a solver use this one.

/// Assigns a column to each row so that no column is used twice and the sum of the costs is smallest. `cost` takes a row and a
/// column. The result has one entry per row: the column assigned to that row.
///
/// Surplus columns stay free. Of equally cheap columns in a search step, the lower one is preferred.
///
/// # Panics
/// If there are more rows than columns.
///
/// ```
/// use skein_protocol::matching::least_cost;
/// let cost = [[4.0, 1.0, 3.0], [2.0, 0.0, 5.0]];
/// assert_eq!(least_cost(2, 3, |row, column| cost[row][column]), [1, 0]);
/// ```
#[must_use]
pub fn least_cost(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut matching = Matching::new(columns);
    for row in 0..rows {
        matching.add(row, &cost);
    }
    let mut column_of = vec![0; rows];
    for (column, row) in matching.row_of.iter().enumerate() {
        if let Some(row) = row {
            column_of[*row] = column;
        }
    }
    column_of
}

/// A least-cost matching of the rows added so far, and the potentials that prove it.
struct Matching {
    row_of: Vec<Option<usize>>,
    row_potential: Vec<f64>,
    column_potential: Vec<f64>,
}

/// The search for the cheapest augmenting path from one new row to a free column.
struct Search {
    /// For each column: reduced cost of the cheapest path to it found so far.
    reach: Vec<f64>,
    /// For each column: the column before it on that path; `None` if the path goes there directly from the new row.
    before: Vec<Option<usize>>,
    done: Vec<bool>,
}

impl Matching {
    fn new(columns: usize) -> Self {
        Self { row_of: vec![None; columns], row_potential: Vec::new(), column_potential: vec![0.0; columns] }
    }

    fn add(&mut self, row: usize, cost: &impl Fn(usize, usize) -> f64) {
        self.row_potential.push(0.0);
        let columns = self.row_of.len();
        let mut search =
            Search { reach: vec![f64::INFINITY; columns], before: vec![None; columns], done: vec![false; columns] };
        let (mut at, mut from, mut length) = (row, None, 0.0);
        let free = loop {
            search.relax(
                |column| length + cost(at, column) - self.row_potential[at] - self.column_potential[column],
                from,
            );
            let next = search.nearest();
            length = search.reach[next];
            search.done[next] = true;
            match self.row_of[next] {
                None => break next,
                Some(taken) => (at, from) = (taken, Some(next)),
            }
        };
        self.reprice(row, length, &search);
        self.augment(row, free, &search.before);
    }

    fn reprice(&mut self, row: usize, length: f64, search: &Search) {
        self.row_potential[row] += length;
        for column in (0..self.row_of.len()).filter(|&column| search.done[column]) {
            let slack = length - search.reach[column];
            self.column_potential[column] -= slack;
            if let Some(taken) = self.row_of[column] {
                self.row_potential[taken] += slack;
            }
        }
    }

    fn augment(&mut self, row: usize, free: usize, before: &[Option<usize>]) {
        let mut column = free;
        while let Some(previous) = before[column] {
            self.row_of[column] = self.row_of[previous];
            column = previous;
        }
        self.row_of[column] = Some(row);
    }
}

impl Search {
    fn relax(&mut self, length: impl Fn(usize) -> f64, from: Option<usize>) {
        for column in 0..self.reach.len() {
            if self.done[column] {
                continue;
            }
            let length = length(column);
            if length < self.reach[column] {
                (self.reach[column], self.before[column]) = (length, from);
            }
        }
    }

    /// The column with the shortest path among those that are not done; the lowest such column if several are equal. There is
    /// always one, even if costs are infinite or NaN.
    fn nearest(&self) -> usize {
        let open = (0..self.reach.len()).filter(|&column| !self.done[column]);
        open.min_by(|&a, &b| self.reach[a].total_cmp(&self.reach[b])).expect("no more rows than columns")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec2;
    use proptest::prelude::*;

    fn assign(positions: &[Vec2], slots: &[Vec2]) -> Vec<usize> {
        least_cost(positions.len(), slots.len(), |row, slot| (positions[row] - slots[slot]).norm_squared())
    }

    fn cost(positions: &[Vec2], slots: &[Vec2], slot_of: &[usize]) -> f64 {
        positions.iter().zip(slot_of).map(|(p, &s)| (p - slots[s]).norm_squared()).sum()
    }

    /// The smallest total cost over all ways to assign the free slots to the drones that have none. `taken` holds the slots of
    /// the first drones.
    fn brute_force_cost(positions: &[Vec2], slots: &[Vec2], taken: &mut Vec<usize>) -> f64 {
        if taken.len() == positions.len() {
            return cost(positions, slots, taken);
        }
        let mut best = f64::INFINITY;
        for slot in 0..slots.len() {
            if !taken.contains(&slot) {
                taken.push(slot);
                best = best.min(brute_force_cost(positions, slots, taken));
                taken.pop();
            }
        }
        best
    }

    fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vec2>> {
        // Coordinates are whole numbers so that ties occur.
        prop::collection::vec((-5i32..6, -5i32..6).prop_map(|(x, y)| Vec2::new(x.into(), y.into())), count)
    }

    proptest! {
        #[test]
        fn no_assignment_is_cheaper(positions in points(0..6), extra in points(0..2), slots in points(6..7)) {
            let slots = [slots, extra].concat();
            let slot_of = assign(&positions, &slots);
            let mut distinct = slot_of.clone();
            distinct.sort_unstable();
            distinct.dedup();
            prop_assert_eq!(distinct.len(), positions.len(), "each drone has its own slot");
            let best = brute_force_cost(&positions, &slots, &mut Vec::new());
            prop_assert!((cost(&positions, &slots, &slot_of) - best).abs() < 1e-9);
        }
    }
}
