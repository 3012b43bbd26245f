//! The radio of a scenario: presets filled in, rules between keys checked, and the model that the drones use.

mod resolve;
mod rules;

pub(crate) use resolve::{channel, fill_preset, radio};
pub(crate) use rules::broken;
