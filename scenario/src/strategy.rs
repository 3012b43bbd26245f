//! How a leader assigns drones to routes.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// How a leader assigns drones to the routes past an obstacle set. Written as one word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Strategy {
    /// `congestion-aware-paper`, the default: the paper's rule (A3, C1), without simulation.
    #[default]
    PaperRule,
    /// `congestion-aware`: the leader looks ahead. It simulates a few good groupings and the shortest paths to the mission's
    /// end, and takes the best one by the scenario's [`Objective`](crate::Objective).
    LookAhead,
    /// `shortest-path`: every drone takes its shortest path.
    ShortestPath,
    /// `fixed:L/R`: L drones pass the only obstacle on its left, R drones on its right.
    Fixed {
        /// Number of drones on the left, seen along the flight.
        left: u32,
        /// Number of drones on the right.
        right: u32,
    },
}

/// The word is not a strategy.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{found:?} is no strategy: expected {words} or \"fixed:L/R\" (drones to the left and to the right)", words = quoted_words())]
pub struct StrategyError {
    found: String,
}

impl Strategy {
    /// The words without numbers, and their strategies.
    pub const WORDS: [(&str, Self); 3] = [
        ("congestion-aware-paper", Self::PaperRule),
        ("congestion-aware", Self::LookAhead),
        ("shortest-path", Self::ShortestPath),
    ];
}

fn quoted_words() -> String {
    Strategy::WORDS.map(|(word, _)| format!("{word:?}")).join(", ")
}

impl FromStr for Strategy {
    type Err = StrategyError;

    fn from_str(text: &str) -> Result<Self, StrategyError> {
        if let Some((_, strategy)) = Self::WORDS.iter().find(|(word, _)| *word == text) {
            return Ok(*strategy);
        }
        let count = |digits: &str| digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok()).flatten();
        text.strip_prefix("fixed:")
            .and_then(|counts| counts.split_once('/'))
            .and_then(|(left, right)| Some(Self::Fixed { left: count(left)?, right: count(right)? }))
            .ok_or_else(|| StrategyError { found: text.to_owned() })
    }
}

impl fmt::Display for Strategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LookAhead => f.write_str("congestion-aware"),
            Self::PaperRule => f.write_str("congestion-aware-paper"),
            Self::ShortestPath => f.write_str("shortest-path"),
            Self::Fixed { left, right } => write!(f, "fixed:{left}/{right}"),
        }
    }
}

impl TryFrom<String> for Strategy {
    type Error = StrategyError;

    fn try_from(text: String) -> Result<Self, StrategyError> {
        text.parse()
    }
}

impl From<Strategy> for String {
    fn from(strategy: Strategy) -> Self {
        strategy.to_string()
    }
}

impl JsonSchema for Strategy {
    fn schema_name() -> Cow<'static, str> {
        "Strategy".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let words = Self::WORDS.map(|(word, _)| word);
        json_schema!({
            "type": "string",
            "format": "strategy",
            "anyOf": [{ "enum": words }, { "pattern": "^fixed:[0-9]+/[0-9]+$" }],
        })
    }
}
