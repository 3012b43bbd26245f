//! A part of a sweep's runs, flown by one of several machines or jobs of a scheduler.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Greatest number of shards.
const MAX_SHARDS: usize = 1_000_000;

/// One of `count` shards: the runs whose number leaves the remainder `index` when it is divided by `count`. So each shard gets
/// its share of every combination.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Shard {
    /// From 0.
    index: usize,
    count: usize,
}

/// A text that names no shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("expected I/N, such as 2/7 for the second of seven shards, with I from 1 to N and N up to {MAX_SHARDS}")]
pub struct ShardError;

impl Shard {
    /// Whether a run belongs to the shard.
    #[must_use]
    pub fn holds(self, job: usize) -> bool {
        job % self.count == self.index
    }

    /// Number of its runs, of `runs` in all.
    #[must_use]
    pub fn len(self, runs: usize) -> usize {
        (runs + self.count - 1 - self.index) / self.count
    }

    /// All shards of the sweep that this is a shard of.
    #[must_use]
    pub fn all(self) -> Vec<Self> {
        (0..self.count).map(|index| Self { index, ..self }).collect()
    }

    /// A name for the shard's folder, such as `2-of-7`.
    #[must_use]
    pub fn folder_name(self) -> String {
        format!("{}-of-{}", self.index + 1, self.count)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index + 1, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let numbers =
            text.split_once('/').and_then(|(i, n)| Some((i.parse::<usize>().ok()?, n.parse::<usize>().ok()?)));
        let (number, count) = numbers.ok_or(ShardError)?;
        let valid = (1..=count).contains(&number) && count <= MAX_SHARDS;
        valid.then_some(Self { index: number.wrapping_sub(1), count }).ok_or(ShardError)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl TryFrom<String> for Shard {
    type Error = ShardError;

    fn try_from(text: String) -> Result<Self, ShardError> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_is_in_one_shard() {
        for runs in [0, 1, 6, 7, 100] {
            let shards: Vec<Shard> = (1..=7).map(|i| format!("{i}/7").parse().unwrap()).collect();
            assert!((0..runs).all(|job| shards.iter().filter(|shard| shard.holds(job)).count() == 1));
            for shard in shards {
                assert_eq!(shard.len(runs), (0..runs).filter(|&job| shard.holds(job)).count(), "{shard} of {runs}");
            }
        }
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "2", "0/7", "8/7", "1/0", "-1/7", "1/7/2", "a/b", "1/1000001"] {
            assert_eq!(text.parse::<Shard>(), Err(ShardError), "{text}");
        }
        let shard: Shard = "7/7".parse().unwrap();
        assert_eq!((shard.to_string(), shard.folder_name()), ("7/7".to_owned(), "7-of-7".to_owned()));
        assert_eq!(serde_json::from_str::<Shard>(&serde_json::to_string(&shard).unwrap()).unwrap(), shard);
    }
}
