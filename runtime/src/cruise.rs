//! The plainest pilot: it flies straight on.

use serde::Deserialize;
use skein_pilot::{Command, Inbox, Out, Params, Pilot, PilotError, Senses};

/// A pilot that keeps a velocity, whatever is in its way: by default the one of its first step. It says nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CruisePilot {
    velocity_mps: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CruiseParams {
    /// World frame.
    velocity_mps: Option<[f64; 3]>,
}

impl CruisePilot {
    /// A pilot with the parameter `velocity_mps`, if it is there: three numbers, world frame.
    pub(crate) fn new(params: &Params) -> Result<Self, PilotError> {
        let CruiseParams { velocity_mps } = params.parse()?;
        Ok(Self { velocity_mps })
    }
}

impl Pilot for CruisePilot {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
        Command::velocity(*self.velocity_mps.get_or_insert(senses.velocity_mps))
    }
}
