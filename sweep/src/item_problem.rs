//! A problem with a list of an experiment, or with an item of it.

use crate::error::Problem;
use std::collections::BTreeSet;
use std::fmt::Debug;

/// A problem, and the number of the item that has it; `None` if the whole list has it.
#[derive(Debug)]
pub(crate) struct ItemProblem {
    pub(crate) item: Option<usize>,
    pub(crate) problem: Box<Problem>,
}

impl ItemProblem {
    /// A problem of an item.
    pub(crate) fn of_item(number: usize, problem: Problem) -> Self {
        Self { item: Some(number), problem: Box::new(problem) }
    }

    /// Refuses a list that names something twice: the second one has the problem.
    pub(crate) fn unless_unique<T: Ord + Debug>(key: &str, items: &[T]) -> Result<(), Self> {
        let mut seen = BTreeSet::new();
        match items.iter().position(|item| !seen.insert(item)) {
            Some(i) => {
                Err(Self::of_item(i, Problem::Repeated { key: key.to_owned(), item: format!("{:?}", items[i]) }))
            }
            None => Ok(()),
        }
    }
}

impl From<Problem> for ItemProblem {
    /// A problem of the whole list.
    fn from(problem: Problem) -> Self {
        Self { item: None, problem: Box::new(problem) }
    }
}
