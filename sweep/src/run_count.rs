//! The number of runs of an experiment, counted before anything is made of it.

use crate::error::Problem;
use crate::limits::MAX_RUNS;

/// Counts the runs of an experiment: the product of the numbers of its scenarios, strategies, values and seeds.
#[derive(Debug)]
pub(crate) struct RunCount {
    cells: u128,
    seeds: u128,
    /// The key with the most values, and their number.
    most: (String, u64),
}

impl RunCount {
    /// A count with so many seeds.
    pub(crate) fn of_seeds(seeds: u64) -> Self {
        Self { cells: 1, seeds: u128::from(seeds.max(1)), most: ("seeds".to_owned(), seeds) }
    }

    /// Multiplies the cells by the number of values of the key with this path. A list without values does not count.
    pub(crate) fn times(&mut self, path: &str, values: u64) {
        self.cells = self.cells.saturating_mul(u128::from(values.max(1)));
        if values > self.most.1 {
            self.most = (path.to_owned(), values);
        }
    }

    /// Refuses too many runs. The path is that of the key with the most values.
    pub(crate) fn check(self) -> Result<(), (String, Box<Problem>)> {
        let runs = self.cells.saturating_mul(self.seeds);
        if runs <= MAX_RUNS {
            return Ok(());
        }
        let shown = |count: u128| if count == u128::MAX { "more than 10^38".to_owned() } else { count.to_string() };
        let (runs, cells) = (shown(runs), shown(self.cells));
        let problem = Problem::TooManyRuns { runs, cells, seeds: self.seeds, most: MAX_RUNS };
        Err((self.most.0, Box::new(problem)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(seeds: u64, keys: &[(&str, u64)]) -> Option<(String, String)> {
        let mut count = RunCount::of_seeds(seeds);
        keys.iter().for_each(|(path, values)| count.times(path, *values));
        count.check().err().map(|(path, problem)| (path, problem.to_string()))
    }

    #[test]
    fn ten_million_runs_are_the_most() {
        assert_eq!(refused(1_000_000, &[("grid.a", 10)]), None);
        let (path, text) = refused(1_000_000, &[("grid.a", 11)]).unwrap();
        assert_eq!(path, "seeds");
        assert_eq!(text, "found 11000000 runs, 11 cells with 1000000 seeds each, expected at most 10000000 runs");
        let (path, text) = refused(100_000, &[("grid.a", 10), ("grid.b", 10_000_000)]).unwrap();
        assert_eq!(path, "grid.b");
        assert!(text.contains("found 10000000000000 runs"), "{text}");
    }

    #[test]
    fn no_product_overflows() {
        let (_, text) = refused(u64::MAX, &["grid.a", "grid.b", "grid.c"].map(|path| (path, u64::MAX))).unwrap();
        assert!(text.starts_with("found more than 10^38 runs, more than 10^38 cells"), "{text}");
        assert_eq!(refused(0, &[("strategies", 0)]), None);
    }
}
