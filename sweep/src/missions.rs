//! The missions of a sweep, as each shard's folder keeps them, so that shards can be merged where the experiment file is not.

use crate::experiment::Experiment;
use serde::{Deserialize, Serialize};

/// An experiment with the overrides of all its runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Missions {
    pub(crate) experiment: Experiment,
    /// Key path and TOML value.
    pub(crate) overrides: Vec<(String, String)>,
    /// The program that flies them, as a shell reads it.
    pub(crate) program: String,
}
